// The live charts: one canvas each, drawn anew many times a second, which SVG would be too slow for.
// They share a window of time; what has happened is a line, a kept run dashed, the plan dotted.
"use strict";

const MARGIN = { left: 42, right: 10, top: 8, bottom: 20 }; // px
const DASHES = { now: [], kept: [6, 4], plan: [1.5, 3] };
const SPANS = { least: 1, most: 60 }; // s of a window
const BESIDE = 0.2; // px that a point may lie beside the line
const FONT = "10px system-ui, sans-serif";

// The last row of increasing times that is not after t; -1 before the first.
function rowBefore(times, t) {
  let [low, high] = [-1, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

// A curve: times and rows of joints, of which one is drawn between two times.
class Curve {
  constructor(kind, joint, times, rows, scale, shift = 0) {
    Object.assign(this, { kind, joint, times, rows, scale, shift });
  }

  // The rows inside a window, with one beyond each end.
  clip({ from, to }) {
    this.first = Math.max(0, rowBefore(this.times, from - this.shift));
    this.last = Math.min(this.times.length - 1, rowBefore(this.times, to - this.shift) + 1);
    return this;
  }

  get length() { return Math.max(0, this.last - this.first + 1); }
  t(row) { return this.times[row] + this.shift; }
  y(row) { return this.scale * this.rows[row][this.joint]; }

  at(t) {
    const row = rowBefore(this.times, t - this.shift);
    return row < 0 ? undefined : this.y(row);
  }
}

class LiveChart {
  constructor(canvas, spec) {
    Object.assign(this, { canvas, spec, curves: [], window: { from: 0, to: 1 } });
  }

  // Draw curves over a window of time, and the values at a time that is pointed at.
  show(curves, window, look, pointed = null) {
    const box = this.canvas.getBoundingClientRect();
    if (box.width < 60 || box.height < 40) return;
    Object.assign(this, { curves, window, width: box.width, height: box.height });
    const ratio = devicePixelRatio;
    const [wide, tall] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    if (this.canvas.width !== wide || this.canvas.height !== tall) {
      Object.assign(this.canvas, { width: wide, height: tall });
    }
    const draw = this.canvas.getContext("2d", { alpha: false }); // what is below need not be drawn
    draw.setTransform(ratio, 0, 0, ratio, 0, 0);
    draw.fillStyle = look.card;
    draw.fillRect(0, 0, box.width, box.height);
    this.paint(draw, look, pointed);
  }

  // Paint in an area of the size that was last shown.
  paint(draw, look, pointed) {
    const { left, right, top, bottom } = MARGIN;
    this.frame = { x: left, y: top, w: this.width - left - right, h: this.height - top - bottom };
    this.curves.forEach((curve) => curve.clip(this.window));
    [this.low, this.high] = this.range();
    draw.font = FONT;
    this.paintRules(draw, look);
    draw.save();
    draw.beginPath();
    draw.rect(this.frame.x, this.frame.y, this.frame.w, this.frame.h);
    draw.clip();
    this.paintLimits(draw, look);
    this.curves.forEach((curve) => this.paintCurve(draw, look, curve));
    draw.restore();
    if (pointed !== null) this.paintValues(draw, look, pointed);
  }

  x(t) { return this.frame.x + this.frame.w * (t - this.window.from) / (this.window.to - this.window.from); }
  y(value) { return this.frame.y + this.frame.h * (this.high - value) / (this.high - this.low); }

  time(event) {
    const { from, to } = this.window;
    return from + (to - from) * (event.offsetX - this.frame.x) / this.frame.w;
  }

  // Bounds around the curves, never closer than what is worth a look.
  range() {
    let [low, high] = [Infinity, -Infinity];
    for (const curve of this.curves) {
      for (let row = curve.first; row <= curve.last; row += 1) {
        const value = curve.y(row);
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (!(low <= high)) return [-this.spec.span, this.spec.span];
    const room = Math.max(0.08 * (high - low), (this.spec.span - (high - low)) / 2);
    return [low - room, high + room];
  }

  paintRules(draw, look) {
    const { x, y, w, h } = this.frame;
    draw.lineWidth = 1;
    draw.strokeStyle = look.line;
    draw.fillStyle = look.soft;
    draw.textAlign = "right";
    draw.textBaseline = "middle";
    draw.beginPath();
    for (const [value, text] of ticks(this.low, this.high, Math.max(2, h / 32))) {
      const at = Math.round(this.y(value)) + 0.5;
      if (at < y + 2 || at > y + h + 1) continue;
      draw.moveTo(x, at);
      draw.lineTo(x + w, at);
      draw.fillText(text, x - 5, at);
    }
    draw.stroke();
    draw.textAlign = "center";
    draw.textBaseline = "top";
    for (const [t, text] of ticks(this.window.from, this.window.to, Math.max(2, w / 48))) {
      const at = this.x(t);
      if (at > x + 8 && at < x + w - 12) draw.fillText(text, at, y + h + 5);
    }
    draw.textAlign = "right";
    draw.fillText("s", x + w, y + h + 5);
  }

  paintLimits(draw, look) {
    draw.setLineDash([4, 3]);
    draw.strokeStyle = look.limit;
    draw.lineWidth = 1;
    for (const limit of this.spec.limits) {
      for (const value of [limit, -limit]) {
        draw.beginPath();
        draw.moveTo(this.frame.x, this.y(value));
        draw.lineTo(this.frame.x + this.frame.w, this.y(value));
        draw.stroke();
      }
    }
  }

  paintCurve(draw, look, curve) {
    if (curve.length < 2) return;
    draw.setLineDash(DASHES[curve.kind]);
    draw.strokeStyle = look.colours[curve.joint % look.colours.length];
    draw.globalAlpha = curve.kind === "kept" ? 0.6 : 1;
    draw.lineWidth = look.fine ? 1 : curve.kind === "now" ? 1.8 : 1.3;
    draw.lineJoin = "bevel";
    draw.beginPath();
    this.trace(draw, curve);
    draw.stroke();
    draw.globalAlpha = 1;
  }

  // Go along a curve through as few of its points as leave none of the others beside it: hundreds lie
  // within a hundred pixels, and to stroke them costs more than all else.
  trace(draw, { first, last, times, rows, joint, scale, shift }) {
    const { x: left, y: top, w, h } = this.frame;
    const [across, down] = [w / (this.window.to - this.window.from), h / (this.high - this.low)];
    let [fromX, fromY, beforeX, beforeY] = [0, 0, 0, 0];
    let [least, most] = [-Infinity, Infinity]; // slopes that pass every point since the last corner
    for (let row = first; row <= last; row += 1) {
      const x = left + across * (times[row] + shift - this.window.from);
      const y = top + down * (this.high - scale * rows[row][joint]);
      const slope = (y - fromY) / (x - fromX);
      if (row === first) draw.moveTo(x, y);
      if (row === first || !(slope >= least && slope <= most)) { // what is no number as well
        if (row > first) draw.lineTo(beforeX, beforeY);
        [fromX, fromY] = row === first ? [x, y] : [beforeX, beforeY];
        [least, most] = [-Infinity, Infinity];
      }
      if (x > fromX) {
        least = Math.max(least, (y - BESIDE - fromY) / (x - fromX));
        most = Math.min(most, (y + BESIDE - fromY) / (x - fromX));
      }
      [beforeX, beforeY] = [x, y];
    }
    draw.lineTo(beforeX, beforeY);
  }

  // A rule at a time, and beside it what every curve is there.
  paintValues(draw, look, t) {
    const lines = this.curves.filter((curve) => curve.kind === "now").map((curve) => {
      const value = curve.at(t);
      return value === undefined ? null : [look.colours[curve.joint % look.colours.length],
        `${look.joints[curve.joint]}  ${readable(value)} ${this.spec.unit}`];
    }).filter(Boolean);
    const { x, y, w, h } = this.frame;
    const at = this.x(t);
    if (!lines.length || at < x || at > x + w) return;
    draw.setLineDash([]);
    draw.strokeStyle = look.soft;
    draw.beginPath();
    draw.moveTo(at, y);
    draw.lineTo(at, y + h);
    draw.stroke();
    lines.unshift([look.soft, `${figure(t, 2)} s`]);
    draw.font = "11px system-ui, sans-serif";
    const wide = Math.max(...lines.map(([, text]) => draw.measureText(text).width)) + 14;
    const corner = [at > x + w / 2 ? at - wide - 6 : at + 6, y + 2];
    draw.fillStyle = look.card;
    draw.strokeStyle = look.line;
    draw.beginPath();
    draw.roundRect(...corner, wide, 15 * lines.length + 6, 5);
    draw.fill();
    draw.stroke();
    draw.textAlign = "left";
    draw.textBaseline = "middle";
    lines.forEach(([colour, text], k) => {
      draw.fillStyle = colour;
      draw.fillText(text, corner[0] + 7, corner[1] + 10.5 + 15 * k);
    });
  }
}

// All charts: the window that they share, what they show, and the hand that points, zooms and pulls.
class LiveCharts {
  constructor(facts, past) {
    Object.assign(this, {
      facts, past, all: new Map(), paused: false, span: 10, back: 0, kept: null, plan: null,
      due: false, drawn: 0, pointed: null, look: null,
    });
  }

  // Begin to draw, once the page has been built.
  begin() {
    for (const spec of this.facts.charts) {
      const canvas = document.getElementById(`chart-${spec.name}`);
      const chart = new LiveChart(canvas, spec);
      this.all.set(spec.name, chart);
      this.listen(canvas, chart);
      new ResizeObserver(() => this.ask()).observe(canvas);
    }
    document.addEventListener("visibilitychange", () => this.ask());
  }

  get(name) { return this.all.get(name); }

  // What has come is drawn with the next frame of the screen; without news there are no frames.
  ask() {
    if (this.due || !this.look || document.hidden) return;
    this.due = true;
    requestAnimationFrame(() => this.draw());
  }

  take(message) {
    this.plan = message;
    if (!this.paused) this.ask();
  }

  draw() {
    this.due = false;
    const last = this.stopped ?? this.past.t.at(-1);
    if (last === undefined) return;
    const ahead = this.plan?.plan_t.length ? Math.min(this.plan.plan_t.at(-1), last + 1) : last;
    const to = Math.max(ahead, last) - this.back;
    const window = { from: to - this.span, to };
    for (const chart of this.all.values()) chart.show(this.curves(chart.spec), window, this.look, this.pointed);
    this.drawn += 1;
  }

  curves({ name, scale, planned }) {
    const { past, kept, plan } = this;
    const of = (kind, t, rows, shift) => this.facts.joints.map((_, joint) => new Curve(kind, joint, t, rows, scale, shift));
    const curves = kept && past.runStart !== null ? of("kept", kept.t, kept.columns[name], past.runStart) : [];
    curves.push(...of("now", past.t, past.columns[name]));
    if (planned && plan?.plan_t.length) curves.push(...of("plan", plan.plan_t, plan[`plan_${name}`]));
    return curves;
  }

  // Where the page is slow, what moves has the thinnest lines, which cost a quarter.
  fine(fine) {
    if (!this.look || this.look.fine === fine) return;
    this.look.fine = fine;
    this.ask();
  }

  pause(paused) {
    this.paused = paused;
    this.stopped = paused ? this.past.t.at(-1) : undefined;
    if (!paused) this.back = 0;
    this.ask();
  }

  zoom(span) {
    this.span = Math.max(SPANS.least, Math.min(SPANS.most, span));
    this.ask();
  }

  // Colours of lines and letters, which the page's light or dark decides.
  dress(dark) {
    const style = getComputedStyle(document.body);
    const [soft, line, card, limit] = ["--soft", "--line", "--card", "--stop"].map((name) => style.getPropertyValue(name).trim());
    const colours = this.facts.colours[dark ? "dark" : "light"];
    this.look = { soft, line, card, limit, colours, joints: this.facts.joints, fine: false };
    document.querySelectorAll(".legend i").forEach((mark, joint) => { mark.style.background = colours[joint % colours.length]; });
    this.ask();
  }

  // The wheel zooms, a drag looks back while the charts stand still, a double click forgets both.
  listen(canvas, chart) {
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(this.span * Math.exp(0.002 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("pointermove", (event) => {
      if (!chart.frame) return;
      if (event.buttons & 1 && this.paused) {
        const most = Math.max(0, this.stopped - this.past.t[0] - this.span / 2);
        this.back = Math.max(0, Math.min(most, this.back + this.span * event.movementX / chart.frame.w));
      }
      this.pointed = chart.time(event);
      this.ask();
    });
    canvas.addEventListener("pointerleave", () => { this.pointed = null; this.ask(); });
    canvas.addEventListener("dblclick", () => { this.back = 0; this.zoom(10); });
  }

  // All charts as one picture, with their titles, two by two.
  picture(ratio = 2) {
    const charts = [...this.all.values()], title = 22;
    const { width, height } = charts[0];
    const sheet = document.createElement("canvas");
    Object.assign(sheet, { width: 2 * ratio * width, height: 2 * ratio * (height + title) });
    const draw = sheet.getContext("2d");
    draw.scale(ratio, ratio);
    draw.fillStyle = this.look.card;
    draw.fillRect(0, 0, 2 * width, 2 * (height + title));
    charts.forEach((chart, k) => {
      draw.save();
      draw.translate((k % 2) * width, Math.floor(k / 2) * (height + title));
      draw.fillStyle = this.look.soft;
      draw.font = "600 12px system-ui, sans-serif";
      draw.fillText(`${chart.spec.title} [${chart.spec.unit}]`, 10, 16);
      draw.translate(0, title);
      chart.paint(draw, { ...this.look, fine: false }, null);
      draw.restore();
    });
    return sheet;
  }
}
