// A small picture of the posture or movement that a step of the guided start asks for, drawn flat.

import { Camera } from "../camera.js";
import { element } from "../dom.js";
import { FlatStage, carried } from "../stage2d.js";
import { LiveFigure } from "./figure.js";
import { viewOf } from "./stage.js";

/** One swing to and fro. */
const PERIOD_S = 2.2;
const CORNER = [-1, 0.3, 0.8];
/** The box around a person has empty corners. */
const ZOOM = 1.55;
/** Whoever wants no movement sees where the first swing ends. */
const STILL = matchMedia("(prefers-reduced-motion: reduce)");
const BODY = ["body", "seat"];
/** Pictures a second: enough for a movement, little work for a phone. */
const PICTURES_HZ = 12;

export class PosePicture {
  constructor(structure, steps) {
    // hands hold nothing in these postures, and nothing stands around the person
    const isBody = ({ part }) => BODY.includes(part);
    const shapes = structure.shapes.some(isBody) ? structure.shapes.filter(isBody) : structure.shapes;
    const bones = structure.bones.filter((bone) => bone.moves);
    this.figure = new LiveFigure({ ...structure, loops: [], shapes, bones });
    this.shown = [...new Set([...bones.flatMap((bone) => bone.ends), ...structure.strands.flatMap((strand) => strand.points)])];
    Object.assign(this, { steps, at: null, isMoving: true, isStale: true });
    this.camera = new Camera(structure.world.up, structure.world.forward);
    this.canvas = element("canvas", { role: "img" });
    this.root = element("div", { class: "ol-guide-picture" }, this.canvas);
    this.look();
    new ResizeObserver(() => this.resize()).observe(this.root);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.look());
  }

  /** From one place for all steps. */
  look() {
    const boxes = this.steps.flatMap((step) => step.pictures).map((frame) => this.boxOf(frame));
    const low = [0, 1, 2].map((axis) => Math.min(...boxes.map((box) => box.low[axis])));
    const high = [0, 1, 2].map((axis) => Math.max(...boxes.map((box) => box.high[axis])));
    this.figure.boxes = [{ time_s: 0, low, high }];
    this.camera.lookAt(this.figure.bounds());
    const seen = this.figure.scene.viewpoints.at(-1);
    this.camera.seenFrom(seen?.seen_from ?? CORNER, ZOOM);
    this.view = viewOf(this.figure, this.camera);
    this.drawn = new FlatStage(this.canvas, this.view, this.figure, null);
    this.resize();
  }

  boxOf(frame) {
    this.figure.take({ ...frame, time_s: 0 });
    const { places, scene } = this.figure;
    const points = this.shown.map((k) => [...places.subarray(3 * k, 3 * k + 3)]);
    for (const { carrier, vertices_mm } of scene.shapes) {
      const move = carried(this.figure.carrierAt(0, carrier));
      for (let k = 0; k < vertices_mm.length; k += 3) points.push(move(vertices_mm.slice(k, k + 3).map((value) => value / 1000)));
    }
    const along = (axis) => points.map((point) => point[axis]).filter(Number.isFinite);
    return { low: [0, 1, 2].map((axis) => Math.min(...along(axis))), high: [0, 1, 2].map((axis) => Math.max(...along(axis))) };
  }

  show(at, isMoving) {
    this.isMoving = isMoving;
    this.isStale = true;
    if (this.at === at) return;
    this.at = at;
    const step = this.steps[at];
    this.root.hidden = !step?.pictures.length;
    this.canvas.setAttribute("aria-label", step ? `Figure: ${step.name}` : "Figure");
  }

  resize() {
    const { clientWidth, clientHeight } = this.root;
    if (!clientWidth || !clientHeight) return;
    this.camera.aspect = clientWidth / clientHeight;
    this.drawn.resize(clientWidth, clientHeight, Math.min(devicePixelRatio || 1, 2));
    this.isStale = true;
  }

  draw(time_s) {
    const frames = this.steps[this.at]?.pictures ?? [];
    if (!frames.length || !this.drawn.width) return;
    const moves = this.isMoving && frames.length > 1 && !STILL.matches;
    if (!this.isStale && (!moves || time_s < this.drawn_s + 1 / PICTURES_HZ)) return;
    Object.assign(this, { isStale: false, drawn_s: time_s });
    const place = moves ? ((time_s / PERIOD_S) % 1) * frames.length : Math.floor(frames.length / 4);
    const [one, other] = [frames[Math.floor(place)], frames[(Math.floor(place) + 1) % frames.length]];
    const share = place % 1;
    this.figure.take({ time_s: 0, places_mm: between(one.places_mm, other.places_mm, share), turns: between(one.turns, other.turns, share) });
    this.drawn.draw(0, null, 0);
  }
}

const between = (one, other, share) => one.map((value, k) => value + share * (other[k] - value));
