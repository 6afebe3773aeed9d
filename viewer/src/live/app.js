// Receives the session's messages, paints the newest frame, and acknowledges it when it has been painted.

import { element } from "../dom.js";
import { palette } from "../palette.js";
import { Bar } from "./bar.js";
import { Big } from "./big.js";
import { Curves } from "./curves.js";
import { LiveFigure } from "./figure.js";
import { Guide } from "./guide.js";
import { History } from "./history.js";
import { Link, now_s } from "./link.js";
import { Log } from "./log.js";
import { Memory } from "./memory.js";
import { Sensors } from "./sensors.js";
import { Stage } from "./stage.js";
import { Strokes } from "./strokes.js";

/** A figure that is older stands still: it is greyed. */
const STALE_S = 1;
const WORDS_MS = 200;
/** Longer between two frames: the page was hidden. */
const PAUSE_MS = 500;
const KEPT = 5000;
const LOST = "No connection to the session: what you see is old. The page tries again by itself. If the session was ended, start it again.";

export class App {
  constructor(root) {
    Object.assign(this, { root, painted: [], frames: 0, skipped: 0, frame: null, health: null });
    const socket = new URL("live", location.href);
    socket.protocol = location.protocol.replace("http", "ws");
    socket.search = location.search;
    this.afterPaint = new MessageChannel();
    this.afterPaint.port1.onmessage = () => this.shown();
    this.root.replaceChildren(element("p", { class: "ol-empty", role: "status", text: "Connecting to the session …" }));
    this.link = new Link(socket.href, (message, arrived_s) => this.hear(message, arrived_s), () => this.tell());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
    addEventListener("keydown", (event) => this.key(event));
    setInterval(() => this.tell(), WORDS_MS);
    requestAnimationFrame((now_ms) => this.turn(now_ms, now_ms));
  }

  hear(message, arrived_s) {
    if (message.type === "hello") this.build(message);
    else if (message.type === "now") this.waiting = { message, arrived_s };
    else if (message.type === "event") this.log.add(message.text, message.time_s);
    else if (message.type === "problem") this.complain(message.text);
    else if (message.type === "stroke") this.strokes?.take(message);
  }

  build(hello) {
    document.title = `${hello.title} – live`;
    this.colours = palette();
    const memory = new Memory(hello.model);
    const order = (told) => this.link.send(told) || this.complain("There is no connection: nothing was sent. Try again.");
    this.frame = null;
    this.history = new History(hello.joints);
    this.figure = hello.figure && new LiveFigure(hello.figure);
    this.stage = this.figure && new Stage(this.figure, memory);
    this.curves = new Curves(hello.joints, hello.figure?.first_curves, this.history, memory);
    this.strokes = hello.strokes ? new Strokes(hello.strokes, memory) : null;
    this.guide = hello.guide ? new Guide(hello.guide, hello.streams, hello.figure, order, () => this.link.sessionTime()) : null;
    this.sensors = new Sensors(hello.streams, order, hello.guide && (() => order({ do: "guide", press: "open" })));
    this.log = new Log(order, () => this.link.sessionTime());
    this.big = new Big(this.curves, this.strokes, this.history);
    this.bar = new Bar(hello, { order, note: () => this.log.ask(), big: () => this.enlarge() });
    const left = element("div", { class: "ol-column" }, this.stage?.root, this.strokes?.root);
    const main = element("main", { class: "ol-main-columns" }, left, element("div", { class: "ol-column" }, this.curves.root), element("div", { class: "ol-column ol-wide" }, this.sensors.root, this.log.root));
    this.root.replaceChildren(this.bar.root, this.bar.alarms, ...[this.guide?.root].filter(Boolean), this.big.root, main, this.log.dialog);
    this.memory = memory;
    this.enlarge(memory.get("big", false));
    this.tell();
  }

  /** Each animation frame: the newest message, if there is one. */
  turn(now_ms, before_ms) {
    requestAnimationFrame((next_ms) => this.turn(next_ms, now_ms));
    if (!this.bar) return;
    this.guide?.draw();
    if (this.stage && this.big.root.hidden && now_ms - before_ms < PAUSE_MS) this.stage.pace(now_ms - before_ms);
    if (this.waiting) this.take(this.waiting);
    else if (this.stage?.isStale && this.frame) this.stage.draw(this.frame.time_s);
  }

  take({ message, arrived_s }) {
    this.waiting = null;
    this.skipped = message.skipped ?? 0;
    if (message.health) this.takeHealth(message.health);
    if (message.guide) this.takeGuide(message.guide);
    if (message.frame) {
      this.frame = message.frame;
      this.frames += 1;
      this.history.take(message.frame);
      this.figure?.take(message.frame);
      if (this.big.root.hidden) this.draw();
    }
    this.painting = { arrived_s, frame: message.frame };
    // a message to itself comes after the browser has painted what was drawn here
    this.afterPaint.port2.postMessage(null);
  }

  takeGuide(state) {
    if (!this.guide) return;
    const wasOpen = this.guide.isOpen;
    this.guide.take(state);
    this.root.classList.toggle("ol-guiding", this.guide.isOpen);
    if (this.guide.isOpen && !wasOpen) this.enlarge(false);
    if (this.guide.isOpen && this.health) this.guide.takeHealth(this.health);
  }

  draw() {
    this.stage?.draw(this.frame.time_s);
    this.curves.draw(this.colours);
  }

  shown() {
    const { arrived_s, frame } = this.painting;
    const painted_s = now_s();
    this.link.send({ shown: 1 });
    if (!frame) return;
    this.age = { arrival_s: frame.arrival_s, painted_s, age_s: this.link.sessionTime(painted_s) - frame.arrival_s };
    this.painted.push({ time_s: frame.time_s, waited_ms: 1000 * (painted_s - arrived_s), age_ms: 1000 * this.age.age_s });
    if (this.painted.length > KEPT) this.painted.shift();
  }

  takeHealth(health) {
    this.health = health;
    this.sensors.take(health);
    this.guide?.takeHealth(health);
    const heard = new Set(health.devices.flatMap((device) => device.streams));
    const [silent, awaited] = [true, false].map((isHeard) => health.silent.filter((name) => heard.has(name) === isHeard).join(", "));
    this.bar.alarm("silent", silent && `Silent: ${silent}. Check battery and radio, or exchange the unit.`);
    const swapped = (health.swapped ?? []).join(" and ");
    this.bar.alarm("swapped", swapped && `${swapped} are swapped. Exchange the units on the body, or press the button beside the sensors.`);
    this.bar.alarm("awaited", awaited && `Not heard yet: ${awaited}. Switch these units on.`, "odd");
    this.bar.alarm("recorder", health.recorder.problem && `The session has a problem. ${health.recorder.problem}`);
  }

  /** Five times a second: numbers and states as words. */
  tell() {
    if (!this.bar) return;
    const isOpen = this.link.state === "open";
    const age_s = this.frame ? this.link.sessionTime() - this.frame.arrival_s : NaN;
    const isTracking = Boolean(this.health?.is_tracking);
    const isStale = !isOpen || (Number.isFinite(age_s) && age_s > STALE_S);
    this.root.classList.toggle("ol-stale", isStale);
    this.root.classList.toggle("ol-lost", !isOpen);
    this.bar.tell({ isOpen, isTracking, isStale: isStale || !this.frame });
    this.bar.tellAge(isStale ? age_s : (this.age?.age_s ?? NaN), this.skipped, isOpen ? "" : nextTry(this.link));
    this.bar.alarm("link", isOpen ? "" : LOST);
    if (!isOpen) return;
    this.curves.tell();
    this.big.tell();
  }

  complain(text) {
    this.log?.add(text, NaN, "problem");
    this.bar?.alarm("problem", text);
    clearTimeout(this.complaining);
    this.complaining = setTimeout(() => this.bar?.alarm("problem", ""), 10_000);
  }

  enlarge(isLarge = this.big.root.hidden) {
    this.big.toggle(isLarge);
    this.memory.set("big", isLarge);
    this.root.classList.toggle("ol-enlarged", isLarge);
    this.bar.big.setAttribute("aria-pressed", isLarge);
    if (!isLarge && this.frame) this.draw();
  }

  recolour() {
    if (!this.bar) return;
    this.colours = palette();
    this.stage?.recolour();
    if (this.frame) this.draw();
  }

  key(event) {
    if (!this.bar || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest?.("input, select, dialog")) return;
    if (this.guide?.key(event)) {
      event.preventDefault();
      return;
    }
    const keys = { n: () => this.log.ask(), b: () => this.enlarge(), t: () => this.bar.start(), Escape: () => this.enlarge(false) };
    const view = /^[1-9]$/.test(event.key) && this.stage ? () => this.stage.see(Number(event.key) - 1) : null;
    const done = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key] ?? view;
    if (!done) return;
    event.preventDefault();
    done();
  }

  /** Place of a point now, m in root axes: for tests. */
  jointPosition(name) {
    const k = this.figure.points.findIndex((point) => point.name === name || point.frames.includes(name));
    return [...this.figure.placesAt().slice(3 * k, 3 * k + 3)];
  }
}

function nextTry({ state, retry_s }) {
  return state === "waiting" ? `next try in ${Math.max(1, Math.ceil(retry_s - now_s()))} s` : "trying now";
}
