// The figure where no graphics card draws it: this page's own triangles, in a third of the time that WebGL would take.

import { Color, CylinderGeometry, SphereGeometry } from "three";

import { groundLines, groundReach } from "../ground.js";
import { Solids } from "../solids.js";
import { Raster, SHADES, mixed, packed } from "./raster.js";

const WATER_SHARE = 0.82;
/** Light from the sky, from all sides, and of the sun; together at most `BRIGHTEST`. */
const [SKY, AROUND, SUN] = [1.55, 0.25, 1.7];
const FROM_BELOW = 0.43;
const BRIGHTEST = SKY + AROUND + SUN;
const STUFF = {
  rod: new CylinderGeometry(1, 1, 1, 8, 1, true).translate(0, 0.5, 0),
  ball: new SphereGeometry(1, 10, 7),
  material: ({ color }) => ({ shades: shadesOf(color), dispose() {} }),
};

export class SoftStage {
  constructor(canvas, view, figure) {
    Object.assign(this, { canvas, view, figure, surfaces: new Map() });
    this.pen = canvas.getContext("2d", { alpha: false, willReadFrequently: true });
    this.recolour();
  }

  /** Everything again in today's colours, and the ground where the figure is now. */
  recolour() {
    const { camera, colours, ground, radius_m } = this.view;
    this.solids = new Solids(this.figure, radius_m, colours, false, STUFF);
    this.lines = groundLines(this.view, groundReach(this.view));
    const water = ground.kind === "water";
    this.colours = { sky: packedOf(colours.sky), ground: packedOf(water ? colours.water : colours.ground), share: water ? WATER_SHARE : 1 };
    const line = packedOf(water ? colours.wave : colours.grid);
    this.lineShades = Uint32Array.from({ length: SHADES }, (_, k) => mixed(line, this.colours.sky, smooth(k / SHADES)));
    this.light = lightOf(camera);
  }

  resize(width, height, ratio) {
    this.canvas.width = Math.max(1, Math.round(width * ratio));
    this.canvas.height = Math.max(1, Math.round(height * ratio));
    this.raster = new Raster(this.canvas.width, this.canvas.height);
  }

  draw(time_s) {
    const { raster, solids } = this;
    solids.showAt(time_s);
    raster.begin(this.seen());
    for (const solid of solids.group.children) if (solid.visible && solid.material.shades) raster.surface(this.surface(solid.geometry), solid.matrix.elements, this.light, solid.material.shades);
    const distance = this.view.camera.distance();
    const haze = [1.1 * distance, 3.2 * distance + 2];
    raster.ground(this.groundAt(haze));
    raster.lines(this.lines, haze, this.lineShades);
    this.pen.putImageData(raster.image, 0, 0);
  }

  seen() {
    const { camera } = this.view;
    const scale = this.canvas.height / 2 / Math.tan((camera.fieldOfViewDeg * Math.PI) / 360);
    return { eye: camera.eye(), ...camera.axes(), scale };
  }

  /** The ground in each row of the picture: the camera stands upright, so its depth is the same along a row. */
  groundAt([from_m, to_m]) {
    const { camera, ground } = this.view;
    const { eye, above, back, scale } = this.raster.seen;
    const along = (axis) => axis.reduce((sum, value, k) => sum + value * camera.up[k], 0);
    const height_m = along(eye) - ground.height_m;
    return (line) => {
      const rise = ((this.canvas.height / 2 - line - 0.5) / scale) * along(above) - along(back);
      const depth_m = -height_m / rise;
      if (!(depth_m > 0)) return { behind: this.colours.sky, colour: 0, z: 0, share: 0 };
      const colour = mixed(this.colours.ground, this.colours.sky, smooth((depth_m - from_m) / (to_m - from_m)));
      return { behind: mixed(this.colours.sky, colour, this.colours.share), colour, z: 1 / depth_m, share: this.colours.share };
    };
  }

  /** Corners, normals and triangles of a shape. */
  surface(geometry) {
    if (!this.surfaces.has(geometry)) {
      const corners = geometry.getAttribute("position").array;
      const triangles = geometry.index?.array ?? Uint32Array.from({ length: corners.length / 3 }, (_, k) => k);
      this.surfaces.set(geometry, { corners, normals: geometry.getAttribute("normal").array, triangles });
    }
    return this.surfaces.get(geometry);
  }

  dispose() {}
}

const packedOf = (colour) => packed(...[16, 8, 0].map((shift) => (parseInt(colour.slice(1), 16) >> shift) & 255));

const smooth = (share) => {
  const within = Math.min(1, Math.max(0, share));
  return within * within * (3 - 2 * within);
};

/** From dark to bright. */
function shadesOf(colour) {
  const parts = new Color(colour).toArray();
  return Uint32Array.from({ length: SHADES }, (_, k) => {
    const light = (BRIGHTEST * k) / (SHADES - 1) / Math.PI;
    return packed(...parts.map((part) => Math.min(255, Math.round(255 * (part * light) ** (1 / 2.2)))));
  });
}

/** How bright a surface is that looks in a direction, from 0 to 1. */
function lightOf({ up, left, forward }) {
  const sun = up.map((value, k) => 3 * value - 1.1 * left[k] + 0.9 * forward[k]);
  const size = Math.hypot(...sun);
  const [sx, sy, sz] = sun.map((value) => value / size);
  const [ux, uy, uz] = up;
  return (x, y, z) => {
    const open = 0.5 + 0.5 * (x * ux + y * uy + z * uz);
    const lit = Math.max(0, x * sx + y * sy + z * sz);
    return (SKY * (FROM_BELOW + (1 - FROM_BELOW) * open) + AROUND + SUN * lit) / BRIGHTEST;
  };
}
