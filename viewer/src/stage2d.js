// The same picture on a plain canvas, for browsers without WebGL: lines and flat faces, the far ones first.

import { ELLIPSOID_95 } from "./solids.js";
import { coloured } from "./palette.js";

const BEHIND_ALL_M = 1000;

export class FlatStage {
  constructor(canvas, view, figure, ghost) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.view = view;
    this.figure = figure;
    this.ghost = ghost;
  }

  recolour() {}

  dispose() {}

  resize(width, height, ratio) {
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    Object.assign(this, { width, height, ratio });
  }

  draw(time_s, ghost_s, magnified) {
    const { pen, view } = this;
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.fillStyle = view.colours.sky;
    pen.fillRect(0, 0, this.width, this.height);
    this.project = view.camera.projection(this.width, this.height);
    this.drawGround();
    const pieces = [...this.faces(time_s), ...this.limbs(this.figure, time_s, false)];
    if (this.ghost && ghost_s !== null) pieces.push(...this.limbs(this.ghost, ghost_s, true));
    pieces.sort((one, other) => other.depth - one.depth);
    for (const piece of pieces) piece.draw();
    if (magnified > 0) this.drawEllipses(this.figure, time_s, magnified);
  }

  drawGround() {
    const { camera, bounds, ground, colours } = this.view;
    const reach = 3 * Math.max(...bounds.half);
    const count = Math.floor(reach / ground.step_m);
    const height = ground.height_m - bounds.centre.reduce((sum, value, k) => sum + value * camera.up[k], 0);
    const at = (f, l) => bounds.centre.map((value, k) => value + height * camera.up[k] + f * camera.forward[k] + l * camera.left[k]);
    for (let k = -count; k <= count; k++) {
      const far = count * ground.step_m;
      this.line([at(k * ground.step_m, -far), at(k * ground.step_m, far)], 1, colours.grid);
      this.line([at(-far, k * ground.step_m), at(far, k * ground.step_m)], 1, colours.grid);
    }
  }

  limbs(figure, time_s, ghostly) {
    const places = figure.placesAt(time_s);
    const { colours, radius_m } = this.view;
    const point = (k) => [places[3 * k], places[3 * k + 1], places[3 * k + 2]];
    const found = [];
    const rod = (a, b, radius, colour) => {
      const ends = [point(a), point(b)];
      if (!ends.flat().every(Number.isFinite)) return;
      const [one, other] = ends.map(this.project);
      const width = Math.max(1.2, radius * (one[3] + other[3]));
      found.push({ depth: (one[2] + other[2]) / 2, draw: () => this.line(ends, width, ghostly ? colours.ghost : colour, ghostly ? 0.5 : 1) });
    };
    for (const strand of ghostly ? [] : figure.scene.strands) strand.points.slice(1).forEach((b, k) => rod(strand.points[k], b, strand.radius_m, colours.skin));
    for (const bone of figure.scene.bones) rod(...bone.ends, radius_m * (bone.moves ? 1 : 0.3), bone.moves ? coloured(colours, bone.side) : colours.frame);
    if (!ghostly) for (const loop of figure.scene.loops) rod(...loop.ends, radius_m, colours.loop);
    return found;
  }

  faces(time_s) {
    const { colours } = this.view;
    const light = [0.3, 0.8, 0.5];
    return this.figure.scene.shapes.flatMap((shape) => {
      const move = carried(this.figure.carrierAt(time_s, shape.carrier));
      const points = [];
      for (let i = 0; i < shape.vertices_mm.length; i += 3) points.push(move(shape.vertices_mm.slice(i, i + 3).map((value) => value / 1000)));
      if (!points.flat().every(Number.isFinite)) return [];
      const flat = points.map(this.project);
      const faces = [];
      for (let i = 0; i < shape.triangles.length; i += 3) {
        const corners = shape.triangles.slice(i, i + 3);
        const [a, b, c] = corners.map((k) => points[k]);
        const normal = cross(minus(b, a), minus(c, a));
        const shade = 0.72 + 0.28 * Math.abs(dot(normal, light) / (Math.hypot(...normal) * Math.hypot(...light) || 1));
        // a shell is larger than what stands in it: it is drawn first
        const depth = corners.reduce((sum, k) => sum + flat[k][2], 0) / 3 + (shape.part === "shell" ? BEHIND_ALL_M : 0);
        const colour = shaded(coloured(colours, shape.part, shape.part === "body" ? "skin" : shape.part), shade);
        faces.push({ depth, draw: () => this.face(corners.map((k) => flat[k]), colour) });
      }
      return faces;
    });
  }

  drawEllipses(figure, time_s, magnified) {
    const places = figure.placesAt(time_s);
    const { right, above } = this.view.camera.axes();
    for (const { point, factor } of figure.factorsAt(time_s)) {
      const [xx, yx, yy, zx, zy, zz] = factor;
      const [, , , size] = this.project([...places.slice(3 * point, 3 * point + 3)]);
      const [x, y] = this.project([...places.slice(3 * point, 3 * point + 3)]);
      if (!Number.isFinite(x + zz)) continue;
      const columns = [[xx, yx, zx], [0, yy, zy], [0, 0, zz]];
      const u = columns.map((column) => dot(column, right));
      const v = columns.map((column) => -dot(column, above));
      const [a, b, c] = [dot(u, u), dot(u, v), dot(v, v)];
      const middle = (a + c) / 2;
      const off = Math.hypot((a - c) / 2, b);
      const radii = [middle + off, Math.max(middle - off, 0)].map((value) => ELLIPSOID_95 * magnified * size * Math.sqrt(value));
      this.pen.beginPath();
      this.pen.ellipse(x, y, radii[0], radii[1], 0.5 * Math.atan2(2 * b, a - c), 0, 2 * Math.PI);
      this.pen.globalAlpha = 0.4;
      this.pen.fillStyle = this.view.colours.spread;
      this.pen.fill();
      this.pen.globalAlpha = 1;
    }
  }

  line(ends, width, colour, alpha = 1) {
    const [a, b] = ends.map(this.project);
    if (a[2] < 0.05 || b[2] < 0.05) return;
    const { pen } = this;
    pen.beginPath();
    pen.moveTo(a[0], a[1]);
    pen.lineTo(b[0], b[1]);
    Object.assign(pen, { lineWidth: width, strokeStyle: colour, lineCap: "round", globalAlpha: alpha });
    pen.stroke();
    pen.globalAlpha = 1;
  }

  face(corners, colour) {
    const { pen } = this;
    pen.beginPath();
    corners.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.closePath();
    Object.assign(pen, { fillStyle: colour, strokeStyle: colour, lineWidth: 0.8 });
    pen.fill();
    pen.stroke();
  }
}

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

function shaded(colour, share) {
  const value = parseInt(colour.slice(1), 16);
  return `rgb(${[16, 8, 0].map((shift) => Math.round(((value >> shift) & 255) * share)).join(" ")})`;
}

/** Takes a point of the carrier's axes to root axes. */
export function carried([x, y, z, qw, qx, qy, qz]) {
  return ([a, b, c]) => {
    const t = [2 * (qy * c - qz * b), 2 * (qz * a - qx * c), 2 * (qx * b - qy * a)];
    return [
      x + a + qw * t[0] + qy * t[2] - qz * t[1],
      y + b + qw * t[1] + qz * t[0] - qx * t[2],
      z + c + qw * t[2] + qx * t[1] - qy * t[0],
    ];
  };
}
