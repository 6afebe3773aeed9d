// The picture in space, drawn by three.js.

import { AmbientLight, BufferAttribute, BufferGeometry, CircleGeometry, Color, DirectionalLight, Fog, HemisphereLight, LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, PCFShadowMap, PerspectiveCamera, Quaternion, Scene, Vector3, WebGLRenderer } from "three";

import { groundLines, groundReach } from "./ground.js";
import { Solids } from "./solids.js";

const SHADOW_PX = 1024;

export class SpaceStage {
  /** Throws where the browser has no WebGL. `isQuick` leaves out shadows, smooth edges and a copy for print. */
  constructor(canvas, view, figure, ghost, isQuick = false) {
    this.renderer = new WebGLRenderer({ canvas, antialias: !isQuick, preserveDrawingBuffer: !isQuick, powerPreference: "low-power" });
    this.renderer.shadowMap.enabled = !isQuick;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.canvas = canvas;
    this.view = view;
    this.figure = figure;
    this.ghost = ghost;
    this.eye = new PerspectiveCamera(view.camera.fieldOfViewDeg, 1, 0.02, 500);
    this.eye.up.fromArray(view.camera.up);
    this.recolour();
  }

  /** Everything again in today's colours: the page may turn dark, or be printed. */
  recolour() {
    const { colours, radius_m } = this.view;
    this.clear();
    this.world = new Scene();
    this.world.background = new Color(colours.sky);
    this.solids = new Solids(this.figure, radius_m, colours);
    this.world.add(this.solids.group);
    this.ghostSolids = this.ghost && new Solids(this.ghost, radius_m, colours, true);
    if (this.ghostSolids) this.world.add(this.ghostSolids.group);
    this.addLights();
    this.addGround();
  }

  /** Frees what the last colours had on the graphics card. */
  clear() {
    this.world?.traverse((thing) => {
      thing.geometry?.dispose();
      thing.material?.dispose();
      thing.shadow?.dispose();
    });
  }

  addLights() {
    const { camera, bounds } = this.view;
    const up = new Vector3().fromArray(camera.up);
    const sky = new HemisphereLight(0xffffff, 0xa8b0ba, 1.55);
    sky.position.copy(up);
    const sun = new DirectionalLight(0xffffff, 1.7);
    const size = Math.max(...bounds.half) * 1.5;
    const centre = new Vector3().fromArray(bounds.centre);
    const side = new Vector3().fromArray(camera.left).multiplyScalar(-0.55).addScaledVector(new Vector3().fromArray(camera.forward), 0.45);
    sun.position.copy(centre).addScaledVector(up, 3 * size).addScaledVector(side, 2 * size);
    sun.target.position.copy(centre);
    sun.castShadow = true;
    sun.shadow.mapSize.set(SHADOW_PX, SHADOW_PX);
    sun.shadow.bias = -0.0004;
    sun.shadow.normalBias = 0.01;
    Object.assign(sun.shadow.camera, { left: -size, right: size, top: size, bottom: -size, near: 0.1 * size, far: 8 * size });
    this.world.add(sky, sun, sun.target, new AmbientLight(0xffffff, 0.25));
  }

  addGround() {
    const { camera, bounds, ground, colours } = this.view;
    const reach = groundReach(this.view);
    const water = ground.kind === "water";
    const plane = new Mesh(new CircleGeometry(reach, 64), new MeshLambertMaterial({ color: water ? colours.water : colours.ground, transparent: water, opacity: water ? 0.82 : 1 }));
    plane.receiveShadow = true;
    const up = new Vector3().fromArray(camera.up);
    const level = new Vector3().fromArray(bounds.centre);
    level.addScaledVector(up, ground.height_m - level.dot(up));
    const tilt = new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), up);
    plane.position.copy(level);
    plane.quaternion.copy(tilt);
    const lines = new LineSegments(new BufferGeometry().setAttribute("position", new BufferAttribute(groundLines(this.view, reach), 3)), new LineBasicMaterial({ color: water ? colours.wave : colours.grid }));
    this.world.add(plane, lines);
    this.world.fog = new Fog(colours.sky, 1, 2);
  }

  resize(width, height, ratio) {
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.eye.aspect = width / height;
  }

  draw(time_s, ghost_s, magnified) {
    const { camera } = this.view;
    this.solids.magnified = magnified;
    this.solids.showAt(time_s);
    if (this.ghostSolids) {
      this.ghostSolids.group.visible = ghost_s !== null;
      this.ghostSolids.magnified = magnified;
      if (ghost_s !== null) this.ghostSolids.showAt(ghost_s);
    }
    const distance = camera.distance();
    this.world.fog.near = 1.1 * distance;
    this.world.fog.far = 3.2 * distance + 2;
    Object.assign(this.eye, { near: distance / 60, far: 12 * distance });
    this.eye.position.fromArray(camera.eye());
    this.eye.up.fromArray(camera.axes().above);
    this.eye.lookAt(...camera.centre);
    this.eye.updateProjectionMatrix();
    this.renderer.render(this.world, this.eye);
  }

  dispose() {
    this.renderer.dispose();
  }
}
