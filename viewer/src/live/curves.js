// The curves that the coach chooses: which joints, over how many seconds.

import { choice, element } from "../dom.js";
import { Chart } from "./chart.js";
import { DRAWER } from "./drawer.js";

const SPANS_S = [10, 20, 30];
const FIRST = 4;
/** Without a graphics card each frame draws every second panel. */
const TURNS = DRAWER === "card" ? 1 : 2;

export class Curves {
  constructor(joints, first, history, memory) {
    this.memory = memory;
    this.panels = panelsOf(joints);
    this.charts = new Map(this.panels.map((panel) => [panel.label, new Chart(panel, history)]));
    const known = (labels) => labels.filter((label) => this.charts.has(label));
    const wanted = known(first ?? []);
    this.chosen = known(memory.get("curves", wanted.length ? wanted : this.panels.slice(0, FIRST).map((panel) => panel.label)));
    this.span_s = SPANS_S.includes(memory.get("span_s")) ? memory.get("span_s") : SPANS_S[0];
    const span = choice("last", SPANS_S.map((value) => [value, `${value} s`]), (value) => {
      this.span_s = Number(value);
      memory.set("span_s", this.span_s);
    });
    span.select.value = this.span_s;
    this.place = element("div", { class: "ol-charts" });
    this.root = element("section", { class: "ol-card ol-curves", "aria-labelledby": "ol-curves" }, element("div", { class: "ol-head" }, element("h2", { id: "ol-curves", text: "Curves" }), element("span", { class: "ol-hint", text: "band: 95 %" }), span.field), this.chooser(), this.place);
    this.layOut();
  }

  get shown() {
    return this.chosen.map((label) => this.charts.get(label));
  }

  chooser() {
    const boxes = this.panels.map(({ label, joints }, k) => {
      const id = `ol-curve-${k}`;
      const box = element("input", { type: "checkbox", id, on: { change: () => this.choose(label, box.checked) } });
      box.checked = this.chosen.includes(label);
      return element("div", { class: "ol-check" }, box, element("label", { for: id, text: `${label}, ${joints[0].unit}` }));
    });
    return element("details", { class: "ol-chooser" }, element("summary", { text: `Choose curves (${this.panels.length})` }), element("div", { class: "ol-boxes" }, ...boxes));
  }

  choose(label, isWanted) {
    const wanted = new Set(this.chosen);
    if (isWanted) wanted.add(label);
    else wanted.delete(label);
    this.chosen = this.panels.map((panel) => panel.label).filter((one) => wanted.has(one));
    this.memory.set("curves", this.chosen);
    this.layOut();
  }

  layOut() {
    const none = element("p", { class: "ol-hint", text: "No curve is chosen." });
    this.place.replaceChildren(...(this.chosen.length ? this.shown.map((chart) => chart.root) : [none]));
  }

  draw(colours) {
    this.turn = ((this.turn ?? 0) + 1) % TURNS;
    this.shown.forEach((chart, k) => k % TURNS === this.turn && chart.draw(this.span_s, colours));
  }

  tell() {
    for (const chart of this.shown) chart.tell();
  }
}

/** Joints of the right and the left share a panel. */
function panelsOf(joints) {
  const panels = new Map();
  for (const joint of joints) panels.set(joint.panel, [...(panels.get(joint.panel) ?? []), joint]);
  return [...panels].map(([label, own]) => ({ label, joints: own }));
}
