// One panel of running curves on a canvas: right and left in the same panel, each with its 95 % band.

import { element } from "../dom.js";
import { coloured } from "../palette.js";
import { DRAWER } from "./drawer.js";
import { angleUnit, decimals } from "./numbers.js";

const HEIGHT_PX = 120;
/** A 95 % band is 1.96 standard deviations either side. */
const BAND_95 = 1.96;
/** Without a graphics card, lines drawn directly into memory cost a tenth of those that imitate a card. */
const PEN = { willReadFrequently: DRAWER !== "card" };
const GAP_S = 0.4;
const FONT = "12px system-ui, sans-serif";
const LEFT_PX = 42;
const BOTTOM_PX = 18;
const LEAST_RANGE = { deg: 10, mm: 40 };
/** How fast the range of the axis follows when curves become smaller, of its size a frame. */
const SHRINK = 0.01;

export class Chart {
  constructor({ label, joints }, history) {
    Object.assign(this, { label, joints, history, range: null, width: 0 });
    this.unit = joints[0].unit;
    this.canvas = element("canvas", { role: "img", "aria-label": `Curve of ${label} over the last seconds, ${this.unit}` });
    this.numbers = joints.map((joint) => element("span", { class: `ol-value ol-${joint.side || "one"}` }));
    const hint = joints.map((joint) => joint.hint).find(Boolean);
    this.root = element("figure", { class: "ol-chart" }, element("figcaption", {}, element("b", { text: label, title: hint || false }), ...this.numbers), this.canvas);
  }

  resize() {
    const width = this.root.clientWidth;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    if (!width || (width === this.width && ratio === this.ratio)) return;
    Object.assign(this, { width, ratio });
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(HEIGHT_PX * ratio);
  }

  /** The newest values, with their bands, as words. */
  tell() {
    this.joints.forEach((joint, k) => {
      const [value, std] = this.history.latest(joint.name);
      const band = Number.isFinite(std) ? ` ± ${decimals(BAND_95 * std)}` : "";
      this.numbers[k].textContent = `${joint.side} ${decimals(value, 1)}${band}${angleUnit(this.unit)}`.trim();
    });
  }

  draw(span_s, colours) {
    this.resize();
    if (!this.width) return;
    const pen = this.canvas.getContext("2d", PEN);
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.clearRect(0, 0, this.width, HEIGHT_PX);
    const curves = this.joints.map((joint) => this.gather(joint, span_s));
    this.follow(curves);
    const [low, high] = this.range;
    const end_s = this.history.newest_s;
    const scales = {
      x: (time_s) => this.width - 2 - ((end_s - time_s) / span_s) * (this.width - LEFT_PX - 2),
      y: (value) => HEIGHT_PX - BOTTOM_PX - ((value - low) / (high - low)) * (HEIGHT_PX - BOTTOM_PX - 6),
    };
    this.drawGrid(pen, scales, span_s, colours);
    pen.save();
    pen.beginPath();
    pen.rect(LEFT_PX, 0, this.width - LEFT_PX, HEIGHT_PX - BOTTOM_PX + 1);
    pen.clip();
    curves.forEach((rows, k) => this.drawCurve(pen, scales, rows, coloured(colours, this.joints[k].side || "right"), k < curves.length - 1 ? 4 : 2));
    pen.restore();
  }

  /** Rows [time, value, std] of one curve, at most one a pixel; null between those that are apart. */
  gather(joint, span_s) {
    const rows = [];
    const step_s = span_s / Math.max(50, this.width - LEFT_PX);
    let before_s = -Infinity;
    this.history.each(joint.name, span_s, (time_s, value, std) => {
      if (time_s - before_s < step_s || !Number.isFinite(value)) return;
      if (time_s - before_s > GAP_S) rows.push(null);
      rows.push([time_s, value, BAND_95 * std]);
      before_s = time_s;
    });
    return rows;
  }

  /** The axis grows at once and shrinks slowly, so that it does not jump. */
  follow(curves) {
    const values = curves.flat().filter(Boolean);
    let low = values.reduce((least, [, value]) => Math.min(least, value), Infinity);
    let high = values.reduce((most, [, value]) => Math.max(most, value), -Infinity);
    if (!values.length) [low, high] = this.range ?? [0, LEAST_RANGE[this.unit] ?? 1];
    const missing = Math.max(0, (LEAST_RANGE[this.unit] ?? 1e-3) - (high - low)) / 2;
    const margin = 0.08 * (high - low) + missing;
    [low, high] = [low - margin, high + margin];
    if (!this.range || !values.length) this.range = [low, high];
    const [b, t] = this.range;
    const size = SHRINK * (t - b);
    this.range = [low < b ? low : Math.min(low, b + size), high > t ? high : Math.max(high, t - size)];
  }

  drawGrid(pen, { x, y }, span_s, colours) {
    Object.assign(pen, { font: FONT, fillStyle: colours.soft, strokeStyle: colours.rule, lineWidth: 1 });
    const line = (a, b, c, d) => {
      pen.beginPath();
      pen.moveTo(a, b);
      pen.lineTo(c, d);
      pen.stroke();
    };
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const tick of ticks(...this.range)) {
      line(LEFT_PX, y(tick), this.width, y(tick));
      pen.fillText(decimals(tick, 0), LEFT_PX - 6, y(tick));
    }
    pen.textBaseline = "alphabetic";
    for (let back_s = 0; back_s < span_s; back_s += span_s / 5) {
      const at = x(this.history.newest_s - back_s);
      if (!Number.isFinite(at)) continue;
      line(at, HEIGHT_PX - BOTTOM_PX, at, HEIGHT_PX - BOTTOM_PX + 3);
      pen.textAlign = back_s ? "center" : "right";
      pen.fillText(back_s ? `−${back_s} s` : "now", back_s ? at : this.width, HEIGHT_PX - 4);
    }
  }

  /** The curve beneath is wider: it still shows where both sides are alike. */
  drawCurve(pen, { x, y }, rows, colour, lineWidth) {
    for (const part of split(rows)) {
      const banded = part.filter(([, , band]) => Number.isFinite(band));
      if (banded.length > 1) {
        pen.beginPath();
        banded.forEach(([time_s, value, band]) => pen.lineTo(x(time_s), y(value + band)));
        banded.reverse().forEach(([time_s, value, band]) => pen.lineTo(x(time_s), y(value - band)));
        Object.assign(pen, { fillStyle: colour, globalAlpha: 0.25 });
        pen.fill();
        pen.globalAlpha = 1;
      }
      pen.beginPath();
      part.forEach(([time_s, value]) => pen.lineTo(x(time_s), y(value)));
      Object.assign(pen, { strokeStyle: colour, lineWidth, lineJoin: "round" });
      pen.stroke();
    }
  }
}

function split(rows) {
  const parts = [[]];
  for (const row of rows) {
    if (row) parts.at(-1).push(row);
    else parts.push([]);
  }
  return parts;
}

/** Some round numbers between two. */
export function ticks(low, high) {
  const rough = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((size) => size >= rough);
  const found = [];
  for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) found.push(tick);
  return found;
}
