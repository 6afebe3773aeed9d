// One panel of curves, drawn by uPlot, with a line at the player's time.

import uPlot from "uplot";

import { element } from "./dom.js";
import { coloured } from "./palette.js";
import { between, locate, table } from "./unpack.js";

const HEIGHT_PX = 132;
/** A 95 % band is 1.96 standard deviations either side. */
const BAND_95 = 1.96;
const font = () => `${matchMedia("(max-width: 560px)").matches ? 12.5 : 11}px system-ui, sans-serif`;

const toNull = (value) => (Number.isFinite(value) ? value : null);

export class Panel {
  constructor(panel, time_s, asked) {
    this.panel = panel;
    this.time_s = time_s;
    this.asked = asked;
    this.series = panel.series.map((series) => ({ ...series, value: table(series.value), std: series.std && table(series.std) }));
    this.band = false;
    this.ghosts = new Map();
    this.values = element("span", { class: "op-values" });
    this.plot = element("div", { class: "op-plot", role: "img", "aria-label": `Curve of ${panel.label} over time, ${panel.unit}; the slider moves its line` });
    const hint = this.series.map((series) => series.hint).filter(Boolean).join("; ");
    const name = element("span", { class: "op-panel-name", text: panel.label, title: hint || false });
    this.root = element("figure", { class: "op-panel", "data-panel": panel.key, hidden: !panel.open }, element("figcaption", {}, name, element("span", { class: "op-unit", text: panel.unit }), this.values), this.plot);
    this.head = element("div", { class: "op-head" });
  }

  get shown() {
    return !this.root.hidden;
  }

  /** Numbers of all lines: time, then value, lower and upper edge of each series, then ghosts. */
  data() {
    const columns = this.series.flatMap((series) => {
      const value = Array.from(series.value.values, toNull);
      const edge = (sign) => value.map((v, k) => (v === null || !series.std ? null : toNull(v + sign * BAND_95 * series.std.values[k])));
      return this.band && series.std ? [value, edge(-1), edge(1)] : [value];
    });
    return [Array.from(this.time_s), ...columns, ...this.ghosts.values()];
  }

  lines(colours) {
    const lines = [{}];
    const bands = [];
    for (const series of this.series) {
      const stroke = this.colour(colours, series);
      // where both sides are alike, the one beneath still shows
      lines.push({ label: series.label, stroke, width: this.series.length > 1 && series === this.series[0] ? 3 : 1.5, points: { show: false } });
      if (this.band && series.std) {
        lines.push({ points: { show: false } }, { points: { show: false } });
        bands.push({ series: [lines.length - 1, lines.length - 2], fill: `${stroke}38` });
      }
    }
    for (const key of this.ghosts.keys()) lines.push({ label: key, stroke: colours.ghost, width: 1.6, dash: [5, 3], points: { show: false } });
    return { lines, bands };
  }

  colour(colours, series) {
    return series.side ? coloured(colours, series.side) : this.series.length > 1 ? [colours.right, colours.left, colours.spread, colours.loop][this.series.indexOf(series) % 4] : colours.right;
  }

  build(colours, marks, width, range) {
    this.uplot?.destroy();
    this.colours = colours;
    const { lines, bands } = this.lines(colours);
    const axis = { stroke: colours.soft, font: font(), grid: { stroke: colours.rule, width: 1 }, ticks: { stroke: colours.rule, width: 1, size: 4 } };
    this.uplot = new uPlot(
      {
        width: Math.max(width, 120),
        height: HEIGHT_PX,
        legend: { show: false },
        cursor: { drag: { x: false, y: false }, y: false, points: { show: false } },
        scales: { x: { time: false, range: () => this.range } },
        axes: [
          { ...axis, size: 24, space: 60, values: (_, ticks) => ticks.map((tick) => `${+tick.toFixed(3)} s`) },
          { ...axis, size: 46, space: 24 },
        ],
        padding: [8, 10, 0, 0],
        series: lines,
        bands,
        hooks: { drawClear: [(u) => this.drawMarks(u, marks, colours)] },
      },
      this.data(),
      this.plot,
    );
    this.range = range;
    this.uplot.setScale("x", { min: range[0], max: range[1] });
    this.uplot.over.append(this.head);
    this.listen(this.uplot.over);
  }

  drawMarks(u, marks, colours) {
    u.ctx.save();
    u.ctx.strokeStyle = colours.rule;
    u.ctx.lineWidth = Math.max(1, devicePixelRatio);
    for (const mark of marks) {
      if (mark.time_s < this.range?.[0] || mark.time_s > this.range?.[1]) continue;
      const x = Math.round(u.valToPos(mark.time_s, "x", true));
      u.ctx.beginPath();
      u.ctx.moveTo(x, u.bbox.top);
      u.ctx.lineTo(x, u.bbox.top + u.bbox.height);
      u.ctx.stroke();
    }
    u.ctx.restore();
  }

  /** A click, or a drag, moves the player's time. */
  listen(surface) {
    let held = false;
    const seek = (event) => this.asked(this.uplot.posToVal(event.clientX - surface.getBoundingClientRect().left, "x"));
    surface.addEventListener("pointerdown", (event) => {
      held = true;
      surface.setPointerCapture(event.pointerId);
      seek(event);
    });
    surface.addEventListener("pointermove", (event) => held && seek(event));
    for (const end of ["pointerup", "pointercancel"]) surface.addEventListener(end, () => (held = false));
  }

  resize(width) {
    if (this.uplot && width > 0) this.uplot.setSize({ width, height: HEIGHT_PX });
  }

  setRange(range) {
    this.range = range;
    this.uplot?.setScale("x", { min: range[0], max: range[1] });
  }

  /** Lays the same series of a ghost over it: `at` gives the ghost's time for each of ours, or null. */
  setGhost(figureTime_s, panels, at) {
    this.ghosts.clear();
    const theirs = new Map((panels ?? []).flatMap((panel) => panel.series.map((series) => [series.key, series])));
    for (const series of this.series) {
      const other = theirs.get(series.key);
      if (!other) continue;
      const values = table(other.value);
      this.ghosts.set(series.key, Array.from(this.time_s, (time_s) => {
        const then = at(time_s);
        if (then === null || then < figureTime_s[0] || then > figureTime_s[figureTime_s.length - 1]) return null;
        return toNull(between(values, locate(figureTime_s, then), 0));
      }));
    }
  }

  /** The values at a time as words: `right 12.3, left 12.9 deg`. */
  showAt(time_s) {
    if (!this.shown || !this.uplot) return;
    const x = this.uplot.valToPos(time_s, "x");
    this.head.hidden = !(x >= -1 && x <= this.uplot.over.clientWidth + 1);
    this.head.style.left = `${x}px`;
    const place = locate(this.time_s, time_s);
    const worded = this.series.map((series) => {
      const value = between(series.value, place, 0);
      const std = series.std && this.band ? between(series.std, place, 0) : NaN;
      const number = Number.isFinite(value) ? decimals(value) : "none";
      const band = Number.isFinite(std) ? ` ± ${decimals(BAND_95 * std)}` : "";
      return [series, `${number}${band}`];
    });
    this.values.replaceChildren(
      ...worded.map(([series, words]) => element("span", { style: `--op-curve:${this.colour(this.colours, series)}`, text: this.series.length > 1 ? `${series.label} ${words}` : words })),
    );
  }

  /** The time at which the line stands, read back from where it was drawn. */
  get headTime_s() {
    return this.uplot ? this.uplot.posToVal(parseFloat(this.head.style.left), "x") : NaN;
  }
}

function decimals(value) {
  const size = Math.abs(value);
  return value.toFixed(size >= 100 ? 0 : size >= 1 ? 1 : 2);
}
