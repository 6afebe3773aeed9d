// The body of a running session: its points and carried frames in the newest frame. The stages draw it like any Figure.

const STEP_S = 0.25;
/** The camera shows where the figure has been for so long. */
const WINDOW_S = 10;

export class LiveFigure {
  constructor(structure) {
    this.scene = structure;
    this.points = structure.points;
    this.moving = this.points.flatMap((point, k) => (point.still ? [] : [k]));
    this.places = Float32Array.from(this.points.flatMap((point) => point.still ?? [NaN, NaN, NaN]));
    this.turns = [];
    this.boxes = [];
  }

  get isKnown() {
    return this.boxes.length > 0;
  }

  take(frame) {
    this.moving.forEach((point, k) => {
      for (let axis = 0; axis < 3; axis++) this.places[3 * point + axis] = frame.places_mm[3 * k + axis] / 1000;
    });
    this.turns = frame.turns;
    const last = this.boxes.at(-1);
    if (last && Math.abs(frame.time_s - last.time_s) < STEP_S) return;
    this.boxes.push({ time_s: frame.time_s, ...boxOf(this.places) });
    while (this.boxes.length > WINDOW_S / STEP_S) this.boxes.shift();
  }

  placesAt(time_s, out = new Float32Array(this.places.length)) {
    out.set(this.places);
    return out;
  }

  /** Pose of a carrying frame: [x, y, z, qw, qx, qy, qz]. */
  carrierAt(time_s, carrier) {
    const origin = 3 * this.scene.carriers.points[carrier];
    return [...this.places.subarray(origin, origin + 3), ...quaternion(this.turns.slice(9 * carrier, 9 * carrier + 9))];
  }

  factorsAt() {
    return [];
  }

  /** A box around the points over the last seconds, for the camera: centre and half size, m. */
  bounds() {
    const boxes = this.boxes.length ? this.boxes : [boxOf(this.places)];
    const low = [0, 1, 2].map((axis) => Math.min(...boxes.map((box) => box.low[axis])));
    const high = [0, 1, 2].map((axis) => Math.max(...boxes.map((box) => box.high[axis])));
    return { low, high, centre: low.map((value, k) => (value + high[k]) / 2), half: low.map((value, k) => (high[k] - value) / 2) };
  }
}

function boxOf(places) {
  const low = [0, 0, 0];
  const high = [0, 0, 0];
  for (let axis = 0; axis < 3; axis++) {
    const values = places.filter((value, k) => k % 3 === axis && Number.isFinite(value));
    if (values.length) [low[axis], high[axis]] = [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
  }
  return { low, high };
}

/** Of a rotation as rows of its matrix; not a number where there is none. */
export function quaternion([a, b, c, d, e, f, g, h, i]) {
  const squares = [1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i];
  const largest = squares.indexOf(Math.max(...squares));
  const found = [
    [squares[0], h - f, c - g, d - b],
    [h - f, squares[1], b + d, c + g],
    [c - g, b + d, squares[2], f + h],
    [d - b, c + g, f + h, squares[3]],
  ][Math.max(largest, 0)];
  const norm = Math.hypot(...found);
  return found.map((value) => value / norm);
}
