// The figure's solids in space: limbs, joints, loops, strands, carried shapes and ellipsoids.

import { BufferAttribute, BufferGeometry, CylinderGeometry, Group, Matrix4, Mesh, MeshLambertMaterial, Quaternion, SphereGeometry, Vector3 } from "three";

import { coloured } from "./palette.js";

/** What a figure is made of: shapes of limbs and joints, and their surface. */
const FINE = {
  rod: new CylinderGeometry(1, 1, 1, 16, 1, true).translate(0, 0.5, 0),
  ball: new SphereGeometry(1, 20, 14),
  material: (look) => new MeshLambertMaterial(look),
};
const UP = new Vector3(0, 1, 0);
/** A 95 % ellipsoid of a point in space: sqrt of the 95 % quantile of chi-squared with 3 degrees of freedom. */
export const ELLIPSOID_95 = 2.7955;
/** A loop whose sides are further apart is drawn as open, m. */
const OPEN_M = 0.002;
const LOOP_SHARE = 1.42;
const FIXED_SHARE = 0.3;

const direction = new Vector3();
const turn = new Quaternion();
const start = new Vector3();
const size = new Vector3();

/** Lays a rod from one point to another; hides it where one of them is unknown. */
function layRod(rod, places, a, b, radius) {
  start.fromArray(places, 3 * a);
  direction.fromArray(places, 3 * b).sub(start);
  const length = direction.length();
  rod.visible = length > 1e-6;
  if (!rod.visible) return;
  turn.setFromUnitVectors(UP, direction.divideScalar(length));
  rod.matrix.compose(start, turn, size.set(radius, length, radius));
}

function mesh(geometry, material, shadow = true) {
  const made = new Mesh(geometry, material);
  made.matrixAutoUpdate = false;
  made.frustumCulled = false;
  made.castShadow = shadow;
  return made;
}

export class Solids {
  /** `ghostly` leaves colours out and lets light through. */
  constructor(figure, radius_m, colours, ghostly = false, stuff = FINE) {
    this.stuff = stuff;
    this.figure = figure;
    this.radius_m = radius_m;
    this.colours = colours;
    this.ghostly = ghostly;
    this.group = new Group();
    this.materials = new Map();
    this.places = new Float32Array(3 * figure.points.length);
    this.magnified = 0;
    this.addLimbs();
    this.strands = [];
    if (!ghostly) this.addSurroundings();
    this.addEllipsoids();
  }

  material(side, part) {
    const colour = this.ghostly ? this.colours.ghost : coloured(this.colours, side, part);
    if (!this.materials.has(colour)) {
      const see = this.ghostly ? { transparent: true, opacity: 0.42 } : {};
      this.materials.set(colour, this.stuff.material({ color: colour, ...see }));
    }
    return this.materials.get(colour);
  }

  add(made) {
    this.group.add(made);
    return made;
  }

  addLimbs() {
    const { bones, loops } = this.figure.scene;
    this.rods = bones.map((bone) => ({
      ends: bone.ends,
      radius: this.radius_m * (bone.moves ? 1 : FIXED_SHARE),
      solid: this.add(mesh(this.stuff.rod, this.material(bone.moves ? bone.side : "", bone.moves ? "body" : "frame"), !this.ghostly)),
    }));
    const thick = new Map();
    for (const rod of this.rods) for (const end of rod.ends) if ((thick.get(end)?.radius ?? 0) < rod.radius) thick.set(end, rod);
    this.joints = [...thick].map(([point, rod]) => ({ point, radius: rod.radius * (rod.radius === this.radius_m ? 1.3 : 1), solid: this.add(mesh(this.stuff.ball, rod.solid.material, !this.ghostly)) }));
    this.loops = this.ghostly ? [] : loops.map((loop) => ({ ends: loop.ends, ball: this.add(mesh(this.stuff.ball, this.material("", "loop"))), rod: this.add(mesh(this.stuff.rod, this.material("", "loop"))) }));
  }

  addSurroundings() {
    this.addStrands();
    this.addShapes();
  }

  addStrands() {
    this.strands = this.figure.scene.strands.flatMap((strand) =>
      strand.points.map((point, k) => ({
        point,
        before: k ? strand.points[k - 1] : null,
        radius: strand.radius_m,
        ball: this.add(mesh(this.stuff.ball, this.material("", strand.part === "body" ? "skin" : strand.part))),
        rod: k ? this.add(mesh(this.stuff.rod, this.material("", strand.part === "body" ? "skin" : strand.part))) : null,
      })),
    );
  }

  addShapes() {
    this.shapes = this.figure.scene.shapes.map((shape) => {
      let geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(Float32Array.from(shape.vertices_mm, (value) => value / 1000), 3));
      geometry.setIndex(shape.triangles);
      if (shape.part === "body" || shape.part === "shell") geometry.computeVertexNormals();
      else (geometry = geometry.toNonIndexed()).computeVertexNormals();
      const side = shape.part === "right" || shape.part === "left" ? shape.part : "";
      const solid = this.add(mesh(geometry, this.material(side, shape.part === "body" ? "skin" : shape.part)));
      return { carrier: shape.carrier, solid };
    });
  }

  addEllipsoids() {
    const spread = this.figure.scene.spread;
    const material = new MeshLambertMaterial({ color: this.ghostly ? this.colours.ghost : this.colours.spread, transparent: true, opacity: 0.4, depthWrite: false, depthTest: false });
    this.ellipsoids = (spread?.points ?? []).map(() => this.add(mesh(this.stuff.ball, material, false)));
  }

  showAt(time_s) {
    this.figure.placesAt(time_s, this.places);
    for (const rod of this.rods) layRod(rod.solid, this.places, ...rod.ends, rod.radius);
    for (const joint of this.joints) this.layBall(joint.solid, joint.point, joint.radius);
    for (const loop of this.loops) this.layLoop(loop);
    for (const strand of this.strands) {
      this.layBall(strand.ball, strand.point, strand.radius);
      if (strand.rod) layRod(strand.rod, this.places, strand.before, strand.point, strand.radius);
    }
    for (const shape of this.shapes ?? []) this.layShape(shape, time_s);
    this.layEllipsoids(time_s);
  }

  layBall(ball, point, radius) {
    start.fromArray(this.places, 3 * point);
    ball.visible = Number.isFinite(start.x + start.y + start.z);
    if (ball.visible) ball.matrix.makeScale(radius, radius, radius).setPosition(start);
  }

  layLoop(loop) {
    const [a, b] = loop.ends;
    this.layBall(loop.ball, a, this.radius_m * LOOP_SHARE);
    layRod(loop.rod, this.places, a, b, this.radius_m * FIXED_SHARE);
    loop.rod.visible = loop.rod.visible && direction.fromArray(this.places, 3 * a).distanceTo(start.fromArray(this.places, 3 * b)) > OPEN_M;
  }

  layShape(shape, time_s) {
    const [x, y, z, qw, qx, qy, qz] = this.figure.carrierAt(time_s, shape.carrier);
    shape.solid.visible = Number.isFinite(x + qw);
    shape.solid.matrix.compose(start.set(x, y, z), turn.set(qx, qy, qz, qw), size.set(1, 1, 1));
  }

  layEllipsoids(time_s) {
    const shown = this.magnified > 0 ? this.figure.factorsAt(time_s) : [];
    this.ellipsoids.forEach((solid, k) => {
      const { point, factor } = shown[k] ?? {};
      start.fromArray(this.places, 3 * (point ?? 0));
      solid.visible = factor !== undefined && Number.isFinite(factor[5] + start.x);
      if (!solid.visible) return;
      const [xx, yx, yy, zx, zy, zz] = factor.map((value) => ELLIPSOID_95 * this.magnified * value);
      solid.matrix.copy(new Matrix4().set(xx, 0, 0, start.x, yx, yy, 0, start.y, zx, zy, zz, start.z, 0, 0, 0, 1));
    });
  }
}
