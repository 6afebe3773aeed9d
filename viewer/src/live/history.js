// The last half minute of all joints, in memory that does not grow.

export const LONGEST_S = 30;
const ROWS = 60 * (LONGEST_S + 10);

export class History {
  constructor(joints) {
    this.joints = joints;
    this.column = new Map(joints.map((joint, k) => [joint.name, k]));
    this.time_s = new Float64Array(ROWS);
    this.value = joints.map(() => new Float32Array(ROWS));
    this.std = joints.map(() => new Float32Array(ROWS));
    this.count = 0;
  }

  get newest_s() {
    return this.count ? this.time_s[(this.count - 1) % ROWS] : NaN;
  }

  take(frame) {
    // tracking was started again: what is older belongs to another track
    if (frame.time_s <= this.newest_s) this.count = 0;
    const row = this.count % ROWS;
    this.time_s[row] = frame.time_s;
    this.joints.forEach(({ name, scale }, k) => {
      const [value, std] = frame.joints[name] ?? frame.angles?.[name] ?? [null, null];
      this.value[k][row] = value === null ? NaN : scale * value;
      this.std[k][row] = std === null ? NaN : scale * std;
    });
    this.count += 1;
  }

  /** Rows of the last `span_s`, oldest first: calls `row(time_s, value, std)`. */
  each(name, span_s, row) {
    const k = this.column.get(name);
    let first = this.count;
    const oldest = Math.max(0, this.count - ROWS);
    while (first > oldest && this.time_s[(first - 1) % ROWS] >= this.newest_s - span_s) first -= 1;
    for (let at = first; at < this.count; at++) row(this.time_s[at % ROWS], this.value[k][at % ROWS], this.std[k][at % ROWS]);
  }

  /** Value and standard deviation of the newest frame, in the shown unit. */
  latest(name) {
    const k = this.column.get(name);
    const row = (this.count - 1) % ROWS;
    return this.count ? [this.value[k][row], this.std[k][row]] : [NaN, NaN];
  }
}
