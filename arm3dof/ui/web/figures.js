// Numbers as people read them, and the round numbers of an axis.
"use strict";

// A number with some digits, and never "-0.00".
function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

// A number with some digits and the minus of print.
function figure(value, digits) {
  return fixed(value, digits).replace("-", "−");
}

// Three digits that mean something.
function readable(value) {
  const size = Math.abs(value);
  return figure(value, size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3);
}

// The round number (1, 2 or 5 times a power of ten) that cuts a span into about so many pieces.
function niceStep(span, pieces) {
  const raw = span / pieces || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= raw - 1e-12 * raw);
}

// Round numbers between two others, each with its text.
function ticks(low, high, pieces) {
  const step = niceStep(high - low, pieces);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) {
    found.push([k * step, figure(k * step, digits)]);
  }
  return found;
}
