// What the server sends many times a second, drawn: charts, status line, pictures.
// It speaks to the server that sent it and to nobody else.
"use strict";

const facts = window.studioFacts;
const WINDOW = 10; // s that the charts show
const KEPT = 60; // s that are kept for zooming and export
const DEGREE = 180 / Math.PI;
const byId = (id) => document.getElementById(id);

// ---- the last minute, column by column ---------------------------------------------------------

const past = {
  t: [], columns: { e: [], v: [], u: [], tau: [] },

  add(message) {
    if (this.t.length && message.t[0] < this.t.at(-1) - 1e-6) this.clear();
    message.t.forEach((t, row) => {
      if (this.t.length && t <= this.t.at(-1)) return; // time stands still
      this.t.push(t);
      for (const name in this.columns) this.columns[name].push(message[name][row]);
    });
    while (this.t.length && this.t.at(-1) - this.t[0] > KEPT + 5) this.drop(5);
  },

  drop(seconds) {
    const first = this.t.findIndex((t) => t > this.t[0] + seconds);
    this.t.splice(0, first);
    for (const name in this.columns) this.columns[name].splice(0, first);
  },

  clear() {
    this.t.length = 0;
    for (const name in this.columns) this.columns[name].length = 0;
  },
};

// ---- charts ------------------------------------------------------------------------------------

const charts = {
  paused: false,
  drawn: 0,

  // Colours of lines and letters, which the page's light or dark decides.
  dress() {
    const style = getComputedStyle(document.body);
    const [ink, line, card] = ["--soft", "--line", "--card"].map((name) => style.getPropertyValue(name).trim());
    for (const name in facts.charts) {
      this.get(name)?.setOption({
        xAxis: { axisLabel: { color: ink } },
        yAxis: { axisLabel: { color: ink }, axisLine: { lineStyle: { color: line } }, splitLine: { lineStyle: { color: line } } },
        tooltip: { backgroundColor: card, borderColor: line, textStyle: { color: style.color, fontSize: 12 } },
      });
    }
  },

  get(name) { return getElement(facts.charts[name])?.chart; },

  draw(message) {
    if (this.paused || document.hidden) return;
    const last = past.t.at(-1);
    if (last === undefined) return;
    const from = Math.max(past.t.findIndex((t) => t >= last - WINDOW), 0);
    const t = past.t.slice(from);
    const ahead = message.plan_t.length ? message.plan_t.at(-1) : last;
    for (const name in facts.charts) {
      const chart = this.get(name);
      if (!chart) continue;
      const scale = name === "e" ? DEGREE : 1;
      const column = past.columns[name];
      const series = facts.joints.map((joint, k) => ({
        name: joint, data: t.map((time, row) => [time, scale * column[from + row][k]]),
      }));
      chart.setOption({
        xAxis: { min: last - WINDOW, max: Math.max(last, Math.min(ahead, last + 1)) },
        series,
      }, { lazyUpdate: true });
    }
    this.drawn += 1;
  },
};

// ---- numbers -----------------------------------------------------------------------------------

const live = { last: null, pictures: 0, messages: 0 };

function hear(message) {
  live.last = message;
  live.messages += 1;
  past.add(message);
  const status = byId("status");
  if (status.dataset.tone !== message.tone) status.dataset.tone = message.tone;
  const text = status.querySelector("span");
  if (text.textContent !== message.status) text.textContent = message.status;
  charts.draw(message);
}

async function show(canvas, bytes) {
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
  if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
    canvas.width = bitmap.width;
    canvas.height = bitmap.height;
  }
  canvas.getContext("2d").drawImage(bitmap, 0, 0);
  bitmap.close();
}

const decoder = new TextDecoder();
function receive(event) {
  const bytes = new Uint8Array(event.data);
  const rest = bytes.subarray(1);
  const kind = String.fromCharCode(bytes[0]);
  if (kind === "N") hear(JSON.parse(decoder.decode(rest)));
  else if (document.hidden) return;
  else if (kind === "P") { live.pictures += 1; show(byId("picture"), rest); }
  else if (kind === "M") show(byId("mask"), rest);
}

// ---- the connection, which heals ---------------------------------------------------------------

function connect(attempt) {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  let retry = attempt;
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => { retry = 0; receive(event); };
  socket.onclose = () => {
    const status = byId("status");
    status.dataset.tone = "warn";
    status.querySelector("span").textContent = "Connection lost. Trying again …";
    setTimeout(() => connect(retry + 1), Math.min(3000, 250 * 2 ** retry));
  };
}

// ---- light and dark ------------------------------------------------------------------------------

const night = {
  dark: null,

  look() {
    const dark = document.body.classList.contains("body--dark");
    const view = byId("view").contentWindow;
    const ready = facts.joints.length && charts.get("tau") && view.night;
    if (dark === this.dark || !ready) return;
    this.dark = dark;
    charts.dress();
    view.night.set(dark);
  },
};
setInterval(() => byId("view") && night.look(), 200);

window.studio = { past, charts, live };

// the page builds itself after this script has come
(function begin() {
  if (byId("status") && byId("picture") && byId("view")) connect(0);
  else setTimeout(begin, 20);
})();
