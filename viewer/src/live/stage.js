// The figure in space and its views; the camera follows where the figure has been.

import { Camera } from "../camera.js";
import { button, element } from "../dom.js";
import { Labels } from "../labels.js";
import { orbit } from "../orbit.js";
import { palette } from "../palette.js";
import { SpaceStage } from "../stage3d.js";
import { DRAWER } from "./drawer.js";
import { SoftStage } from "./soft.js";

/** Of the way to where the camera should look, a frame. */
const EASE = 0.08;
/** The ground is laid again when the figure is larger or elsewhere by this share. */
const CHANGED = 0.15;
const TURN_RAD = 0.12;

/** Of a picture's full sharpness; the first without a card has at most so many points. */
const SHARPNESS = [1, 0.75, 0.55, 0.4];
const MOST_POINTS_WITHOUT_CARD = 500_000;
/** A picture that takes longer than this between two frames is drawn less sharp; the median of so many. */
const SLOW_MS = 27;
const JUDGED = 45;
/** It is sharper again after so many medians that are not slow; each time it takes twice as many. */
const PATIENCE = 15;

export class Stage {
  constructor(figure, memory) {
    const { viewpoints, world } = figure.scene;
    Object.assign(this, { figure, memory, viewpoints, drawer: DRAWER, intervals_ms: [], level: 0, quick: 0, patience: PATIENCE });
    this.camera = new Camera(world.up, world.forward);
    this.labels = new Labels(figure);
    this.place = element("div", { class: "ol-canvas" });
    this.empty = element("p", { class: "ol-empty", text: "The figure appears when tracking has started." });
    const views = viewpoints.map((view, k) => button(view.name, () => this.see(k), { label: `Seen from: ${view.name} (key ${k + 1})` }));
    const names = button("names", () => this.showNames(!this.labels.shown), { label: "Names of the joints" });
    this.names = names;
    this.root = element("section", { class: "ol-card ol-stage", "aria-label": "Figure" }, element("div", { class: "ol-picture" }, this.place, this.labels.layer, this.empty, element("div", { class: "ol-views", role: "group", "aria-label": "Seen from" }, ...views, names)));
    this.showNames(memory.get("names", false));
    this.see(memory.get("view", 0));
    this.isStale = true;
    new ResizeObserver(() => this.resize()).observe(this.place);
  }

  see(number) {
    const view = this.viewpoints[number] ?? this.viewpoints[0];
    if (!view) return;
    this.camera.seenFrom(view.seen_from, view.zoom);
    this.memory.set("view", this.viewpoints.indexOf(view));
    this.isStale = true;
  }

  showNames(isShown) {
    this.labels.shown = isShown;
    this.names.setAttribute("aria-pressed", isShown);
    this.memory.set("names", isShown);
    this.isStale = true;
  }

  /** Once there is a figure: before that its size is unknown. */
  build(isSoft = this.drawer !== "card") {
    this.drawn?.dispose();
    this.camera.lookAt(this.figure.bounds());
    this.view = viewOf(this.figure, this.camera);
    const canvas = element("canvas", { role: "img", tabindex: "0", "aria-label": `Moving figure of ${this.figure.scene.model}. Arrow keys turn it, plus and minus zoom.` });
    this.place.replaceChildren(canvas);
    this.isSoft = isSoft;
    this.drawn = isSoft ? new SoftStage(canvas, this.view, this.figure) : new SpaceStage(canvas, this.view, this.figure, null, this.level > 0);
    this.empty.hidden = true;
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.build(true);
    });
    canvas.addEventListener("keydown", (event) => this.key(event));
    orbit(canvas, this.camera, () => (this.isStale = true));
    this.resize();
  }

  resize() {
    const { clientWidth, clientHeight } = this.place;
    if (!this.drawn || !clientWidth || !clientHeight) return;
    this.camera.aspect = clientWidth / clientHeight;
    const most = this.isSoft ? Math.sqrt(MOST_POINTS_WITHOUT_CARD / (clientWidth * clientHeight)) : 2;
    this.drawn.resize(clientWidth, clientHeight, Math.min(devicePixelRatio || 1, 2, most) * SHARPNESS[this.level]);
    this.isStale = true;
  }

  recolour() {
    if (!this.drawn) return;
    Object.assign(this.view, viewOf(this.figure, this.camera));
    if (this.drawn.solids) this.drawn.solids.radius_m = this.view.radius_m;
    this.drawn.recolour();
    this.isStale = true;
  }

  /** Draws less sharp where frames come too slowly: a late figure is worse than a coarse one. */
  pace(interval_ms) {
    this.intervals_ms.push(interval_ms);
    if (this.intervals_ms.length < JUDGED) return;
    const median_ms = this.intervals_ms.sort((one, other) => one - other)[JUDGED >> 1];
    this.intervals_ms = [];
    if (!this.drawn) return;
    this.quick = median_ms < SLOW_MS ? this.quick + 1 : 0;
    if (this.quick === 0) this.sharpen(1);
    else if (this.isSoft && this.quick === this.patience) {
      Object.assign(this, { quick: 0, patience: 2 * this.patience });
      this.sharpen(-1);
    }
  }

  /** By so many levels. */
  sharpen(change) {
    const before = this.level;
    this.level = Math.min(Math.max(before + change, 0), SHARPNESS.length - 1);
    if (before === 0 && this.level > 0 && !this.isSoft) this.build();
    else if (this.level !== before) this.resize();
  }

  draw(time_s) {
    if (!this.figure.isKnown) return;
    if (!this.drawn) this.build();
    const { clientWidth, clientHeight } = this.place;
    if (!clientWidth) return;
    this.follow();
    this.drawn.draw(time_s, null, 0);
    this.labels.draw(this.camera.projection(clientWidth, clientHeight), time_s, clientWidth, clientHeight);
    this.isStale = false;
  }

  follow() {
    const { centre, half } = this.figure.bounds();
    const { camera, view } = this;
    camera.centre = camera.centre.map((value, k) => value + EASE * (centre[k] - value));
    camera.half = camera.half.map((value, k) => value + EASE * (Math.max(half[k], 0.05) - value));
    const size = Math.max(...view.bounds.half, 0.05);
    const isElsewhere = centre.some((value, k) => Math.abs(value - view.bounds.centre[k]) + Math.abs(half[k] - view.bounds.half[k]) > CHANGED * size);
    if (isElsewhere) this.recolour();
  }

  key(event) {
    const turns = { ArrowLeft: [-TURN_RAD, 0], ArrowRight: [TURN_RAD, 0], ArrowUp: [0, TURN_RAD], ArrowDown: [0, -TURN_RAD] };
    const factor = { "+": 1.2, "-": 1 / 1.2 }[event.key];
    if (!turns[event.key] && !factor) return;
    event.preventDefault();
    if (factor) this.camera.closer(factor);
    else this.camera.turn(...turns[event.key]);
    this.isStale = true;
  }
}

/** What a stage draws with: colours, the ground below the figure, thickness of limbs. */
export function viewOf(figure, camera) {
  const bounds = figure.bounds();
  const { scene } = figure;
  const { up } = camera;
  const height = (point) => point.reduce((sum, value, k) => sum + value * up[k], 0);
  const lowest = height(bounds.centre) - bounds.half.reduce((sum, value, k) => sum + Math.abs(value * up[k]), 0);
  const size = Math.max(...bounds.half, 0.05);
  const power = 10 ** Math.floor(Math.log10(size));
  const radius_m = scene.limb_radius_m ?? 0.022 * size;
  const ground = { kind: scene.ground.kind, height_m: scene.ground.height_m ?? lowest - 1.5 * radius_m, step_m: power * (size / power > 4 ? 2 : 0.5) };
  return { camera, colours: palette(), radius_m, bounds, ground };
}
