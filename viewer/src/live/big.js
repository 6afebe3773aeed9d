// Current numbers in large print, to be read from two metres: the chosen curves and the newest stroke.

import { element } from "../dom.js";
import { angleUnit, decimals } from "./numbers.js";

const MARKS = { low: "↓ low", high: "↑ high", within: "✓" };

export class Big {
  constructor(curves, strokes, history) {
    Object.assign(this, { curves, strokes, history });
    this.root = element("section", { class: "ol-big", "aria-label": "Large numbers", hidden: true });
  }

  toggle(isShown = this.root.hidden) {
    this.root.hidden = !isShown;
    this.tell();
  }

  tell() {
    if (this.root.hidden) return;
    const joints = this.curves.shown.flatMap((chart) => chart.joints);
    const tiles = joints.map(({ name, label, unit, side }) => ({ label, unit, side, value: this.history.latest(name)[0], digits: 0, judged: null }));
    const strokes = this.strokes?.newest() ?? [];
    const all = [...strokes, ...tiles];
    if (!all.length) all.push({ label: "No curve is chosen", unit: "", value: NaN, judged: null });
    while (this.root.children.length > all.length) this.root.lastChild.remove();
    while (this.root.children.length < all.length) this.root.append(element("div", {}, element("span"), element("b"), element("small")));
    all.forEach((tile, k) => fill(this.root.children[k], tile));
  }
}

function fill(place, { label, unit, value, digits, judged, side }) {
  const [name, number, mark] = place.children;
  place.className = `ol-tile ${judged ? `ol-${judged === "within" ? "within" : "outside"}` : ""} ${side ? `ol-${side}` : ""}`;
  name.textContent = unit === "deg" || !unit ? label : `${label}, ${unit}`;
  number.textContent = `${decimals(value, digits)}${unit === "deg" && Number.isFinite(value) ? angleUnit(unit) : ""}`;
  mark.textContent = MARKS[judged] ?? "";
}
