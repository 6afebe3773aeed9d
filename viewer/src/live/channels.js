// What devices send beside the sensors' readings, such as boat speed and heart rate: the newest values, in words.

import { element } from "../dom.js";
import { ago, decimals } from "./numbers.js";

/** Endings of names -> unit; a longer ending comes before one that it contains. */
const UNITS = [["_s_per_500_m", "/500 m"], ["_kcal_per_h", "kcal/h"], ["_kcal_per_min", "kcal/min"], ["_per_min", "/min"], ["_m_s2", "m/s²"], ["_m_s", "m/s"], ["_rad_s", "rad/s"], ["_percent", "%"], ["_kcal", "kcal"], ["_deg", "°"], ["_rad", "rad"], ["_ut", "µT"], ["_hpa", "hPa"], ["_dbm", "dBm"], ["_mm", "mm"], ["_w", "W"], ["_n", "N"], ["_j", "J"], ["_c", "°C"], ["_v", "V"], ["_m", "m"], ["_s", "s"]];
/** Strokes come every few seconds. */
export const SILENT_S = 5;
const PLACES = 6;

/** A value as its label and its text: `speed_m_s`, 4.2 is "speed", "4.2 m/s". */
export function words(name, value) {
  const [ending, unit] = UNITS.find(([one]) => name.endsWith(one)) ?? ["", ""];
  const label = name.slice(0, name.length - ending.length).replaceAll("_", " ");
  if (typeof value !== "number") return [label, value];
  if (unit === "/500 m") return [label, `${minutes(value)} ${unit}`];
  const digits = /(latitude|longitude)$/.test(label) ? PLACES : Number.isInteger(value) ? 0 : Math.abs(value) >= 100 ? 0 : 2;
  return [label, `${decimals(value, digits)}${unit && unit !== "°" ? " " : ""}${unit}`];
}

function minutes(seconds) {
  const tenths = Math.round(10 * seconds);
  const rest = (tenths % 600) / 10;
  return `${Math.floor(tenths / 600)}:${rest < 10 ? "0" : ""}${rest.toFixed(1)}`;
}

export class Channels {
  constructor() {
    this.groups = new Map();
    this.root = element("section", { class: "ol-channels", "aria-label": "Recorded beside the sensors", hidden: true });
  }

  take(devices) {
    const shown = devices.filter((device) => Object.keys(device.values ?? {}).length);
    const keys = new Set(shown.map(keyOf));
    for (const device of shown) this.group(device);
    for (const [key, { root }] of this.groups) if (!keys.has(key)) root.remove(), this.groups.delete(key);
    this.root.hidden = shown.length === 0;
  }

  group(device) {
    const key = keyOf(device);
    if (!this.groups.has(key)) {
      const head = element("h3", {});
      const list = element("dl", {});
      const root = element("div", {}, head, list);
      this.root.append(root);
      this.groups.set(key, { root, head, list, rows: new Map() });
    }
    const { root, head, list, rows } = this.groups.get(key);
    const isOld = device.silent_s > SILENT_S;
    write(head, `${device.channel}${isOld ? `, silent for ${ago(device.silent_s)}` : ""}`);
    root.classList.toggle("ol-odd", isOld);
    for (const [name, value] of Object.entries(device.values)) {
      const [label, text] = words(name, value);
      if (!rows.has(name)) rows.set(name, addRow(list, label));
      write(rows.get(name), text);
    }
  }
}

const keyOf = (device) => `${device.channel} ${device.name}`;

const write = (place, text) => place.textContent === text || (place.textContent = text);

function addRow(list, label) {
  const place = element("dd", {});
  list.append(element("div", {}, element("dt", { text: label }), place));
  return place;
}
