// What the figure is made of where no graphics card draws it: light and fog at the corners of triangles in place of each
// pixel, and fewer corners.

import { Color, CylinderGeometry, RingGeometry, ShaderMaterial, SphereGeometry, Vector3 } from "three";

import { SpaceStage } from "../stage3d.js";

const VERTEX = `
uniform vec3 colour, sky, up, sun;
uniform vec2 haze;
varying vec3 shade;
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  vec3 out_of = normalize(mat3(modelMatrix) * normal);
  vec3 light = mix(vec3(0.39, 0.43, 0.49), vec3(1.0), 0.5 + 0.5 * dot(out_of, up)) * 1.55 + 0.25 + 1.7 * max(dot(out_of, sun), 0.0);
  shade = mix(pow(colour * light * 0.3183, vec3(1.0 / 2.2)), sky, smoothstep(haze.x, haze.y, -seen.z));
  gl_Position = projectionMatrix * seen;
}`;

const FRAGMENT = `
uniform float opacity;
varying vec3 shade;
void main() {
  gl_FragColor = vec4(shade, opacity);
}`;

export class QuickStage extends SpaceStage {
  constructor(canvas, view, figure) {
    super(canvas, view, figure, null, true, quickStuff(view.camera));
  }

  recolour() {
    new Color(this.view.colours.sky).convertLinearToSRGB().toArray(this.stuff.shared.sky.value);
    super.recolour();
  }

  addLights() {
    // the surfaces know where the light comes from
  }

  draw(time_s) {
    const distance = this.view.camera.distance();
    this.stuff.shared.haze.value = [1.1 * distance, 3.2 * distance + 2];
    super.draw(time_s, null, 0);
  }
}

function quickStuff({ up, left, forward }) {
  const sun = new Vector3().addScaledVector(new Vector3(...up), 3).addScaledVector(new Vector3(...left), -1.1).addScaledVector(new Vector3(...forward), 0.9).normalize();
  const shared = { up: { value: new Vector3(...up) }, sun: { value: sun }, haze: { value: [1, 2] }, sky: { value: [1, 1, 1] } };
  return {
    shared,
    rod: new CylinderGeometry(1, 1, 1, 8, 1, true).translate(0, 0.5, 0),
    ball: new SphereGeometry(1, 10, 7),
    ground: (reach) => new RingGeometry(0, reach, 32, 8),
    material: ({ color, transparent = false, opacity = 1 }) => new ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, transparent, uniforms: { ...shared, colour: { value: new Color(color).toArray() }, opacity: { value: opacity } } }),
  };
}
