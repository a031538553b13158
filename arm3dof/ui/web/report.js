// The report: charts that move with the replay of scene.js, and the tables beside them.
"use strict";

const report = { axis: null, charts: [] };

function element(name, text = "", kind = "") {
  const made = document.createElement(name);
  made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

// ---- charts: one cursor for them and for the arm ------------------------------------------------

function seek(t) {
  player.seek(Math.round(t * player.fps));
}

function showReport(message) {
  const axis = new TimeAxis(message.duration);
  const marks = { segments: message.segments, settled: message.settled };
  const host = $("#charts");
  host.replaceChildren();
  setColours(message.colours);
  message.charts.forEach((spec) => new Chart(host, axis, spec, message.joints, marks));
  new Strip(host, axis, "Control steps", message.segments.map((each) => ({ ...each, kind: `level-${each.level}` })));
  if (message.phases.length) {
    new Strip(host, axis, "Task", message.phases.map((each, k) => ({ ...each, kind: `phase-${k % 2}` })));
  }
  const tip = element("div");
  tip.id = "tip";
  tip.hidden = true;
  host.append(tip);
  for (const chart of axis.charts) {
    chart.onseek = seek;
    chart.onhover = (over, t, event) => showTip(tip, message, over, t, event);
  }
  report.axis = axis;
  report.charts = axis.charts;
  player.watchers = [(t) => axis.moveTo(Math.min(t, axis.duration))];
  showLegend(message.joints);
  showDetails(message);
  showMarks(message);
}

function setColours({ light, dark }) {
  const rule = (colours, theme) => colours.map((colour, k) => `.report${theme} .joint-${k} { --of: ${colour}; }`).join("\n");
  const style = element("style", `${rule(light, "")}\n${rule(dark, ".dark")}`);
  document.head.append(style);
}

function showLegend(joints) {
  $("#legend").replaceChildren(...joints.map((name, joint) => {
    const button = element("button", name, `joint-${joint}`);
    button.type = "button";
    button.title = `Show or hide ${name}`;
    button.setAttribute("aria-pressed", true);
    button.addEventListener("click", () => {
      const { hidden } = report.axis;
      if (hidden.has(joint)) hidden.delete(joint); else hidden.add(joint);
      button.setAttribute("aria-pressed", !hidden.has(joint));
      report.axis.redraw();
    });
    return button;
  }));
}

function showTip(tip, message, over, t, event) {
  report.charts.forEach((chart) => chart.hoverAt(t));
  tip.hidden = t === null || !over.spec;
  if (tip.hidden) return;
  const lines = over.shown.map((joint) => {
    const line = element("span");
    line.append(element("i", message.joints[joint], `joint-${joint}`), element("b", `${readable(over.value(joint, t))} ${over.spec.unit}`));
    return line;
  });
  tip.replaceChildren(element("span", `t = ${figure(t, 3)} s`), ...lines);
  const box = $("#charts").getBoundingClientRect();
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  tip.style.left = `${x > box.width / 2 ? x - tip.offsetWidth - 14 : x + 14}px`;
  tip.style.top = `${Math.max(0, y - tip.offsetHeight / 2)}px`;
}

const zoomActions = {
  in: () => report.axis.zoomBy(0.5),
  out: () => report.axis.zoomBy(2),
  all: () => report.axis.zoom(0, report.axis.duration),
};
document.querySelectorAll("[data-zoom]").forEach((button) => {
  button.addEventListener("click", () => zoomActions[button.dataset.zoom]());
});
document.addEventListener("keydown", (event) => {
  const action = { "+": "in", "=": "in", "-": "out", 0: "all" }[event.key];
  if (!action || !report.axis || event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.target.closest("input[type=text], select")) return;
  zoomActions[action]();
  event.preventDefault();
});

// ---- tables -------------------------------------------------------------------------------------

function panel(title, ...parts) {
  const made = element("section", "", "panel");
  made.append(element("h2", title), ...parts);
  return made;
}

function table(rows, head = null) {
  const made = element("table");
  const fill = (row, cells, tag) => cells.forEach((cell, k) => {
    const isName = k === 0;
    const made = element(isName ? "th" : tag, "", !isName && head ? "number" : "");
    made.append(cell);
    if (tag === "th" || isName) made.scope = isName && tag !== "th" ? "row" : "col";
    row.append(made);
  });
  if (head) fill(made.createTHead().insertRow(), head, "th");
  const body = made.createTBody();
  rows.forEach((cells) => fill(body.insertRow(), cells, "td"));
  return made;
}

function showDetails(message) {
  const parts = message.tables.map(({ title, head, rows }) => panel(title, table(rows, head)));
  const steps = message.kinds.map(({ name, level, sentence, count }) => {
    const title = element("span");
    title.append(element("i", "", `level-${level}`), name);
    return [title, `${count}`, sentence];
  });
  parts.push(panel("Control steps", table(steps)));
  if (message.picture) {
    const picture = document.createElement("img");
    picture.src = message.picture;
    picture.alt = "The picture in which the target was found, with the frames drawn around it";
    const seen = panel("What the camera saw", picture);
    seen.classList.add("picture");
    parts.unshift(seen);
  }
  $("#details").replaceChildren(...parts);
}

// What was not an optimum, and when the arm settled, below the time slider.
function showMarks({ segments, duration }) {
  const track = element("div", "", "track");
  const marks = element("div");
  marks.id = "marks";
  marks.setAttribute("aria-hidden", true);
  $("#time").replaceWith(track);
  track.append(timeInput, marks);
  marks.append(...segments.filter(({ level }) => level > 0).map(({ start, end, level, name }) => {
    const mark = element("i", "", `level-${level}`);
    mark.style.left = `${100 * start / duration}%`;
    mark.style.width = `${100 * (end - start) / duration}%`;
    mark.title = name;
    return mark;
  }));
}
const timeInput = $("#time");

// ---- headline: tiles in place of the card's list ------------------------------------------------

function showHeadline(message) {
  showCaption(message);
  $("#caption dl").replaceChildren(...message.facts.map(([name, value]) => {
    const tile = element("div");
    tile.append(element("dt", name), element("dd", value));
    return tile;
  }));
}

// ---- light and dark -----------------------------------------------------------------------------

const BACKDROPS = {
  light: { top: [0.957, 0.969, 0.98], bottom: [0.79, 0.83, 0.87], floor: 1 },
  dark: { top: [0.075, 0.095, 0.12], bottom: [0.15, 0.185, 0.225], floor: 0.2 },
};

function setTheme(theme) {
  document.body.classList.toggle("dark", theme === "dark");
  $("#theme").textContent = theme === "dark" ? "Light" : "Dark";
  const { top, bottom, floor } = BACKDROPS[theme];
  viewer.set_property(["Background"], "top_color", top);
  viewer.set_property(["Background"], "bottom_color", bottom);
  const disc = viewer.scene_tree.children.floor?.children.disc?.children["<object>"]?.object;
  disc?.material.color.setScalar(floor);
  viewer.set_dirty();
}
const prefersDark = window.matchMedia("(prefers-color-scheme: dark)");
const systemTheme = () => (prefersDark.matches ? "dark" : "light");
prefersDark.addEventListener("change", () => setTheme(systemTheme()));
$("#theme").addEventListener("click", () => setTheme(document.body.classList.contains("dark") ? "light" : "dark"));

// ---- print: a still in place of the live view -----------------------------------------------------

window.addEventListener("beforeprint", () => {
  document.body.dataset.printing = "yes";
  document.body.dataset.theme = document.body.classList.contains("dark") ? "dark" : "light";
  setTheme("light");
  $("#still").src = viewer.capture_image();
  $("#still").hidden = false;
});
window.addEventListener("afterprint", () => {
  delete document.body.dataset.printing;
  $("#still").hidden = true;
  setTheme(document.body.dataset.theme);
});

// ---- the page scrolls over the 3-D view; Ctrl and wheel, or a pinch, zooms in it --------------------

$("#stage").addEventListener("wheel", (event) => {
  if (!event.ctrlKey && !event.metaKey) event.stopPropagation();
}, { capture: true });

pageCommands.caption = showHeadline;
pageCommands.report = showReport;
pageCommands.batch = (command) => {
  command.commands.forEach((each) => viewer.handle_command(each));
  setTheme(systemTheme());
};
