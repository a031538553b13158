// What the server sends many times a second, drawn: charts, status line, pictures, facts.
// It speaks to the server that sent it and to nobody else.
"use strict";

const facts = window.studioFacts;
const KEPT = 60; // s that are kept for zooming and export
const byId = (id) => document.getElementById(id);

// ---- the last minute, column by column ---------------------------------------------------------

const past = {
  t: [], columns: { e: [], v: [], u: [], tau: [] }, steps: [], run: 0, runStart: null,

  add(message) {
    if (this.t.length && message.t[0] < this.t.at(-1) - 1e-6) this.clear();
    message.t.forEach((t, row) => {
      if (this.t.length && t <= this.t.at(-1)) return; // time stands still
      this.t.push(t);
      for (const name in this.columns) this.columns[name].push(message[name][row]);
    });
    if (message.run !== this.run) {
      this.run = message.run;
      this.runStart = message.t[0];
    }
    this.steps.push(...message.step_us.filter((step) => step > 0));
    if (this.steps.length > 1200) this.steps.splice(0, this.steps.length - 1200);
    while (this.t.length && this.t.at(-1) - this.t[0] > KEPT + 5) this.drop(5);
  },

  first(from) { return Math.max(this.t.findIndex((t) => t >= from), 0); },

  drop(seconds) {
    const first = this.first(this.t[0] + seconds);
    this.t.splice(0, first);
    for (const name in this.columns) this.columns[name].splice(0, first);
  },

  clear() {
    this.t.length = 0;
    for (const name in this.columns) this.columns[name].length = 0;
  },
};

const charts = new LiveCharts(facts, past);

// ---- numbers -----------------------------------------------------------------------------------

const live = { last: null, pictures: 0, messages: 0 };

function setText(element, text) {
  if (element && element.textContent !== text) element.textContent = text;
}

function percentile(values, share) {
  if (!values.length) return 0;
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}

function hear(message) {
  live.last = message;
  live.messages += 1;
  past.add(message);
  const status = byId("status");
  if (status.dataset.tone !== message.tone) status.dataset.tone = message.tone;
  setText(status.querySelector("span"), message.status);
  charts.take(message);
  if (live.messages % 4 === 0) {
    showFacts(message);
    showSeen(message);
  }
}

function warn(text) {
  const status = byId("status");
  status.dataset.tone = "warn";
  setText(status.querySelector("span"), text[0].toUpperCase() + text.slice(1));
}

function showFacts(message) {
  if (!byId("fact-energy")) return;
  const median = percentile(past.steps, 0.5), most = percentile(past.steps, 0.99);
  setText(byId("fact-energy"), `${message.energy.toFixed(2)} J`);
  setText(byId("fact-step"), `${median.toFixed(0)} · ${most.toFixed(0)} µs`);
  setText(byId("fact-late"), `${message.late_ms.p50.toFixed(2)} · ${message.late_ms.p99.toFixed(2)} ms`);
  setText(byId("fact-missed"), String(message.missed));
  setText(byId("fact-load"), `${message.load.toFixed(2)} kg`);
  setText(byId("fact-tool"), message.tool.map((x) => (100 * x).toFixed(1)).join(", ") + " cm");
  if (live.messages % 20 === 0) drawHistogram(most);
}

function drawHistogram(most) {
  const canvas = byId("histogram");
  if (!canvas || !past.steps.length) return;
  const style = getComputedStyle(document.body);
  const draw = canvas.getContext("2d");
  const [width, height] = [canvas.width, canvas.height];
  const bins = new Array(44).fill(0);
  const top = Math.max(1.3 * most, 1);
  past.steps.forEach((step) => { bins[Math.min(bins.length - 1, Math.floor(bins.length * step / top))] += 1; });
  const highest = Math.max(...bins);
  draw.clearRect(0, 0, width, height);
  draw.fillStyle = style.getPropertyValue("--accent");
  bins.forEach((count, k) => {
    const tall = (height - 40) * count / highest;
    draw.fillRect(k * width / bins.length + 1, height - 34 - tall, width / bins.length - 2, tall);
  });
  draw.fillStyle = style.getPropertyValue("--soft");
  draw.font = "22px system-ui, sans-serif";
  [0, 0.25, 0.5, 0.75].forEach((share) => {
    draw.fillText(`${(share * top).toFixed(0)}${share ? "" : " µs"}`, share * width, height - 6);
  });
}

// The things that were seen, each with what can be done about it.
function showSeen(message) {
  const list = byId("seen");
  if (!list) return;
  const key = JSON.stringify(message.seen.map((it) => [it.name, it.reach]));
  if (list.dataset.key !== key) {
    list.dataset.key = key;
    list.replaceChildren(...message.seen.map((it, index) => seenRow(it, index)));
  }
  message.seen.forEach((it, index) => {
    const row = list.children[index];
    setText(row.querySelector(".where"), `${it.point.map((x) => (100 * x).toFixed(1)).join(", ")} cm`);
    setText(row.querySelector(".sigma"), `depth ${(100 * it.depth).toFixed(1)} ± ${(100 * it.sigma).toFixed(1)} cm`);
  });
  const nothing = byId("nothing");
  nothing.hidden = message.seen.length > 0;
  nothing.dataset.text ??= nothing.textContent;
  setText(nothing, message.blind ? `No picture: ${message.blind}` : nothing.dataset.text);
  byId("picture").classList.toggle("old", Boolean(message.blind));
}

function seenRow(it, index) {
  const row = document.createElement("li");
  const swatch = document.createElement("i");
  swatch.style.background = it.colour;
  const name = document.createElement("b");
  name.textContent = it.name;
  const where = document.createElement("span");
  where.className = "where";
  where.title = "Its centre in the base frame [cm]";
  const sigma = document.createElement("span");
  sigma.className = "sigma";
  sigma.title = "Distance along the optical axis, with its standard deviation [cm]";
  row.append(swatch, name, where, sigma);
  if (it.reach) {
    const aim = document.createElement("button");
    aim.type = "button";
    aim.textContent = "Aim";
    aim.title = `Aim at the ${it.name} object`;
    aim.addEventListener("click", () => emitEvent("studio_aim", { index, name: it.name }));
    row.append(aim);
    if (facts.grasps) {
      const grasp = document.createElement("button");
      grasp.type = "button";
      grasp.textContent = "Grasp";
      grasp.title = `Let the arm grasp the ${it.name} object`;
      grasp.addEventListener("click", () => emitEvent("studio_grasp", { name: it.name }));
      row.append(grasp);
    }
  } else {
    const no = document.createElement("em");
    no.textContent = "out of reach";
    row.append(no);
  }
  return row;
}

// ---- pictures ----------------------------------------------------------------------------------

// A picture out of a JPEG; where the browser decodes bytes as they are, it need not be told of a blob,
// for which the page waits.
async function decode(data) {
  const type = "image/jpeg";
  if (!window.ImageDecoder) return createImageBitmap(new Blob([data], { type }));
  const decoder = new ImageDecoder({ data, type });
  try {
    return (await decoder.decode()).image;
  } finally {
    decoder.close();
  }
}

async function show(canvas, bytes) {
  const bitmap = await decode(bytes);
  const [width, height] = [bitmap.displayWidth ?? bitmap.width, bitmap.displayHeight ?? bitmap.height];
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  canvas.getContext("2d", { alpha: false }).drawImage(bitmap, 0, 0);
  bitmap.close();
}

let masked = false; // whether a mask came with the picture that comes next
const decoder = new TextDecoder();
function receive(event) {
  const bytes = new Uint8Array(event.data);
  const rest = bytes.subarray(1);
  const kind = String.fromCharCode(bytes[0]);
  if (kind === "N") hear(JSON.parse(decoder.decode(rest)));
  else if (kind === "F") warn(decoder.decode(rest));
  else if (document.hidden) return;
  else if (kind === "P") {
    live.pictures += 1;
    show(byId("picture"), rest);
    if (byId("mask")) byId("mask").hidden = !masked;
    masked = false;
  } else if (kind === "M") {
    masked = true;
    if (byId("mask")) show(byId("mask"), rest);
  }
}

// Where in the picture a click was, in its own pixels, whatever room it has.
function pixel(event) {
  const canvas = event.currentTarget;
  const box = canvas.getBoundingClientRect();
  const scale = Math.min(box.width / canvas.width, box.height / canvas.height);
  const u = (event.clientX - box.left - (box.width - scale * canvas.width) / 2) / scale;
  const v = (event.clientY - box.top - (box.height - scale * canvas.height) / 2) / scale;
  return { u: Math.floor(u), v: Math.floor(v), inside: u >= 0 && v >= 0 && u < canvas.width && v < canvas.height };
}

function listenToClicks() {
  byId("picture").addEventListener("click", (event) => {
    const at = pixel(event);
    if (at.inside) emitEvent("studio_picture", { u: at.u, v: at.v });
  });
}

// ---- keys --------------------------------------------------------------------------------------

const KEYS = { g: "Grasp", r: "Run", p: "Pause", Escape: "Stop" };
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const typing = event.target.closest?.("input, textarea, [role=combobox], [role=listbox]");
  const name = KEYS[event.key];
  if (!name || (typing && event.key !== "Escape")) return;
  document.querySelector(`.transport [data-key="${name}"]`)?.click();
});

// ---- what the page's buttons ask for -----------------------------------------------------------

function save(name, type, data) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([data], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function csv() {
  const names = ["e", "v", "u", "tau"];
  const head = ["t_s", ...names.flatMap((name) => facts.joints.map((joint) => `${name}_${joint}`))];
  const rows = past.t.map((t, row) => [t, ...names.flatMap((name) => past.columns[name][row])].join(","));
  return [head.join(","), ...rows].join("\n") + "\n";
}

function png() {
  charts.picture().toBlob((blob) => save("charts.png", "image/png", blob));
}

function keep() {
  if (past.runStart === null) return;
  const first = past.first(past.runStart);
  const columns = {};
  for (const name in past.columns) columns[name] = past.columns[name].slice(first);
  charts.kept = { t: past.t.slice(first).map((t) => t - past.runStart), columns };
}

// ---- light and dark ------------------------------------------------------------------------------

const night = {
  dark: null,

  look() {
    const dark = document.body.classList.contains("body--dark");
    const view = byId("view").contentWindow;
    if (view.quality) charts.fine(view.quality.level > 0);
    if (dark === this.dark || !view.night) return;
    this.dark = dark;
    charts.dress(dark);
    view.night.set(dark);
  },
};

// ---- the connection, which heals ---------------------------------------------------------------

function connect(attempt) {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  let retry = attempt;
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => { retry = 0; receive(event); };
  socket.onclose = () => {
    warn("Connection lost. Trying again …");
    setTimeout(() => connect(retry + 1), Math.min(3000, 250 * 2 ** retry));
  };
}

window.studio = {
  past, charts, live, png, keep,
  csv: () => save("charts.csv", "text/csv", csv()),
  pause: (paused) => charts.pause(paused),
  window: (seconds) => charts.zoom(seconds),
  forget: () => { charts.kept = null; },
};

// the page builds itself after this script has come
(function begin() {
  if (!(byId("status") && byId("picture") && byId("view") && byId("chart-tau"))) { setTimeout(begin, 20); return; }
  listenToClicks();
  setInterval(() => night.look(), 200);
  charts.begin();
  connect(0);
})();
