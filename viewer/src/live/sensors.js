// Health of the sensors, in words, and the exchange of a unit.

import { button, choice, element } from "../dom.js";
import { Channels, SILENT_S } from "./channels.js";
import { ago, decimals } from "./numbers.js";

const SLOW_SHARE = 0.8;
const LOSSY_PERCENT = 3;
const LOW_PERCENT = 15;
const LATE_MS = 100;

const NUMBERS = ["rate", "lost", "delay", "drift", "battery", "unit"];

const write = (place, text) => place.textContent === text || (place.textContent = text);

const UNHEARD = "not heard yet";

const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

export class Sensors {
  /** `guide` opens the guided start; none in sessions that have none. */
  constructor(streams, order, guide) {
    Object.assign(this, { streams, order, rows: new Map() });
    this.body = element("tbody", {});
    const heads = ["Sensor", "State", "Rate", "Lost", "Delay", "Drift", "Battery", "Unit"].map((text) => element("th", { scope: "col", text }));
    const table = element("table", { class: "ol-sensors" }, element("thead", {}, element("tr", {}, ...heads)), this.body);
    this.summary = element("span", { class: "ol-hint" });
    this.calibrate = guide && button("Guided start", guide, { class: "ol-button ol-calibrate", label: "Open the guided start: calibrate the mounts" });
    this.recorder = element("p", { class: "ol-recorder" });
    this.arrivals = element("p", { class: "ol-hint" });
    this.stream = choice("Sensor", streams.map(({ name }) => [name, name]), () => {});
    this.device = choice("is now unit", [], () => {});
    this.apply = button("Use this unit", () => this.exchange(), { class: "ol-button" });
    this.exchanger = element("details", { class: "ol-chooser" }, element("summary", { text: "Exchange a unit" }), element("p", { class: "ol-hint", text: "Switch the new unit on. It appears in the list when it is heard." }), element("div", { class: "ol-fields" }, this.stream.field, this.device.field, this.apply));
    this.swap = button("", () => this.order({ do: "swap", streams: this.pair }), { class: "ol-button ol-swap", label: "Exchange the two swapped units in the session" });
    this.swap.hidden = true;
    this.channels = new Channels();
    this.root = element("section", { class: "ol-card", "aria-labelledby": "ol-sensors" }, element("div", { class: "ol-head" }, element("h2", { id: "ol-sensors", text: "Sensors" }), this.summary, this.calibrate), this.swap, table, this.channels.root, this.exchanger, this.recorder, this.arrivals);
  }

  exchange() {
    this.order({ do: "assign", stream: this.stream.select.value, device: this.device.select.value });
  }

  take(health) {
    const rows = this.streams.map((stream) => stateOf(stream, health));
    const used = new Set(rows.map((row) => row.device).filter(Boolean));
    const spare = health.devices.filter((device) => !used.has(device) && !device.streams.length);
    const spares = spare.map((device) => ({ name: device.name, device, state: spareState(device), level: "spare" }));
    const shown = [...rows, ...spares];
    for (const row of shown) this.row(row);
    for (const [name, { root }] of this.rows) if (!shown.some((row) => row.name === name)) root.remove(), this.rows.delete(name);
    const missing = health.silent.length;
    this.summary.textContent = missing ? `${rows.length - missing} of ${rows.length} send` : `all ${rows.length} send`;
    this.offerSwap(health.swapped ?? []);
    this.channels.take(health.devices);
    this.offer([...spare, ...used]);
    this.tellRecorder(health.recorder);
    this.tellArrivals(health);
  }

  /** Two units that sit in each other's place can be exchanged with one press. */
  offerSwap(pair) {
    this.pair = pair;
    this.swap.hidden = pair.length !== 2;
    write(this.swap, pair.length === 2 ? `Exchange ${pair.join(" and ")} in the session` : "");
  }

  /** The units to choose from: unused ones first; the coach's choice stays. */
  offer(devices) {
    const names = devices.map((device) => device.name).filter(Boolean);
    if (names.join("\n") === this.offered) return;
    this.offered = names.join("\n");
    const { select } = this.device;
    const before = select.value;
    select.replaceChildren(...devices.filter((one) => one.name).map((one) => element("option", { value: one.name, text: `${one.name}${one.streams.length ? ` (${one.streams.join(", ")})` : ""}` })));
    if (names.includes(before)) select.value = before;
    this.apply.disabled = names.length === 0;
  }

  /** Rows stay, so that a button in them keeps the focus; only words change. */
  row({ name, device, state, level }) {
    if (!this.rows.has(name)) this.rows.set(name, this.newRow(name));
    const { root, words, exchange, cells } = this.rows.get(name);
    root.className = `ol-${level}`;
    write(words, state);
    exchange.hidden = level !== "bad" && state !== UNHEARD;
    numbersOf(device).forEach(([text, isOdd], k) => {
      write(cells[k], text);
      cells[k].classList.toggle("ol-odd", Boolean(isOdd));
    });
  }

  newRow(name) {
    const words = element("span", {});
    const exchange = button("Exchange", () => this.open(name), { label: `Exchange the unit of ${name}`, class: "ol-small" });
    const cells = NUMBERS.map((label) => element("td", { "data-label": label }));
    const root = element("tr", {}, element("th", { scope: "row", text: name }), element("td", { class: "ol-state" }, words, exchange), ...cells);
    this.body.append(root);
    return { root, words, exchange, cells };
  }

  open(name) {
    this.exchanger.open = true;
    this.stream.select.value = name;
    this.device.select.focus();
  }

  tellRecorder({ packets, lost, elsewhere, second, failures, problem, free_gb }) {
    const words = [
      `${plural(packets, "packet")} on disk`,
      free_gb === null ? "its disk cannot be read" : `${free_gb} GB free`,
      failures ? plural(failures, "failed write") : "",
      second ? `${plural(elsewhere, "packet")} recorded elsewhere: ${second}` : "",
      lost ? `${plural(lost, "packet")} lost` : "",
    ];
    write(this.recorder, `Recorder: ${words.filter(Boolean).join(", ")}.`);
    this.recorder.classList.toggle("ol-alarm", Boolean(problem || lost));
  }

  tellArrivals({ arrivals, sources, outputs = [] }) {
    const late = Object.entries(arrivals).filter(([, count]) => count > 0).map(([kind, count]) => `${kind.replaceAll("_", " ")}: ${count}`);
    const damaged = sources.filter((source) => source.damaged).map((source) => `${source.name}: ${plural(source.damaged, "damaged message")}`);
    const sent = outputs.map(({ name, sent: count, skipped, problem }) => `${name}: ${problem || `${count} sent`}${skipped ? `, ${skipped} left out` : ""}`);
    const states = sources.map((source) => `${source.name}: ${source.state}`);
    this.arrivals.textContent = [`Sources: ${states.join(", ")}.`, late.length ? `Readings: ${late.join(", ")}.` : "", damaged.length ? `${damaged.join(", ")}.` : "", sent.length ? `Outputs: ${sent.join("; ")}.` : ""].filter(Boolean).join(" ");
  }
}

/** Texts of `NUMBERS` for a device, and whether each is odd. */
function numbersOf(device) {
  if (!device) return NUMBERS.map(() => ["–"]);
  const { rate_hz, lost_percent, delay_ms, drift_ppm, battery_percent, name, source } = device;
  return [
    [`${decimals(rate_hz, 0)} Hz`],
    [`${decimals(lost_percent, 1)} %`, lost_percent > LOSSY_PERCENT],
    [`${decimals(delay_ms, 0)} ms`, delay_ms > LATE_MS],
    [`${decimals(drift_ppm, 0)} ppm`],
    battery_percent === null ? ["–"] : [`${decimals(battery_percent, 0)} %`, battery_percent < LOW_PERCENT],
    // a line may break behind the address
    [(name || source).replaceAll("/", "/\u200b")],
  ];
}

function spareState(device) {
  const isRecorded = Object.keys(device.values ?? {}).length > 0;
  const isSilent = device.silent_s > (isRecorded ? SILENT_S : 1);
  return `${isRecorded ? "recorded, feeds no sensor" : "not used"}, ${isSilent ? `silent for ${ago(device.silent_s)}` : "sends"}`;
}

/** What a stream does, in words; level "bad" for silent, "odd" for slow or lossy, "good" otherwise. */
export function stateOf({ name, rate_hz }, health) {
  const heard = health.devices.filter((device) => device.streams.includes(name));
  const device = heard.sort((one, other) => (one.silent_s ?? Infinity) - (other.silent_s ?? Infinity))[0] ?? null;
  if (health.silent.includes(name)) {
    const never = !device || device.silent_s === null;
    return never ? { name, device, level: "odd", state: UNHEARD } : { name, device, level: "bad", state: `silent for ${ago(device.silent_s)}` };
  }
  const odd = oddities(device, rate_hz);
  return { name, device, level: odd.length ? "odd" : "good", state: odd.length ? odd.join(", ") : "good" };
}

function oddities(device, rate_hz) {
  if (!device) return [];
  const found = [];
  if (rate_hz && device.rate_hz > 0 && device.rate_hz < SLOW_SHARE * rate_hz) found.push(`slow: ${decimals(device.rate_hz, 0)} of ${decimals(rate_hz, 0)} Hz`);
  if (device.lost_percent > LOSSY_PERCENT) found.push("loses packets");
  if (device.delay_ms > LATE_MS) found.push("late");
  if (device.battery_percent !== null && device.battery_percent < LOW_PERCENT) found.push("battery low");
  return found;
}
