// The ground below a figure: how far it reaches, and its lines.

const REACH = 14;
const MOST_LINES = 60;

/** From the figure to the ground's edge, m. */
export const groundReach = ({ bounds }) => REACH * Math.max(...bounds.half);

/** Ends (x, y, z each, m) of lines half a metre apart where the figure is that large, a power of ten finer where it is smaller. */
export function groundLines({ camera, ground, bounds, radius_m }, reach) {
  const step = ground.step_m;
  const count = Math.min(MOST_LINES, Math.floor(reach / step));
  const along = (axis) => axis.reduce((sum, value, k) => sum + value * bounds.centre[k], 0);
  const lift = ground.height_m - along(camera.up) + 0.02 * radius_m + 0.001;
  const origin = bounds.centre.map((value, k) => value + lift * camera.up[k]);
  const offset = (axis) => Math.round(along(axis) / step) * step - along(axis);
  const [f0, l0] = [offset(camera.forward), offset(camera.left)];
  const at = (f, l) => origin.map((value, k) => value + f * camera.forward[k] + l * camera.left[k]);
  const ends = [];
  for (let k = -count; k <= count; k++) {
    ends.push(...at(f0 + k * step, l0 - count * step), ...at(f0 + k * step, l0 + count * step));
    ends.push(...at(f0 - count * step, l0 + k * step), ...at(f0 + count * step, l0 + k * step));
  }
  return new Float32Array(ends);
}
