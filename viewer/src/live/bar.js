// The head of the page: what the session does, how old the figure is, and the large buttons; below it what is wrong.

import { button, element } from "../dom.js";
import { ago } from "./numbers.js";

const AGAIN_MS = 4000;

export class Bar {
  constructor({ title }, { order, note, big }) {
    this.order = order;
    this.state = element("span", { class: "ol-chip", role: "status" });
    this.age = element("span", { class: "ol-age", "aria-live": "off" });
    this.track = button("Start tracking", () => this.press(), { class: "ol-button ol-main", label: "Start tracking (key T)" });
    this.big = keyed("Large numbers", "B", big, { "aria-pressed": "false" });
    this.root = element("header", { class: "ol-bar" }, element("h1", { text: title }), this.state, this.age, element("div", { class: "ol-actions", role: "group", "aria-label": "Session" }, this.track, keyed("Note", "N", note), this.big));
    this.alarms = element("div", { class: "ol-alarms", role: "alert" });
    this.wrong = new Map();
  }

  /** Starting is one press; stopping asks for a second one, since it ends the track. */
  press() {
    if (!this.isTracking) this.start();
    else if (this.isAsked) {
      this.order({ do: "stop" });
      this.unask();
    } else {
      this.isAsked = true;
      this.label();
      this.asking = setTimeout(() => this.unask(), AGAIN_MS);
    }
  }

  start() {
    if (!this.isTracking) this.order({ do: "track" });
  }

  unask() {
    clearTimeout(this.asking);
    this.isAsked = false;
    this.label();
  }

  label() {
    const words = this.isTracking ? (this.isAsked ? "Press again to stop" : "Stop tracking") : "Start tracking";
    if (this.track.textContent === words) return;
    this.track.textContent = words;
    this.track.setAttribute("aria-label", this.isTracking ? words : `${words} (key T)`);
    this.track.title = words;
    this.track.classList.toggle("ol-danger", this.isTracking);
  }

  tell({ isOpen, isTracking, isStale }) {
    this.isTracking = isTracking;
    this.label();
    this.track.disabled = !isOpen;
    const [words, level] = !isOpen ? ["No connection", "bad"] : !isTracking ? ["Not tracking", "odd"] : isStale ? ["No new figure", "bad"] : ["Tracking", "good"];
    if (this.state.textContent !== words) this.state.textContent = words;
    this.state.className = `ol-chip ol-${level}`;
  }

  tellAge(age_s, skipped, next) {
    const age = !Number.isFinite(age_s) ? "no figure yet" : age_s < 1 ? `figure ${Math.round(1000 * age_s)} ms old` : `figure ${ago(age_s)} old`;
    this.age.textContent = [age, next].filter(Boolean).join(", ");
    this.age.title = `Age of the shown figure, from the arrival of its last reading. Newer figures replaced ${skipped} that this browser had no time for.`;
  }

  /** What is wrong now; an empty text takes it away. Only what changes is written, so that readers aloud say it once. */
  alarm(kind, text, level = "bad") {
    if ((this.wrong.get(kind)?.textContent ?? "") === text) return;
    this.wrong.get(kind)?.remove();
    this.wrong.delete(kind);
    if (!text) return;
    const line = element("p", { class: `ol-alarm ol-${level}`, text });
    this.wrong.set(kind, line);
    this.alarms.append(line);
  }
}

/** A large button with its key, which small screens leave out. */
function keyed(words, key, pressed, attributes = {}) {
  const made = button(words, pressed, { class: "ol-button", label: `${words} (key ${key})`, ...attributes });
  made.append(element("span", { class: "ol-key", text: ` (${key})` }));
  return made;
}
