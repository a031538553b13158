// Charts on one time axis, drawn as SVG: cursor, hover values, limits, zoom. No dependency.
"use strict";

const SVG = "http://www.w3.org/2000/svg";
const MARGIN = { left: 50, right: 10, top: 6, bottom: 20 }; // px
const MAX_POINTS = 1600; // of a curve on the screen; a longer one is drawn by its extremes
const NEAR = 3; // a limit is inside the picture when it is at most so many times the largest value
const DASHES = ["", "8 3", "2 3"]; // for more joints than colours
const MAX_ZOOM = 400;

function make(parent, name, attributes = {}, text = "") {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text) element.textContent = text;
  parent.append(element);
  return element;
}

// The last row whose time is not after t.
function rowAt(times, t) {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t + 1e-9) low = middle;
    else high = middle - 1;
  }
  return low;
}

// What all charts share: the window of time, the cursor, which joints are shown.
class TimeAxis {
  constructor(duration) {
    Object.assign(this, { duration, from: 0, to: duration, cursor: 0, hidden: new Set(), charts: [] });
  }

  zoom(from, to) {
    const span = Math.min(this.duration, Math.max(this.duration / MAX_ZOOM, to - from));
    this.from = Math.max(0, Math.min(this.duration - span, (from + to - span) / 2));
    this.to = this.from + span;
    this.redraw();
  }

  zoomBy(factor, about = this.cursor) {
    const at = about < this.from || about > this.to ? (this.from + this.to) / 2 : about;
    this.zoom(at - (at - this.from) * factor, at + (this.to - at) * factor);
  }

  get isWhole() { return this.to - this.from > this.duration * (1 - 1e-9); }

  moveTo(t) {
    this.cursor = t;
    if (t < this.from - 1e-9 || t > this.to + 1e-9) { // follow the arm out of the window
      const span = this.to - this.from;
      const from = t < this.from ? t - 0.1 * span : t - 0.9 * span;
      this.zoom(from, from + span);
    } else this.charts.forEach((chart) => chart.showCursor());
  }

  redraw() { this.charts.forEach((chart) => chart.draw()); }
}

// One plot area with a time axis; what it shows is drawn by the classes below.
class Plot {
  constructor(host, axis, name, height) {
    Object.assign(this, { axis, width: 0, height });
    this.figure = document.createElement("figure");
    this.figure.className = "chart";
    host.append(this.figure);
    this.caption = document.createElement("figcaption");
    this.svg = make(this.figure, "svg", { role: "img", "aria-label": name });
    this.figure.prepend(this.caption);
    axis.charts.push(this);
    this.listen();
    new ResizeObserver(() => this.measure()).observe(this.svg);
  }

  measure() {
    if (document.body.dataset.printing) return;
    const { width, height } = this.svg.getBoundingClientRect();
    if (width < 80 || (width === this.width && height === this.height)) return;
    Object.assign(this, { width, height });
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.draw();
  }

  x(t) {
    const inner = this.width - MARGIN.left - MARGIN.right;
    return MARGIN.left + inner * (t - this.axis.from) / (this.axis.to - this.axis.from);
  }

  time(event) {
    const box = this.svg.getBoundingClientRect();
    const inner = box.width - MARGIN.left - MARGIN.right;
    const share = (event.clientX - box.left - MARGIN.left) / inner;
    const { from, to } = this.axis;
    return Math.max(from, Math.min(to, from + share * (to - from)));
  }

  // Drag moves the cursor, Shift and drag selects, Ctrl and wheel (or a pinch) zooms.
  listen() {
    let start = null;
    this.svg.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      this.svg.setPointerCapture(event.pointerId);
      start = { t: this.time(event), selects: event.shiftKey };
      if (!start.selects) this.onseek?.(start.t);
    });
    this.svg.addEventListener("pointermove", (event) => {
      const t = this.time(event);
      if (start && !start.selects) this.onseek?.(t);
      else if (start) this.select(start.t, t);
      this.onhover?.(this, start && !start.selects ? null : t, event);
    });
    this.svg.addEventListener("pointerup", (event) => {
      if (start?.selects) {
        const [a, b] = [start.t, this.time(event)].sort((p, q) => p - q);
        this.select(0, 0);
        if (this.x(b) - this.x(a) > 5) this.axis.zoom(a, b);
      }
      start = null;
    });
    this.svg.addEventListener("pointercancel", () => { start = null; });
    this.svg.addEventListener("pointerleave", (event) => this.onhover?.(this, null, event));
    this.svg.addEventListener("dblclick", () => this.axis.zoom(0, this.axis.duration));
    this.svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      this.axis.zoomBy(Math.exp(0.003 * event.deltaY), this.time(event));
    }, { passive: false });
  }

  select(a, b) {
    if (!this.selection) return;
    const [left, right] = [this.x(Math.min(a, b)), this.x(Math.max(a, b))];
    this.selection.setAttribute("x", left);
    this.selection.setAttribute("width", right - left);
  }

  start() {
    this.svg.replaceChildren();
    const id = `inside-${this.axis.charts.indexOf(this)}`;
    const clip = make(make(this.svg, "defs"), "clipPath", { id });
    const { left, right, top, bottom } = MARGIN;
    const [width, height] = [this.width - left - right, this.height - top - bottom];
    make(clip, "rect", { x: left, y: top, width, height });
    this.frame = { x: left, y: top, width, height };
    return make(this.svg, "g", { "clip-path": `url(#${id})` });
  }

  timeTicks(rules) {
    const bottom = this.height - MARGIN.bottom;
    const marks = ticks(this.axis.from, this.axis.to, Math.max(3, Math.min(12, this.width / 70)));
    marks.forEach(([t, text], k) => {
      const x = this.x(t);
      if (rules) make(this.svg, "line", { class: "rule", x1: x, x2: x, y1: MARGIN.top, y2: bottom });
      const anchor = x > this.width - 16 ? "end" : "middle";
      make(this.svg, "text", { x: anchor === "end" ? this.width : x, y: bottom + 14, "text-anchor": anchor },
        k === marks.length - 1 ? `${text} s` : text);
    });
  }

  finish() {
    const { y, height } = this.frame;
    this.selection = make(this.svg, "rect", { class: "selection", y, height, width: 0 });
    this.hoverLine = make(this.svg, "line", { class: "hover", y1: y, y2: y + height, visibility: "hidden" });
    this.cursorLine = make(this.svg, "line", { class: "cursor", y1: y, y2: y + height });
    this.showCursor();
  }

  showLine(line, t) {
    const seen = t !== null && t >= this.axis.from - 1e-9 && t <= this.axis.to + 1e-9;
    line.setAttribute("visibility", seen ? "visible" : "hidden");
    if (!seen) return;
    line.setAttribute("x1", this.x(t));
    line.setAttribute("x2", this.x(t));
  }

  hoverAt(t) { if (this.hoverLine) this.showLine(this.hoverLine, t); }

  showCursor() { if (this.cursorLine) this.showLine(this.cursorLine, this.axis.cursor); }
}

// One quantity of every joint.
class Chart extends Plot {
  constructor(host, axis, spec, joints, marks) {
    super(host, axis, `${spec.title} over time`, 0);
    Object.assign(this, { spec, joints, marks });
    const title = document.createElement("b");
    title.textContent = spec.title;
    const unit = document.createElement("small");
    unit.textContent = spec.label;
    const values = document.createElement("span");
    values.className = "values";
    this.values = joints.map((joint) => {
      const value = document.createElement("span");
      value.title = `${joint} at the cursor`;
      value.className = `joint-${joints.indexOf(joint)}`;
      values.append(value);
      return value;
    });
    this.caption.append(title, unit, values);
  }

  get shown() { return this.spec.series.map((_, k) => k).filter((k) => !this.axis.hidden.has(k)); }

  value(joint, t) {
    const series = this.spec.series[joint];
    return series.v[rowAt(series.t, t)];
  }

  // The rows of one curve inside the window, with one beyond each end.
  rows(series) {
    return [rowAt(series.t, this.axis.from), Math.min(series.t.length - 1, rowAt(series.t, this.axis.to) + 1)];
  }

  scale() {
    let [low, high, peak] = [0, 0, 0];
    if (!this.axis.isWhole) [low, high] = [Infinity, -Infinity];
    for (const joint of this.shown) {
      const series = this.spec.series[joint];
      const [first, last] = this.rows(series);
      for (let row = first; row <= last; row += 1) {
        low = Math.min(low, series.v[row]);
        high = Math.max(high, series.v[row]);
      }
    }
    if (!(low <= high)) [low, high] = [0, 0];
    peak = Math.max(Math.abs(low), Math.abs(high));
    if (this.axis.isWhole) {
      for (const limit of this.limits()) {
        if (!this.spec.must_show_limit && limit.value > NEAR * peak) continue;
        low = Math.min(low, -limit.value);
        high = Math.max(high, limit.value);
      }
    }
    const pad = 0.08 * (high - low) || 0.5 * (this.spec.band || 1);
    [this.low, this.high] = [low - pad, high + pad];
  }

  // Each different limit with the joints that have it.
  limits() {
    const found = new Map();
    (this.spec.limits || []).forEach((value, joint) => {
      if (value === null) return;
      if (!found.has(value)) found.set(value, []);
      found.get(value).push(this.joints[joint]);
    });
    return [...found].map(([value, names]) => ({ value, names }));
  }

  y(value) {
    const { y, height } = this.frame;
    return y + height * (this.high - value) / (this.high - this.low);
  }

  draw() {
    if (!this.width) return;
    const inside = this.start();
    this.scale();
    const { x, y, width, height } = this.frame;
    if (this.spec.band) this.drawBand(inside);
    this.timeTicks(true);
    for (const [value, text] of ticks(this.low, this.high, Math.max(3, height / 24))) {
      const at = this.y(value);
      if (at < y + 3 || at > y + height + 1) continue;
      make(this.svg, "line", { class: "rule", x1: x, x2: x + width, y1: at, y2: at });
      make(this.svg, "text", { x: x - 7, y: at + 4, "text-anchor": "end" }, text);
    }
    this.svg.append(inside);
    if (this.low < 0 && this.high > 0) {
      make(inside, "line", { class: "zero", x1: x, x2: x + width, y1: this.y(0), y2: this.y(0) });
    }
    this.drawVetoes(inside);
    for (const joint of this.shown) {
      const dash = DASHES[Math.floor(joint / 7) % DASHES.length];
      make(inside, "path", { class: `curve joint-${joint}`, d: this.path(joint), "stroke-dasharray": dash });
    }
    this.drawMarks(inside);
    this.drawLimits(inside);
    this.dots = this.shown.map((joint) => [joint, make(inside, "circle", { class: `dot joint-${joint}`, r: 3.4 })]);
    this.finish();
  }

  drawBand(inside) {
    const { x, width } = this.frame;
    const [top, bottom] = [this.y(this.spec.band), this.y(-this.spec.band)];
    make(inside, "rect", { class: "band", x, y: top, width, height: Math.max(1, bottom - top) });
  }

  // Steps without an optimum, as a shade behind the curves.
  drawVetoes(inside) {
    for (const { start, end, level } of this.marks.segments) {
      if (level < 2 || end < this.axis.from || start > this.axis.to) continue;
      const [left, right] = [this.x(start), this.x(end)];
      const { y, height } = this.frame;
      make(inside, "rect", { class: `veto level-${level}`, x: left, width: Math.max(1.5, right - left), y, height });
    }
  }

  drawMarks(inside) {
    const settled = this.marks.settled;
    if (settled === null) return;
    const [x, { y, height }] = [this.x(settled), this.frame];
    make(inside, "line", { class: "settled-line", x1: x, x2: x, y1: y, y2: y + height });
    if (this.axis.charts[0] !== this) return;
    const late = settled > this.axis.from + 0.7 * (this.axis.to - this.axis.from);
    const low = this.y(0) < y + height / 2;
    make(inside, "text", {
      class: "settled halo", x: x + (late ? -6 : 6), y: low ? y + height - 6 : y + 12,
      "text-anchor": late ? "end" : "start",
    }, `settled ${figure(settled, 2)} s`);
  }

  drawLimits(inside) {
    const { x, y, width } = this.frame;
    let outside = 0;
    for (const { value, names } of this.limits()) {
      const owners = names.length === this.joints.length ? "" : ` (${names.length < 3 ? names.join(", ") : `${names.length} joints`})`;
      const text = `limit ±${Number(value.toPrecision(4))} ${this.spec.unit}${owners}`;
      const seen = [value, -value].filter((each) => each < this.high && each > this.low);
      for (const each of seen) make(inside, "line", { class: "limit-line", x1: x, x2: x + width, y1: this.y(each), y2: this.y(each) });
      if (seen.length === 0 && outside++ > 0) continue;
      const at = seen.length ? this.y(seen[0]) + (seen[0] > 0 ? 13 : -5) : y + 11;
      make(inside, "text", { class: "limit halo", x: x + width - 4, y: at, "text-anchor": "end" },
        seen.length ? text : `${text}, outside the picture`);
    }
  }

  path(joint) {
    const series = this.spec.series[joint];
    const [first, last] = this.rows(series);
    const piece = Math.max(1, Math.ceil((last - first + 1) / (MAX_POINTS / 2)));
    let text = "";
    const add = (row) => {
      text += `${text ? "L" : "M"}${this.x(series.t[row]).toFixed(1)} ${this.y(series.v[row]).toFixed(1)}`;
    };
    for (let at = first; at <= last; at += piece) {
      let [least, most] = [at, at];
      for (let row = at; row < Math.min(at + piece, last + 1); row += 1) {
        if (series.v[row] < series.v[least]) least = row;
        if (series.v[row] > series.v[most]) most = row;
      }
      add(Math.min(least, most));
      if (least !== most) add(Math.max(least, most));
    }
    add(last);
    return text;
  }

  showCursor() {
    super.showCursor();
    const t = this.axis.cursor;
    this.values.forEach((value, joint) => {
      value.hidden = this.axis.hidden.has(joint);
      value.textContent = readable(this.value(joint, t));
    });
    for (const [joint, dot] of this.dots || []) {
      dot.setAttribute("cx", this.x(t));
      dot.setAttribute("cy", this.y(this.value(joint, t)));
    }
  }
}

// Stretches of time with a name each, as a coloured strip: what the controller said, a task's phases.
class Strip extends Plot {
  constructor(host, axis, name, segments) {
    super(host, axis, `${name} over time`, 0);
    this.segments = segments;
    this.figure.classList.add("strip");
    const title = document.createElement("b");
    title.textContent = name;
    this.said = document.createElement("span");
    this.said.className = "values said";
    this.caption.append(title, this.said);
  }

  draw() {
    if (!this.width) return;
    const inside = this.start();
    const { y, height } = this.frame;
    for (const { start, end, kind, name, sentence } of this.segments) {
      if (end < this.axis.from || start > this.axis.to) continue;
      const [left, right] = [this.x(start), this.x(end)];
      const box = make(inside, "rect", { class: kind, x: left, width: Math.max(1.5, right - left), y, height });
      make(box, "title", {}, sentence || name);
      if (sentence && right - left > 6.5 * name.length + 6) {
        make(inside, "text", { class: "phase-name", x: (left + right) / 2, y: y + height - 2, "text-anchor": "middle" }, name);
      }
    }
    this.timeTicks(false);
    this.finish();
  }

  showCursor() {
    super.showCursor();
    const now = this.segments[rowAt(this.segments.map((each) => each.start), this.axis.cursor)];
    this.said.textContent = !now ? "" : now.sentence ? `${now.name}: ${now.sentence}` : now.name;
  }
}
