// A player: a figure in space and curves beside it, under one time.

import { Camera } from "./camera.js";
import { Clock } from "./clock.js";
import { Controls } from "./controls.js";
import { element } from "./dom.js";
import { Figure } from "./figure.js";
import { Film } from "./film.js";
import { Labels } from "./labels.js";
import { orbit } from "./orbit.js";
import { palette } from "./palette.js";
import { Panel } from "./panel.js";
import { ghostTime, spanAt } from "./spans.js";
import { FlatStage } from "./stage2d.js";
import { SpaceStage } from "./stage3d.js";

const NO_WEBGL = "This browser has no WebGL, so the figure is drawn flat, without light and shadow. Everything else works.";
/** Browsers give up the oldest of more than about sixteen; players beyond these are drawn flat. */
const MOST_CONTEXTS = 8;
let contexts = 0;

function hasWebGL() {
  if (contexts >= MOST_CONTEXTS) return false;
  return Boolean(document.createElement("canvas").getContext("webgl2"));
}

export class Player {
  constructor(root, scene) {
    this.root = root;
    this.scene = scene;
    this.figure = new Figure(scene);
    this.other = scene.ghost ? new Figure(scene.ghost) : null;
    this.ghost = { figure: null, span: null, align: "phase" };
    this.magnified = 0;
    this.camera = new Camera(scene.world.up, scene.world.forward);
    this.clock = new Clock(this.figure.start_s, this.figure.end_s, () => this.refresh());
    this.view = this.viewOf();
    this.camera.lookAt(this.view.bounds);
    this.labels = new Labels(this.figure);
    this.panels = scene.panels.map((panel) => new Panel(panel, this.figure.time_s, (time_s) => this.seek(time_s)));
    this.controls = new Controls(this);
    this.film = scene.video ? new Film(scene.video, this.figure, this) : null;
    if (this.film) this.clock.leader = (time_s, speed) => this.film.lead(time_s, speed);
    this.visible = true;
    this.layOut();
    this.setStage();
    this.preset(0);
    this.watch();
  }

  viewOf() {
    const bounds = this.boundsWithShapes();
    const up = this.camera.up;
    const height = (point) => point.reduce((sum, value, k) => sum + value * up[k], 0);
    const lowest = height(bounds.centre) - bounds.half.reduce((sum, value, k) => sum + Math.abs(value * up[k]), 0);
    const size = Math.max(...bounds.half);
    const radius_m = this.scene.limb_radius_m ?? 0.022 * size;
    const step_m = 10 ** Math.floor(Math.log10(size)) * (size / 10 ** Math.floor(Math.log10(size)) > 4 ? 2 : 0.5);
    const ground = { kind: this.scene.ground.kind, height_m: this.scene.ground.height_m ?? lowest - 1.5 * radius_m, step_m };
    return { camera: this.camera, colours: palette(), radius_m, bounds, ground };
  }

  /** The figure's points, and what is coloured as right or left: a shell may be far longer than what moves. */
  boundsWithShapes() {
    const bounds = this.figure.bounds();
    if (this.other) {
      const theirs = this.other.bounds();
      for (let k = 0; k < 3; k++) {
        bounds.low[k] = Math.min(bounds.low[k], theirs.low[k]);
        bounds.high[k] = Math.max(bounds.high[k], theirs.high[k]);
      }
    }
    bounds.centre = bounds.low.map((low, k) => (low + bounds.high[k]) / 2);
    bounds.half = bounds.low.map((low, k) => (bounds.high[k] - low) / 2);
    return bounds;
  }

  layOut() {
    this.canvasPlace = element("div", { class: "op-canvas" });
    this.note = element("p", { class: "op-note", role: "status", hidden: true });
    this.stageBox = element("div", { class: "op-stage" }, this.canvasPlace, this.labels.layer, this.controls.views, this.controls.legend);
    this.curvesBox = element("div", { class: "op-curves" }, this.controls.chooser, ...this.panels.map((panel) => panel.root));
    this.curvesBox.hidden = this.panels.length === 0;
    const title = this.scene.title ? element("p", { class: "op-title", text: this.scene.title }) : null;
    const notes = this.scene.notes.length ? element("p", { class: "op-drawn", text: `Drawn, not measured: ${this.scene.notes.join("; ")}.` }) : null;
    const pictures = this.film ? element("div", { class: "op-pictures" }, this.film.root, this.stageBox) : this.stageBox;
    const left = element("div", { class: "op-left" }, pictures, this.note, this.controls.bar, this.controls.tools, notes);
    this.root.replaceChildren(...[title, element("div", { class: `op-columns${this.panels.length && !this.film ? "" : " op-alone"}` }, left, this.curvesBox)].filter(Boolean));
    this.root.setAttribute("role", "group");
    this.root.setAttribute("aria-label", `Player of ${this.scene.title || this.scene.model}`);
  }

  setStage(flat = !hasWebGL()) {
    this.stage?.dispose();
    const canvas = element("canvas", { role: "img", tabindex: "0", "aria-label": `Moving figure of ${this.scene.model}. Arrow keys step through time, Shift with arrow keys turns it, space plays.` });
    this.canvasPlace.replaceChildren(canvas);
    const Stage = flat ? FlatStage : SpaceStage;
    this.stage = new Stage(canvas, this.view, this.figure, this.ghost.figure);
    this.flat = flat;
    if (!flat) contexts += 1;
    this.note.hidden = !flat;
    this.note.textContent = flat ? NO_WEBGL : "";
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.setStage(true);
      this.resize();
    });
    orbit(canvas, this.camera, () => this.refresh());
  }

  watch() {
    new ResizeObserver(() => this.resize()).observe(this.root);
    new IntersectionObserver((entries) => {
      this.visible = entries.at(-1).isIntersecting;
      if (this.visible) this.refresh();
    }).observe(this.root);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
    addEventListener("beforeprint", () => this.recolour(palette(false), true));
    addEventListener("afterprint", () => this.recolour());
    this.root.addEventListener("keydown", (event) => this.controls.key(event));
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvasPlace;
    if (!clientWidth || !clientHeight) return;
    this.camera.aspect = clientWidth / clientHeight;
    this.stage.resize(clientWidth, clientHeight, Math.min(devicePixelRatio || 1, 2));
    const width = this.curvesBox.clientWidth;
    for (const panel of this.panels) {
      if (!panel.shown) continue;
      if (panel.uplot) panel.resize(width);
      else panel.build(this.view.colours, this.scene.marks, width, this.shownRange());
    }
    this.refresh(true);
  }

  recolour(colours = palette(), always = false) {
    this.view.colours = colours;
    this.stage.ghost = this.ghost.figure;
    this.stage.recolour();
    this.rebuildPanels();
    this.refresh(always);
  }

  rebuildPanels() {
    for (const panel of this.panels) if (panel.shown) panel.build(this.view.colours, this.scene.marks, this.curvesBox.clientWidth, this.shownRange());
  }

  shownRange() {
    const { start_s, end_s } = this.clock.range;
    return [start_s, end_s];
  }

  /** Draws the present moment, once a frame at most. */
  refresh(now = false) {
    if (now) this.draw();
    else if (!this.waiting) {
      this.waiting = true;
      requestAnimationFrame(() => {
        this.waiting = false;
        if (this.visible) this.draw();
      });
    }
  }

  draw() {
    const { clientWidth, clientHeight } = this.canvasPlace;
    if (!clientWidth) return;
    this.stage.draw(this.time_s, this.ghost_s, this.magnified);
    this.film?.showAt(this.time_s);
    this.labels.draw(this.camera.projection(clientWidth, clientHeight), this.time_s, clientWidth, clientHeight);
    for (const panel of this.panels) panel.showAt(this.time_s);
    this.controls.showAt();
  }

  // --- what tests, pages and keys use ---

  get time_s() {
    return this.clock.time_s;
  }

  seek(time_s) {
    this.clock.seek(time_s);
    this.refresh();
  }

  step(count) {
    const { time_s } = this.figure;
    const here = time_s.findIndex((t) => t >= this.time_s - 1e-9);
    this.seek(time_s[Math.min(Math.max((here < 0 ? time_s.length - 1 : here) + count, 0), time_s.length - 1)]);
  }

  /** Place of a frame or point at the present time, m in root axes. */
  jointPosition(name) {
    const k = this.figure.byName.get(name);
    if (k === undefined) throw new Error(`no point '${name}'; there are ${[...this.figure.byName.keys()].join(", ")}`);
    const places = this.figure.placesAt(this.time_s, new Float32Array(3 * this.figure.points.length));
    return [...places.slice(3 * k, 3 * k + 3)];
  }

  ghostPosition(name) {
    const figure = this.ghost.figure;
    const then = this.ghost_s;
    if (!figure || then === null || !figure.byName.has(name)) return null;
    const k = figure.byName.get(name);
    return [...figure.placesAt(then).slice(3 * k, 3 * k + 3)];
  }

  /** The ghost's own time at the present moment, s; null where there is none. */
  get ghost_s() {
    return this.ghost.figure ? this.ghostTimeAt(this.time_s) : null;
  }

  ghostTimeAt(time_s) {
    const span = spanAt(this.scene.spans, time_s) ?? (this.clock.loop && time_s <= this.clock.loop.end_s ? this.clock.loop : null);
    if (this.ghost.span && !span && this.scene.spans.length) return null;
    return ghostTime(time_s, span, this.ghost.span, this.ghost.align, { own_s: this.figure.start_s, ghost_s: this.ghost.figure.start_s });
  }

  /** `which` is null, "other" for the other track as a whole, or { of: "own" | "other", span: number }. */
  setGhost(which, align = this.ghost.align) {
    const other = which === "other" || which?.of === "other";
    const figure = which === null ? null : other ? this.other : this.figure;
    const spans = other ? this.scene.ghost.spans : this.scene.spans;
    this.ghost = { figure, span: which?.of ? spans[which.span] : null, align };
    const panels = figure && (other ? this.scene.ghost.panels : this.scene.panels);
    for (const panel of this.panels) panel.setGhost(figure?.time_s ?? [0], panels, (time_s) => this.ghostTimeAt(time_s));
    this.recolour();
    this.controls.sync();
  }

  setLoop(span) {
    this.clock.setLoop(span);
    for (const panel of this.panels) if (panel.shown) panel.setRange(this.shownRange());
    this.controls.sync();
    this.refresh();
  }

  preset(number) {
    const viewpoint = this.scene.viewpoints[number];
    if (!viewpoint) return;
    this.camera.seenFrom(viewpoint.seen_from, viewpoint.zoom);
    this.viewpoint = viewpoint.name;
    this.refresh();
  }

  magnify(times) {
    this.magnified = times;
    for (const panel of this.panels) panel.band = times > 0;
    this.rebuildPanels();
    this.controls.sync();
    this.refresh();
  }

  openPanel(key, open) {
    const panel = this.panels.find((one) => one.panel.key === key);
    panel.root.hidden = !open;
    if (open) panel.build(this.view.colours, this.scene.marks, this.curvesBox.clientWidth, this.shownRange());
    this.refresh();
  }

  /** Times at which the lines in the open panels stand, s. */
  get headTimes_s() {
    return this.panels.filter((panel) => panel.shown).map((panel) => panel.headTime_s);
  }
}
