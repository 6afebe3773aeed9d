// Names of the points over the picture; one that would cover another waits.

import { element } from "./dom.js";

const WIDE_PX = 6.4;
const HIGH_PX = 15;
/** So many names are shown from the start. */
const FEW = 6;

/** `right upper arm` of `upper_arm_r`; of several frames at a place the one with the shortest name. */
function worded({ frames, side }) {
  const name = frames.reduce((one, other) => (other.length < one.length ? other : one));
  return `${side} ${side ? name.replace(/^[rl]_|_(right|left|r|l)$/, "") : name}`.trim().replaceAll("_", " ");
}

export class Labels {
  constructor(figure) {
    this.layer = element("div", { class: "op-names", "aria-hidden": "true" });
    this.figure = figure;
    const drawn = new Set(figure.scene.bones.flatMap((bone) => bone.ends));
    this.items = figure.points.flatMap((point, k) => (point.frames.length && (drawn.has(k) || !drawn.size) ? [{ k, words: point.label || worded(point), side: point.side }] : []));
    this.shown = this.items.length <= FEW;
    for (const item of this.items) {
      item.tag = element("span", { class: item.side ? `op-${item.side}` : "", text: item.words });
      this.layer.append(item.tag);
    }
  }

  /** What lies over the picture: the buttons of the views. */
  covered() {
    const views = this.layer.parentElement?.querySelector(".op-views");
    if (!views) return [];
    const picture = this.layer.getBoundingClientRect();
    const { left, top, right, bottom } = views.getBoundingClientRect();
    return [[left - picture.left, top - picture.top, right - picture.left, bottom - picture.top]];
  }

  draw(project, time_s, width, height) {
    this.layer.hidden = !this.shown;
    if (!this.shown) return;
    const places = this.figure.placesAt(time_s);
    const taken = this.covered();
    for (const item of this.items) {
      const [x, y, depth] = project([places[3 * item.k], places[3 * item.k + 1], places[3 * item.k + 2]]);
      const box = [x + 8, y - HIGH_PX, x + 12 + WIDE_PX * item.words.length, y + 3];
      const fits = depth > 0.05 && box[0] > 0 && box[2] < width && box[1] > 0 && box[3] < height;
      const free = fits && taken.every((other) => box[0] > other[2] || box[2] < other[0] || box[1] > other[3] || box[3] < other[1]);
      item.tag.hidden = !free;
      if (!free) continue;
      taken.push(box);
      item.tag.style.transform = `translate(${box[0].toFixed(1)}px, ${box[1].toFixed(1)}px)`;
    }
  }
}
