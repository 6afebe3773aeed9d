// Reads what oarlock.report.viewer.packing wrote, and looks values up between samples.

function bytes(text) {
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out.buffer;
}

export function times(packet) {
  return new Float64Array(bytes(packet.data));
}

const MISSING = -32768;

/** Values by row: `table.values[row * table.columns + column]`; NaN is missing. Columns of scale 0 have no steps. */
export function table(packet) {
  const steps = new Int16Array(bytes(packet.data));
  const { rows, scale, offset } = packet;
  const columns = scale.length;
  const values = new Float32Array(rows * columns);
  let next = 0;
  for (let row = 0; row < rows; row++) {
    for (let k = 0; k < columns; k++) {
      const step = scale[k] === 0 ? 0 : steps[next++];
      values[row * columns + k] = step === MISSING ? NaN : offset[k] + scale[k] * step;
    }
  }
  return { values, columns, rows };
}

/** Where a time lies between samples: row, and share of the way to the next one. Before and behind: the ends. */
export function locate(time_s, at) {
  const last = time_s.length - 1;
  if (!(at > time_s[0])) return { row: 0, share: 0 };
  if (at >= time_s[last]) return { row: last, share: 0 };
  let low = 0;
  let high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time_s[middle] <= at) low = middle;
    else high = middle;
  }
  return { row: low, share: (at - time_s[low]) / (time_s[high] - time_s[low]) };
}

/** One value between two rows; where one of them is missing, the nearer one decides. */
export function between(data, place, column) {
  const here = data.values[place.row * data.columns + column];
  if (place.share === 0) return here;
  const next = data.values[(place.row + 1) * data.columns + column];
  const value = here + place.share * (next - here);
  return Number.isNaN(value) ? (place.share < 0.5 ? here : next) : value;
}
