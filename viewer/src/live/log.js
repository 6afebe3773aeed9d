// Events of the session with their time of day, and the dialog that writes a note into the recording.

import { button, element } from "../dom.js";

const SHOWN = 100;
const READY = ["Good", "Look at this", "Rest"];

export class Log {
  constructor(order, sessionTime) {
    Object.assign(this, { order, sessionTime });
    this.list = element("ol", { class: "ol-events", "aria-label": "Events, newest first" });
    this.root = element("section", { class: "ol-card ol-log", "aria-labelledby": "ol-events" }, element("div", { class: "ol-head" }, element("h2", { id: "ol-events", text: "Events" }), button("Note (N)", () => this.ask(), { class: "ol-button", label: "Write a note into the recording (key N)" })), this.list);
    this.makeDialog();
  }

  makeDialog() {
    this.text = element("input", { id: "ol-note", type: "text", maxlength: "500", autocomplete: "off" });
    const ready = READY.map((words) => button(words, () => this.write(words), { class: "ol-button" }));
    const submit = (event) => {
      event.preventDefault();
      this.write(this.text.value);
    };
    const form = element("form", { on: { submit } }, element("label", { for: "ol-note", text: "Note for this moment" }), this.text, element("div", { class: "ol-fields" }, ...ready), element("div", { class: "ol-fields" }, element("button", { class: "ol-button ol-main", text: "Save (Enter)" }), button("Cancel (Esc)", () => this.dialog.close(), { class: "ol-button" })));
    this.dialog = element("dialog", { class: "ol-dialog", "aria-label": "Note" }, form);
  }

  /** The moment counts at which the coach asked, not the one at which the text is ready. */
  ask() {
    this.asked_s = this.sessionTime();
    this.text.value = "";
    this.dialog.showModal();
  }

  write(words) {
    this.order({ do: "note", text: words.trim() || "mark", time_s: Number(this.asked_s.toFixed(2)) });
    this.dialog.close();
  }

  add(text, time_s, level = "event") {
    const back_ms = Number.isFinite(time_s) ? 1000 * Math.max(0, this.sessionTime() - time_s) : 0;
    const moment = new Date(Date.now() - back_ms).toLocaleTimeString([], { hour12: false });
    this.list.prepend(element("li", { class: `ol-${level}` }, element("time", { text: moment }), element("span", { text })));
    while (this.list.children.length > SHOWN) this.list.lastChild.remove();
  }
}
