// Triangles, lines and a ground into memory, what is nearer in front: a picture in space without a graphics card.

/** Steps between the darkest and the brightest shade of a surface, and between near and hazy of a line. */
export const SHADES = 64;
const NEAREST_M = 0.02;

export class Raster {
  constructor(width, height) {
    Object.assign(this, { width, height });
    this.image = new ImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    /** One divided by the depth, 1/m; 0 where there is nothing. */
    this.near = new Float32Array(width * height);
    this.makeRoom(256);
  }

  makeRoom(count) {
    [this.x, this.y, this.z, this.s] = [0, 1, 2, 3].map(() => new Float32Array(count));
  }

  /** `eye`, `right`, `above`, `back` in m, and `scale`, px of what is 1 m large at 1 m. */
  begin(seen) {
    this.seen = seen;
    this.near.fill(0);
  }

  /** A surface: corners (x, y, z each) in its own axes, a matrix by columns to root axes, and its shades. */
  surface({ corners, normals, triangles }, matrix, light, shades) {
    this.lay(corners, normals, matrix, light);
    for (let k = 0; k < triangles.length; k += 3) this.triangle(triangles[k], triangles[k + 1], triangles[k + 2], shades);
  }

  /** Projects corners, and finds the shade of each: `light(x, y, z)` of a direction is between 0 and 1. */
  lay(corners, normals, matrix, light) {
    const { eye, right, above, back, scale } = this.seen;
    const count = corners.length / 3;
    if (count > this.x.length) this.makeRoom(2 * count);
    const across = row(right, matrix, eye, scale);
    const down = row(above, matrix, eye, -scale);
    const away = row(back, matrix, eye, -1);
    const [a, b, c, , d, e, f, , g, h, i] = matrix;
    for (let k = 0, at = 0; k < count; k++, at += 3) {
      const [px, py, pz] = [corners[at], corners[at + 1], corners[at + 2]];
      const depth = away[0] * px + away[1] * py + away[2] * pz + away[3];
      this.z[k] = depth > NEAREST_M ? 1 / depth : NaN;
      this.x[k] = this.width / 2 + (across[0] * px + across[1] * py + across[2] * pz + across[3]) / depth;
      this.y[k] = this.height / 2 + (down[0] * px + down[1] * py + down[2] * pz + down[3]) / depth;
      const [u, v, w] = [normals[at], normals[at + 1], normals[at + 2]];
      const [nx, ny, nz] = [a * u + d * v + g * w, b * u + e * v + h * w, c * u + f * v + i * w];
      const size = Math.sqrt(nx * nx + ny * ny + nz * nz) || 1;
      this.s[k] = (SHADES - 1) * light(nx / size, ny / size, nz / size);
    }
  }

  triangle(a, b, c, shades) {
    const { x, y, z, s, width } = this;
    const [bx, by, cx, cy] = [x[b] - x[a], y[b] - y[a], x[c] - x[a], y[c] - y[a]];
    const area = bx * cy - cx * by;
    // seen from behind, or a corner behind the eye
    if (!(area < 0) || !(z[a] + z[b] + z[c] > 0)) return;
    const zx = ((z[b] - z[a]) * cy - (z[c] - z[a]) * by) / area;
    const zy = ((z[c] - z[a]) * bx - (z[b] - z[a]) * cx) / area;
    const sx = ((s[b] - s[a]) * cy - (s[c] - s[a]) * by) / area;
    const sy = ((s[c] - s[a]) * bx - (s[b] - s[a]) * cx) / area;
    const [top, mid, low] = this.sorted(a, b, c);
    const end = Math.min(this.height, Math.ceil(y[low] - 0.5));
    for (let line = Math.max(0, Math.ceil(y[top] - 0.5)); line < end; line++) {
      const middle = line + 0.5;
      const one = this.crossing(top, low, middle);
      const other = middle < y[mid] ? this.crossing(top, mid, middle) : this.crossing(mid, low, middle);
      const from = Math.max(0, Math.ceil(Math.min(one, other) - 0.5));
      const count = Math.min(width, Math.ceil(Math.max(one, other) - 0.5)) - from;
      const dx = from + 0.5 - x[a];
      const dy = middle - y[a];
      this.span(line * width + from, count, z[a] + dx * zx + dy * zy, zx, s[a] + dx * sx + dy * sy, sx, shades);
    }
  }

  /** Corners from the top of the picture down. */
  sorted(a, b, c) {
    const { y } = this;
    const [one, other] = y[a] <= y[b] ? [a, b] : [b, a];
    if (y[c] < y[one]) return [c, one, other];
    return y[c] < y[other] ? [one, c, other] : [one, other, c];
  }

  crossing(p, q, middle) {
    const { x, y } = this;
    return x[p] + ((middle - y[p]) * (x[q] - x[p])) / (y[q] - y[p]);
  }

  span(at, count, z, zx, s, sx, shades) {
    const { near, pixels } = this;
    for (let k = 0; k < count; k++, at++, z += zx, s += sx) {
      if (z <= near[at]) continue;
      near[at] = z;
      pixels[at] = shades[s < 0 ? 0 : s > SHADES - 1 ? SHADES - 1 : s | 0];
    }
  }

  /** Behind and below all surfaces: `of(line)` gives a row's colour and 1/depth of the ground there, and its share. */
  ground(of) {
    const { width, height, near, pixels } = this;
    for (let line = 0, at = 0; line < height; line++) {
      const { colour, behind, z, share } = of(line);
      for (const end = at + width; at < end; at++) {
        if (near[at] === 0) pixels[at] = behind;
        else if (z > near[at]) pixels[at] = mixed(pixels[at], colour, share);
      }
    }
  }

  /** Lines between pairs of points (x, y, z each, m): `shades` from near to hazy, and the depths of both. */
  lines(ends, [from_m, to_m], shades) {
    const { eye, right, above, back, scale } = this.seen;
    const seen = (at) => {
      const [dx, dy, dz] = [ends[at] - eye[0], ends[at + 1] - eye[1], ends[at + 2] - eye[2]];
      const along = (axis) => dx * axis[0] + dy * axis[1] + dz * axis[2];
      return [scale * along(right), -scale * along(above), -along(back)];
    };
    for (let at = 0; at < ends.length; at += 6) {
      const found = cut(seen(at), seen(at + 3));
      if (found) this.line(...found, [from_m, to_m], shades);
    }
  }

  line(one, other, [from_m, to_m], shades) {
    const { width, height, near, pixels } = this;
    const [ax, ay, az] = [width / 2 + one[0] / one[2], height / 2 + one[1] / one[2], 1 / one[2]];
    const [bx, by, bz] = [width / 2 + other[0] / other[2], height / 2 + other[1] / other[2], 1 / other[2]];
    const steps = Math.ceil(Math.max(Math.abs(bx - ax), Math.abs(by - ay)));
    const [dx, dy] = [(bx - ax) / steps, (by - ay) / steps];
    const [first, end] = inside([ax, dx, width], [ay, dy, height], steps);
    for (let k = first; k < end; k++) {
      const z = az + ((bz - az) * k) / steps;
      const at = ((ay + k * dy) | 0) * width + ((ax + k * dx) | 0);
      const haze = (1 / z - from_m) / (to_m - from_m);
      if (haze < 1 && z > near[at]) pixels[at] = shades[haze > 0 ? (haze * SHADES) | 0 : 0];
    }
  }
}

/** A row of the matrix from own axes to the picture, with what is added. */
function row(axis, matrix, eye, scale) {
  const along = (k) => scale * (axis[0] * matrix[k] + axis[1] * matrix[k + 1] + axis[2] * matrix[k + 2]);
  const at = scale * (axis[0] * (matrix[12] - eye[0]) + axis[1] * (matrix[13] - eye[1]) + axis[2] * (matrix[14] - eye[2]));
  return [along(0), along(4), along(8), at];
}

/** The part of a line in front of the eye. */
function cut(one, other) {
  if (one[2] < NEAREST_M && other[2] < NEAREST_M) return null;
  const [near, far] = one[2] < other[2] ? [one, other] : [other, one];
  if (near[2] >= NEAREST_M) return [near, far];
  const share = (NEAREST_M - near[2]) / (far[2] - near[2]);
  return [near.map((value, k) => value + share * (far[k] - value)), far];
}

/** The steps of a line that are in the picture: from, and up to. */
function inside(...axes) {
  let [first, end] = [0, axes.pop()];
  for (const [start, step, size] of axes) {
    if (step === 0) {
      if (start < 0 || start >= size) return [0, 0];
      continue;
    }
    const [one, other] = [-start / step, (size - start) / step];
    first = Math.max(first, Math.ceil(Math.min(one, other)));
    end = Math.min(end, Math.floor(Math.max(one, other)));
  }
  return [first, end];
}

export const packed = (red, green, blue) => (0xff000000 | (blue << 16) | (green << 8) | red) >>> 0;

/** A packed colour with a share of another over it. */
export function mixed(below, over, share) {
  const part = (shift) => Math.round(((below >>> shift) & 255) * (1 - share) + ((over >>> shift) & 255) * share);
  return packed(part(0), part(8), part(16));
}
