// The guided start: instruction, picture, countdown and result of the step that is to be done, large enough for two metres.

import { button, element } from "../dom.js";
import { PosePicture } from "./pose.js";
import { Sound } from "./sound.js";
import { stateOf } from "./sensors.js";

const BEGIN_HZ = 660;
const END_HZ = 880;
/** A movement begins with a rest, in which its posture is measured. */
const REST_S = 1;
const MARKS = { pass: "✓", kept: "✓", redo: "✗", skipped: "–" };
const SAID = { pass: "passed", kept: "passed", redo: "to do again", skipped: "skipped" };
const KEYS = { " ": "go", Enter: "go", ArrowRight: "go", PageDown: "go", ArrowLeft: "back", PageUp: "back" };
const NOW = { pose: "Hold still", still: "Leave them lying", turn: "Turn the units", move: "Move now" };

const WORDS = {
  offered: { title: "Guided start", go: "Begin", leave: "Track without calibration" },
  ready: { go: "Start", back: "Previous step", skip: "Skip this step", leave: "End without calibration" },
  countdown: { go: "Start now", back: "Stop" },
  running: { go: "Done", back: "Stop" },
  checking: { back: "Do it again" },
  doubtful: { title: "All steps are done, but something is uncertain", go: "Use it anyway", back: "Repeat a step", leave: "End without calibration" },
  calibrated: { title: "Calibrated", go: "Start tracking", back: "Repeat a step", leave: "Later" },
};

const write = (place, text) => place.textContent === text || (place.textContent = text);

export class Guide {
  /** `told` stands in the session's first message, `order` sends a command, `clock` gives the session's time. */
  constructor(told, streams, figure, order, clock) {
    Object.assign(this, { steps: told.steps, streams, order, clock, state: { phase: "closed", steps: [] }, sound: new Sound() });
    this.picture = figure && told.steps.some((step) => step.pictures.length) ? new PosePicture(figure, told.steps) : null;
    this.count = element("p", { class: "ol-guide-place" });
    this.title = element("h2", { class: "ol-guide-title" });
    this.say = element("p", { class: "ol-guide-say" });
    this.now = element("p", { class: "ol-guide-now", role: "status" });
    this.number = element("b", { class: "ol-guide-number", "aria-hidden": "true" });
    this.bar = element("progress", { class: "ol-guide-bar", max: "1", value: "0", "aria-label": "How much of the step is done" });
    this.result = element("div", { class: "ol-guide-result", role: "alert" });
    this.list = element("ol", { class: "ol-guide-steps", "aria-label": "Steps" }, ...told.steps.map((step, k) => element("li", { text: String(k + 1) })));
    this.units = element("ul", { class: "ol-guide-units", "aria-label": "Sensors" });
    this.buttons = Object.fromEntries(["go", "back", "skip", "swap", "leave"].map((what) => [what, button(what, () => this.press(what), { class: `ol-button ol-guide-${what}${what === "go" ? " ol-main" : ""}` })]));
    const { swap, ...others } = this.buttons;
    this.swap = swap;
    const words = element("div", { class: "ol-guide-words" }, this.title, this.say, element("div", { class: "ol-guide-clock" }, this.number, this.now), this.bar, this.result, swap);
    this.root = element("section", { class: "ol-card ol-guide", "aria-label": "Guided start", hidden: true }, element("div", { class: "ol-guide-head" }, this.count, this.list), element("div", { class: "ol-guide-body" }, this.picture?.root, words), this.units, element("div", { class: "ol-guide-buttons" }, ...Object.values(others)));
  }

  get isOpen() {
    return this.state.phase !== "closed";
  }

  press(what) {
    if (what === "go") this.sound.turn(true);
    this.order({ do: "guide", press: what });
  }

  /** Whether a key was one of the guide's; buttons get theirs from the browser. */
  key(event) {
    const what = KEYS[event.key];
    if (!this.isOpen || !what || (event.target.closest("button, summary, canvas") && (event.key === " " || event.key === "Enter"))) return false;
    if (WORDS[this.state.phase][what]) this.press(what);
    return true;
  }

  take(state) {
    const before = this.state;
    this.state = state;
    this.root.hidden = !this.isOpen;
    if (!this.isOpen) return;
    const { phase, at } = state;
    const step = this.steps[at];
    const words = WORDS[phase];
    const isStep = ["ready", "countdown", "running", "checking"].includes(phase);
    write(this.count, isStep ? `Step ${at + 1} of ${this.steps.length}` : "");
    write(this.title, words.title ?? step.name);
    write(this.say, isStep ? step.say : this.sayOf(phase));
    this.mark(state, isStep);
    for (const [what, made] of Object.entries(this.buttons)) this.label(made, what, words[what]);
    this.tellResult(state, isStep);
    this.bar.hidden = phase !== "running";
    this.picture?.show(isStep ? at : -1, phase === "running" || phase === "ready");
    if (before.phase === "countdown" && phase === "running") this.sound.tone(BEGIN_HZ);
    if (before.phase === "running" && phase === "checking") this.sound.tone(END_HZ);
    if (before.phase !== phase || before.at !== at) this.root.scrollIntoView({ block: "start" });
    this.draw();
  }

  label(made, what, words) {
    made.hidden = !words;
    if (!words || made.textContent === words) return;
    made.textContent = words;
    made.title = words;
    made.setAttribute("aria-label", what === "go" ? `${words} (space or page down)` : what === "back" ? `${words} (page up)` : words);
  }

  sayOf(phase) {
    if (phase === "calibrated") return "It is known now where each unit sits. Take up the posture in which you will begin, then start.";
    if (phase === "doubtful") return "You can use the calibration, or repeat the steps that were hard to do.";
    return `It is not known yet how the units are mounted. ${this.steps.length} short steps show it: postures that you hold and movements that you make. Each is checked at once. Press the large button, the space bar or page down on a remote; any phone or laptop that shows this page may lead.`;
  }

  mark({ steps, at }, isStep) {
    [...this.list.children].forEach((item, k) => {
      const outcome = steps[k]?.outcome ?? "";
      write(item, MARKS[outcome] ?? String(k + 1));
      item.className = outcome ? `ol-step-${outcome}` : "";
      item.title = `${this.steps[k].name}${SAID[outcome] ? `: ${SAID[outcome]}` : ""}`;
      if (isStep && k === at) item.setAttribute("aria-current", "step");
      else item.removeAttribute("aria-current");
    });
  }

  tellResult({ phase, at, steps, problem, doubts, exchanged }, isStep) {
    const lines = [];
    const own = steps[at];
    if (problem) lines.push(problem);
    if (isStep && phase === "ready" && own?.outcome === "redo") lines.push(`Not yet: ${own.sentence}`);
    if (exchanged.length && phase === "ready") lines.push(`${exchanged.join(" and ")} sit in each other's place. Exchange them on the body and repeat the steps from the first one, or leave them there and press this button:`);
    lines.push(...doubts);
    const text = lines.join("\n");
    if (this.resultText !== text) this.result.replaceChildren(...lines.map((line) => element("p", { class: "ol-alarm", text: line })));
    this.resultText = text;
    this.label(this.swap, "swap", exchanged.length === 2 && phase === "ready" ? "Exchange them here and begin again" : "");
  }

  /** Five times a second and with each picture: what the clock shows. */
  draw() {
    if (!this.isOpen) return;
    const { phase, at, begins_s, ends_s } = this.state;
    const step = this.steps[at];
    const now_s = this.clock();
    const left_s = Math.max(0, (phase === "countdown" ? begins_s : ends_s) - now_s);
    const isCounting = phase === "countdown" || (phase === "running" && left_s > 0);
    write(this.number, isCounting ? String(Math.ceil(left_s)) : "");
    const isResting = phase === "running" && step.kind === "move" && now_s < begins_s + REST_S;
    const words = { countdown: step.kind === "turn" ? "Lay the units down" : "Take up the posture", running: isResting ? "Hold still" : NOW[step.kind], checking: "Checking …" }[phase] ?? "";
    write(this.now, words);
    if (phase === "running") this.bar.value = Math.min(1, (now_s - begins_s) / (ends_s - begins_s));
    this.picture?.draw(performance.now() / 1000);
  }

  /** States of the inertial units, from the session's health. */
  takeHealth(health) {
    if (!this.isOpen) return;
    const rows = this.streams.filter(({ kind }) => kind === "imu").map((stream) => stateOf(stream, health));
    const text = JSON.stringify(rows.map(({ name, state, level }) => [name, state, level]));
    if (text === this.unitsText) return;
    this.unitsText = text;
    this.units.replaceChildren(...rows.map(({ name, state, level }) => element("li", { class: `ol-${level}` }, element("b", { text: name }), element("span", { text: ` ${state}` }))));
  }
}
