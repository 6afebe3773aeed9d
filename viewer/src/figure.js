// The body of a scene at any time: its points, its carried frames, its ellipsoids.

import { between, locate, table, times } from "./unpack.js";

const STATES_OF_ELLIPSOID = 6;

export class Figure {
  constructor(scene) {
    this.scene = scene;
    this.time_s = times(scene.time_s);
    this.places = table(scene.places_m);
    this.turns = table(scene.carriers.quat_wxyz);
    this.points = scene.points;
    let column = 0;
    this.columns = this.points.map((point) => (point.still ? -1 : (column += 3) - 3));
    if (scene.spread) {
      this.spreadTime_s = times(scene.spread.time_s);
      this.factors = table(scene.spread.factors_m);
    }
    this.byName = new Map();
    this.points.forEach((point, k) => [point.name, ...point.frames].forEach((name) => this.byName.has(name) || this.byName.set(name, k)));
  }

  get start_s() {
    return this.time_s[0];
  }

  get end_s() {
    return this.time_s[this.time_s.length - 1];
  }

  /** Coordinates of all points one behind the other, m in root axes; NaN where unknown. */
  placesAt(time_s, out = new Float32Array(3 * this.points.length)) {
    const place = locate(this.time_s, time_s);
    this.points.forEach((point, k) => {
      for (let axis = 0; axis < 3; axis++) {
        out[3 * k + axis] = point.still ? point.still[axis] : between(this.places, place, this.columns[k] + axis);
      }
    });
    return out;
  }

  /** Pose of a carrying frame: [x, y, z, qw, qx, qy, qz], the quaternion of unit length. */
  carrierAt(time_s, carrier) {
    const place = locate(this.time_s, time_s);
    const origin = this.scene.carriers.points[carrier];
    const still = this.points[origin].still;
    const at = still ?? [0, 1, 2].map((axis) => between(this.places, place, this.columns[origin] + axis));
    const quat = [0, 1, 2, 3].map((k) => between(this.turns, place, 4 * carrier + k));
    const norm = Math.hypot(...quat);
    return [...at, ...quat.map((value) => value / norm)];
  }

  /** Lower factors [xx, yx, yy, zx, zy, zz], m, of the covariances of the points that have one. */
  factorsAt(time_s) {
    if (!this.factors) return [];
    const place = locate(this.spreadTime_s, time_s);
    return this.scene.spread.points.map((point, k) => ({
      point,
      factor: Array.from({ length: STATES_OF_ELLIPSOID }, (_, i) => between(this.factors, place, STATES_OF_ELLIPSOID * k + i)),
    }));
  }

  /** A box around all points over all times, for the camera: centre and half size, m. */
  bounds() {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    const take = (axis, value) => {
      if (value < low[axis]) low[axis] = value;
      if (value > high[axis]) high[axis] = value;
    };
    this.points.forEach((point, k) => {
      for (let axis = 0; axis < 3; axis++) {
        if (point.still) take(axis, point.still[axis]);
        else for (let row = 0; row < this.places.rows; row++) take(axis, this.places.values[row * this.places.columns + this.columns[k] + axis]);
      }
    });
    const centre = low.map((value, axis) => (Number.isFinite(value) ? (value + high[axis]) / 2 : 0));
    const half = low.map((value, axis) => (Number.isFinite(value) ? (high[axis] - value) / 2 : 0));
    return { centre, half, low, high };
  }
}
