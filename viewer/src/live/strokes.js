// The last strokes, or whatever repeats, with the newest on top; targets for each column, which the coach types.

import { element } from "../dom.js";
import { decimals } from "./numbers.js";
import { Sound } from "./sound.js";

const SHOWN = 12;
const BAND_95 = 1.96;
const MARKS = { low: "↓ low", high: "↑ high", within: "✓" };

export class Strokes {
  constructor({ columns, label = "Strokes" }, memory) {
    Object.assign(this, { columns, memory, rows: [] });
    this.targets = memory.get("targets", {});
    this.sound = new Sound();
    this.body = element("tbody", {});
    this.targetCells = columns.map(() => element("td", {}));
    const heads = columns.map(({ label: words, unit }) => element("th", { scope: "col" }, element("span", { text: words }), element("small", { text: unit })));
    const table = element("table", {}, element("thead", {}, element("tr", {}, element("th", { scope: "col", text: "No." }), ...heads), element("tr", { class: "ol-targets" }, element("th", { scope: "row", text: "target" }), ...this.targetCells)), this.body);
    this.root = element("section", { class: "ol-card ol-strokes", "aria-labelledby": "ol-strokes" }, element("div", { class: "ol-head" }, element("h2", { id: "ol-strokes", text: label }), this.soundBox()), this.editor(), element("div", { class: "ol-scroll", tabindex: "0", role: "group", "aria-label": `Table: ${label}` }, table));
    this.draw();
  }

  soundBox() {
    const box = element("input", { type: "checkbox", id: "ol-sound", on: { change: () => this.sound.turn(box.checked) } });
    return element("div", { class: "ol-check" }, box, element("label", { for: "ol-sound", text: "sound: high within all targets, low outside" }));
  }

  editor() {
    const fields = this.columns.map(({ key, label, unit }) => {
      const limit = (side) => {
        const input = element("input", { type: "number", step: "any", inputmode: "decimal", value: this.targets[key]?.[side] ?? "", "aria-label": `${label}, ${side === "low" ? "lowest" : "highest"} target, ${unit}`, on: { change: () => this.setTarget(key, side, input.value) } });
        return input;
      };
      return element("div", { class: "ol-target" }, element("span", { text: `${label}, ${unit}` }), limit("low"), element("span", { text: "to" }), limit("high"));
    });
    return element("details", { class: "ol-chooser" }, element("summary", { text: "Set targets" }), element("div", { class: "ol-boxes" }, ...fields));
  }

  setTarget(key, side, text) {
    const target = { ...this.targets[key], [side]: text === "" ? undefined : Number(text) };
    this.targets = { ...this.targets, [key]: target };
    this.memory.set("targets", this.targets);
    this.draw();
  }

  /** "low", "high" or "within" of the column's target; null where there is none. */
  judge(key, value) {
    const { low, high } = this.targets[key] ?? {};
    if (!Number.isFinite(value) || (low === undefined && high === undefined)) return null;
    if (low !== undefined && value < low) return "low";
    return high !== undefined && value > high ? "high" : "within";
  }

  take(stroke) {
    // a later message with the same number corrects the stroke
    const isNew = !this.rows.some((row) => row.number === stroke.number);
    this.rows = [stroke, ...this.rows.filter((row) => row.number !== stroke.number)].sort((one, other) => other.number - one.number).slice(0, SHOWN);
    this.draw();
    const judged = this.columns.map(({ key }) => this.judge(key, stroke.values[key]?.value)).filter(Boolean);
    if (isNew && judged.length) this.sound.play(judged.every((one) => one === "within"));
  }

  draw() {
    this.columns.forEach(({ key }, k) => (this.targetCells[k].textContent = targetWords(this.targets[key])));
    const none = element("tr", {}, element("td", { class: "ol-hint", colspan: this.columns.length + 1, text: "None yet." }));
    this.body.replaceChildren(...(this.rows.length ? this.rows.map((row) => this.row(row)) : [none]));
  }

  row(stroke) {
    const cells = this.columns.map((column) => {
      const { value, std } = stroke.values[column.key] ?? {};
      const judged = this.judge(column.key, value);
      const band = Number.isFinite(std) ? element("small", { text: `± ${decimals(BAND_95 * std)}` }) : null;
      const mark = judged && element("small", { class: "ol-mark", text: MARKS[judged] });
      const isBest = column.better && this.rows.length > 1 && value === this.best(column);
      return element("td", { class: judged ? `ol-${judged === "within" ? "within" : "outside"}` : "" }, element("b", { text: decimals(value) }), band, mark, isBest && element("small", { text: "★ best", title: `Best of the last ${this.rows.length}` }));
    });
    return element("tr", {}, element("th", { scope: "row", text: stroke.number }), ...cells);
  }

  best({ key, better }) {
    const values = this.rows.map((row) => row.values[key]?.value).filter(Number.isFinite);
    return better === "low" ? Math.min(...values) : Math.max(...values);
  }

  /** Of the newest stroke, for large print: label, value, unit and judgement of each column. */
  newest() {
    const [stroke] = this.rows;
    return stroke ? this.columns.map(({ key, label, unit }) => ({ label, unit, value: stroke.values[key]?.value, judged: this.judge(key, stroke.values[key]?.value) })) : [];
  }
}

function targetWords({ low, high } = {}) {
  if (low === undefined && high === undefined) return "–";
  if (low === undefined) return `≤ ${decimals(high)}`;
  return high === undefined ? `≥ ${decimals(low)}` : `${decimals(low)} to ${decimals(high)}`;
}
