// A camera that circles a centre: shared by the picture in space and by the flat one.

const FIELD_OF_VIEW_RAD = (32 * Math.PI) / 180;
const HIGHEST_RAD = 0.999 * (Math.PI / 2);

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const plus = (a, b, scale = 1) => [a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]];
const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));

export class Camera {
  /** `up` and `forward` in root axes; azimuth counts from forward, right-handed about up. */
  constructor(up, forward) {
    this.up = unit(up);
    this.forward = unit(plus(forward, this.up, -dot(forward, this.up)));
    this.left = cross(this.up, this.forward);
    this.azimuth = -Math.PI / 2;
    this.elevation = 0.1;
    this.centre = [0, 0, 0];
    this.half = [1, 1, 1];
    this.zoom = 1;
    this.aspect = 1.6;
  }

  lookAt(bounds) {
    this.centre = bounds.centre;
    this.half = bounds.half.map((value) => Math.max(value, 0.05));
  }

  /** A preset: the direction from the figure to the eye. */
  seenFrom(direction, zoom = 1) {
    const [x, y, z] = [dot(direction, this.forward), dot(direction, this.left), dot(direction, this.up)];
    const flat = Math.hypot(x, y);
    // straight from above, forward points to the right of the picture
    this.azimuth = flat > 1e-6 ? Math.atan2(y, x) : -Math.PI / 2;
    this.elevation = Math.max(-HIGHEST_RAD, Math.min(HIGHEST_RAD, Math.atan2(z, flat)));
    this.zoom = zoom;
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.max(-HIGHEST_RAD, Math.min(HIGHEST_RAD, this.elevation + elevation));
  }

  closer(factor) {
    this.zoom = Math.max(0.25, Math.min(6, this.zoom * factor));
  }

  /** Axes of the picture in root axes: `right`, `above`, and `back` towards the eye. */
  axes() {
    const level = plus(plus([0, 0, 0], this.forward, Math.cos(this.azimuth)), this.left, Math.sin(this.azimuth));
    const back = unit(plus(level.map((value) => value * Math.cos(this.elevation)), this.up, Math.sin(this.elevation)));
    const right = unit(cross(this.up, back));
    return { right, above: cross(back, right), back };
  }

  /** How far the eye is from the centre so that the box of the figure fills the picture, m. */
  distance() {
    const { right, above, back } = this.axes();
    const reach = (axis) => Math.abs(axis[0]) * this.half[0] + Math.abs(axis[1]) * this.half[1] + Math.abs(axis[2]) * this.half[2];
    const slope = Math.tan(FIELD_OF_VIEW_RAD / 2);
    const fit = Math.max(reach(above) / slope, reach(right) / (slope * this.aspect));
    return (1.12 * fit + reach(back)) / this.zoom;
  }

  eye() {
    return plus(this.centre, this.axes().back, this.distance());
  }

  /** For a flat picture of this size: root point -> [x, y, depth], px and m. */
  projection(width, height) {
    const { right, above, back } = this.axes();
    const distance = this.distance();
    const scale = height / 2 / Math.tan(FIELD_OF_VIEW_RAD / 2);
    return (point) => {
      const away = plus(point, this.centre, -1);
      const depth = distance - dot(away, back);
      const size = scale / Math.max(depth, 1e-3);
      return [width / 2 + size * dot(away, right), height / 2 - size * dot(away, above), depth, size];
    };
  }

  get fieldOfViewDeg() {
    return (FIELD_OF_VIEW_RAD * 180) / Math.PI;
  }
}
