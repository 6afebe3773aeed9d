// Buttons, slider, choices and keys of a player.

import { momentText } from "./clock.js";
import { button, choice, element } from "./dom.js";

const SPEEDS = ["0.1", "0.25", "0.5", "1", "2", "4"];
const MAGNIFIED = ["1", "10", "100"];
const TURN_RAD = 0.12;
const LOOP = "Closed loop: these parts stay together, which the estimate uses";
/** sqrt of the 95 % quantile of chi-squared with 3 degrees of freedom */
const ELLIPSOID_95 = 2.7955;

export class Controls {
  constructor(player) {
    this.player = player;
    const { scene } = player;
    this.views = element("div", { class: "op-views", role: "group", "aria-label": "Seen from" }, ...scene.viewpoints.map((viewpoint, k) => button(viewpoint.name, () => player.preset(k), { label: `Seen from: ${viewpoint.name} (key ${k + 1})`, "data-view": viewpoint.name })), button("+", () => this.zoom(1.2), { label: "Closer (key +)" }), button("−", () => this.zoom(1 / 1.2), { label: "Further away (key -)" }));
    this.legend = element("div", { class: "op-legend" });
    this.makeBar();
    this.makeTools();
    this.makeChooser();
    this.makeLegend();
  }

  zoom(factor) {
    this.player.camera.closer(factor);
    this.player.refresh();
  }

  makeBar() {
    const { player } = this;
    const { start_s, end_s } = player.figure;
    this.playButton = button("▶", () => this.toggle(), { label: "Play (space)", class: "op-play" });
    this.slider = element("input", { type: "range", min: start_s, max: end_s, step: "any", value: start_s, "aria-label": "Time", on: { input: () => player.seek(Number(this.slider.value)) } });
    this.readout = element("output", { class: "op-time", "aria-live": "off" });
    this.moment = element("output", { class: "op-time", "aria-live": "off", hidden: !player.scene.epoch });
    this.bar = element("div", { class: "op-bar" }, this.playButton, this.slider, this.readout, this.moment);
  }

  makeTools() {
    const { player } = this;
    const { scene } = player;
    const speed = choice("Speed", SPEEDS.map((value) => [value, `${value}×`]), (value) => (player.clock.speed = Number(value)));
    speed.select.value = "1";
    this.loop = choice("Loop", [["", "whole"], ...scene.spans.map((span, k) => [String(k), span.label]), ["ab", "from [ to ]"]], (value) => this.chooseLoop(value));
    const ghosts = [["", "none"]];
    if (player.other) ghosts.push(["other", scene.ghost.title || "other track"]);
    scene.ghost?.spans.forEach((span, k) => ghosts.push([`other ${k}`, `${scene.ghost.title || "other"}: ${span.label}`]));
    if (scene.spans.length > 1) scene.spans.forEach((span, k) => ghosts.push([`own ${k}`, span.label]));
    this.ghost = choice("Ghost", ghosts, (value) => this.chooseGhost(value));
    this.align = choice("aligned by", [["phase", "phase"], ["time", "time"]], (value) => this.chooseGhost(this.ghost.select.value, value));
    this.spread = choice("Uncertainty", [["0", "hidden"], ...MAGNIFIED.map((value) => [value, value === "1" ? "95 %" : `95 %, ellipsoids ${value}×`])], (value) => player.magnify(Number(value)));
    this.names = element("input", { type: "checkbox", id: `${player.root.id}-names`, checked: player.labels.shown, on: { change: () => this.showNames(this.names.checked) } });
    const names = element("div", { class: "op-field op-check" }, this.names, element("label", { for: this.names.id, text: "Names" }));
    this.spreadWords = element("p", { class: "op-spread", role: "status", hidden: true });
    this.ghost.field.hidden = ghosts.length < 2;
    this.align.field.hidden = true;
    this.tools = element("div", { class: "op-tools" }, speed.field, this.loop.field, this.ghost.field, this.align.field, this.spread.field, names, this.spreadWords);
  }

  makeChooser() {
    const { player } = this;
    const boxes = player.panels.map(({ panel }, k) => {
      const id = `${player.root.id}-panel-${k}`;
      const box = element("input", { type: "checkbox", id, checked: panel.open, on: { change: () => (player.openPanel(panel.key, box.checked), this.countCurves()) } });
      return element("div", { class: "op-check" }, box, element("label", { for: id, text: `${panel.label}, ${panel.unit}` }));
    });
    this.chooser = element("details", { class: "op-chooser", hidden: player.panels.length < 2 }, (this.counted = element("summary")), element("div", { class: "op-boxes" }, ...boxes));
    this.countCurves();
  }

  countCurves() {
    const { panels } = this.player;
    this.counted.textContent = `Curves: ${panels.filter((one) => one.shown).length} of ${panels.length} shown`;
  }

  makeLegend() {
    const { scene } = this.player;
    const sides = new Set(scene.bones.map((bone) => bone.side));
    const items = [];
    if (sides.has("right")) items.push(["op-right", "right"]);
    if (sides.has("left")) items.push(["op-left", "left"]);
    if (scene.loops.length) items.push(["op-loop", scene.loop_words, LOOP]);
    this.ghostKey = element("span", { class: "op-key op-ghost", text: "ghost", hidden: true });
    this.legendEmpty = items.length === 0;
    this.legend.hidden = this.legendEmpty;
    this.legend.append(...items.map(([name, text, title = false]) => element("span", { class: `op-key ${name}`, text, title })), this.ghostKey);
  }

  toggle() {
    const { clock } = this.player;
    if (clock.playing) clock.pause();
    else clock.play();
    this.showAt();
  }

  showNames(shown) {
    this.names.checked = shown;
    this.player.labels.shown = shown;
    this.player.refresh();
  }

  chooseLoop(value) {
    const { player } = this;
    if (value === "ab") this.loopBetween();
    else player.setLoop(value === "" ? null : player.scene.spans[Number(value)]);
  }

  /** Keys [ and ] set where a loop of one's own begins and ends. */
  loopBetween(from = this.from_s, to = this.to_s) {
    const { player } = this;
    this.from_s = from ?? player.figure.start_s;
    this.to_s = to ?? player.figure.end_s;
    if (this.to_s - this.from_s > 0.02) player.setLoop({ start_s: this.from_s, end_s: this.to_s, label: "from [ to ]" });
  }

  chooseGhost(value, align = this.align.select.value) {
    const [of, span] = value.split(" ");
    this.player.setGhost(value === "" ? null : span === undefined ? "other" : { of, span: Number(span) }, align);
  }

  /** The choices say what holds, whoever set it. */
  sync() {
    const { player } = this;
    const loop = player.clock.loop;
    const number = loop ? player.scene.spans.findIndex((span) => span.label === loop.label) : -1;
    this.loop.select.value = !loop ? "" : number < 0 ? "ab" : String(number);
    const { figure, span, align } = player.ghost;
    const own = figure === player.figure;
    const spans = own ? player.scene.spans : player.scene.ghost?.spans ?? [];
    this.ghost.select.value = !figure ? "" : span ? `${own ? "own" : "other"} ${spans.indexOf(span)}` : "other";
    this.align.select.value = align;
    this.align.field.hidden = !span;
    this.ghostKey.hidden = !figure;
    this.legend.hidden = this.legendEmpty && !figure;
    this.spread.select.value = String(player.magnified);
  }

  showAt() {
    const { player } = this;
    const { clock } = player;
    this.slider.value = clock.time_s;
    this.slider.setAttribute("aria-valuetext", `${clock.time_s.toFixed(2)} s of ${clock.whole.end_s.toFixed(2)} s`);
    this.readout.textContent = `${clock.time_s.toFixed(2)} s`;
    if (player.scene.epoch) this.moment.textContent = momentText(player.scene.epoch, clock.time_s);
    this.playButton.textContent = clock.playing ? "❚❚" : "▶";
    const words = clock.playing ? "Pause (space)" : "Play (space)";
    this.playButton.setAttribute("aria-label", words);
    this.playButton.title = words;
    this.showSpread();
  }

  showSpread() {
    const { player } = this;
    this.spreadWords.hidden = !player.magnified;
    if (!player.magnified) return;
    const spread = player.scene.spread;
    if (!spread) {
      this.spreadWords.textContent = "This track has no standard deviations of places.";
      return;
    }
    const sizes = player.figure.factorsAt(player.time_s).map(({ point, factor }) => [Math.hypot(...factor), player.figure.points[point].name]);
    const [largest, name] = sizes.reduce((one, other) => (other[0] > one[0] ? other : one), [0, ""]);
    const how = spread.source === "beliefs" ? "" : " Joints are taken as independent.";
    const exact = " Lengths that were not estimated count as exact.";
    this.spreadWords.textContent = `Ellipsoids hold 95 %: at most ± ${(1000 * ELLIPSOID_95 * largest).toFixed(1)} mm (${name.replaceAll("_", " ")}).${how}${exact}`;
  }

  key(event) {
    const { player } = this;
    const { target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || target.closest("select, summary")) return;
    if (event.key === " " && target.closest("button, input[type=checkbox]")) return;
    const turns = { ArrowLeft: [-TURN_RAD, 0], ArrowRight: [TURN_RAD, 0], ArrowUp: [0, TURN_RAD], ArrowDown: [0, -TURN_RAD] };
    const done = event.shiftKey && turns[event.key] ? () => (player.camera.turn(...turns[event.key]), player.refresh()) : this.plainKey(event.key);
    if (!done) return;
    event.preventDefault();
    done();
  }

  plainKey(key) {
    const { player } = this;
    const { clock } = player;
    const keys = {
      " ": () => this.toggle(),
      ArrowLeft: () => player.step(-1),
      ArrowRight: () => player.step(1),
      PageUp: () => player.seek(clock.time_s - 1),
      PageDown: () => player.seek(clock.time_s + 1),
      Home: () => player.seek(clock.range.start_s),
      End: () => player.seek(clock.range.end_s),
      "[": () => this.loopBetween(clock.time_s, Math.max(this.to_s ?? player.figure.end_s, clock.time_s)),
      "]": () => this.loopBetween(Math.min(this.from_s ?? player.figure.start_s, clock.time_s), clock.time_s),
      "+": () => this.zoom(1.2),
      "-": () => this.zoom(1 / 1.2),
      n: () => this.showNames(!this.names.checked),
      u: () => player.magnify(player.magnified ? 0 : 1),
    };
    if (/^[1-9]$/.test(key) && player.scene.viewpoints[key - 1]) return () => player.preset(key - 1);
    return keys[key];
  }
}
