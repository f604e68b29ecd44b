// Thousands of routes as thin lines: one buffer of points and one draw call. While one moves fewer points are joined.
import * as THREE from "three";
import { bytes } from "./layers.js";
import { segmentDistance } from "./picking.js";

const VERTEX = /* glsl */ `
  in vec3 colour;
  out vec3 vColour;
  void main() {
    vColour = colour;
    gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
  }`;
const FRAGMENT = /* glsl */ `
  in vec3 vColour;
  uniform float opacity;
  out vec4 pixel;
  void main() { pixel = vec4(vColour, opacity); }`;

const REACH_PX = 6, BEND_M = 0.6;

/** Routes drawn in the order in which they are given, so that the last lies on top: [{id, points: flat xyz, colour}]. */
export class CrowdLayer {
  constructor(routes, { opacity = 0.6, pickable = true } = {}) {
    this.routes = routes;
    this.pickable = pickable;
    this.first = new Uint32Array(routes.length + 1);
    routes.forEach((route, r) => { this.first[r + 1] = this.first[r] + route.points.length / 3; });
    const n = this.first[routes.length];
    this.points = new Float32Array(3 * n);
    const colours = new Uint8Array(4 * n);
    routes.forEach((route, r) => {
      this.points.set(route.points, 3 * this.first[r]);
      const [red, green, blue] = bytes(route.colour);
      for (let k = this.first[r]; k < this.first[r + 1]; k++) colours.set([red, green, blue, 255], 4 * k);
    });
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(this.points, 3));
    geometry.setAttribute("colour", new THREE.BufferAttribute(colours, 4, true));
    this.indices = new Map();
    this.object = new THREE.LineSegments(geometry, new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, transparent: true, depthWrite: false,
      uniforms: { opacity: { value: opacity } },
    }));
    this.object.frustumCulled = false;
    this.object.renderOrder = 2;
    this.thin(Infinity);
  }

  get segments() { return this.first[this.routes.length] - this.routes.length; }

  resize() {}

  /** Draw so many segments at most: points that a straight line nearly meets are passed over, then whole routes. */
  thin(most) {
    const whole = this.segments <= most;
    let every = 1;
    if (!whole) {
      if (!this.kept) {
        this.kept = this.bends();
        this.bent = this.kept.reduce((sum, keep) => sum + keep, 0) - this.routes.length;
      }
      every = Math.ceil(this.bent / most);
    }
    const key = whole ? 0 : every;
    if (!this.indices.has(key)) this.indices.set(key, new THREE.BufferAttribute(this.joined(whole, every), 1));
    this.object.geometry.setIndex(this.indices.get(key));
  }

  joined(whole, every) {
    const index = new Uint32Array(2 * this.segments);
    let at = 0;
    for (let r = 0; r < this.routes.length; r += every) {
      let last = this.first[r];
      for (let k = last + 1; k < this.first[r + 1]; k++) {
        if (!whole && !this.kept[k]) continue;
        index[at++] = last;
        index[at++] = k;
        last = k;
      }
    }
    return index.slice(0, at);
  }

  /** Which points a route needs to keep within BEND_M of itself (Douglas and Peucker). */
  bends() {
    const kept = new Uint8Array(this.points.length / 3), open = [];
    for (let r = 0; r < this.routes.length; r++) {
      const end = this.first[r + 1] - 1;
      kept[this.first[r]] = kept[end] = 1;
      open.push(this.first[r], end);
      while (open.length) {
        const to = open.pop(), from = open.pop(), [far, k] = this.farthest(from, to);
        if (far <= BEND_M) continue;
        kept[k] = 1;
        open.push(from, k, k, to);
      }
    }
    return kept;
  }

  farthest(from, to) {
    const p = this.points, a = 3 * from, dx = p[3 * to] - p[a], dy = p[3 * to + 1] - p[a + 1], dz = p[3 * to + 2] - p[a + 2];
    const square = dx * dx + dy * dy + dz * dz;
    let far = 0, at = from;
    for (let k = from + 1; k < to; k++) {
      const x = p[3 * k] - p[a], y = p[3 * k + 1] - p[a + 1], z = p[3 * k + 2] - p[a + 2];
      const share = square ? Math.min(1, Math.max(0, (x * dx + y * dy + z * dz) / square)) : 0;
      const away = Math.hypot(x - share * dx, y - share * dy, z - share * dz);
      if (away > far) [far, at] = [away, k];
    }
    return [far, at];
  }

  /** Nearest route within reach of the cursor, of equal ones the one on top: {id, item, pixels, point} or null. */
  pick(view, x, y) {
    let best = null, a = [0, 0, 0], b = [0, 0, 0];
    for (let r = 0; r < this.routes.length; r++) {
      let known = view.project(this.points, 3 * this.first[r], a);
      for (let k = this.first[r] + 1; k < this.first[r + 1]; k++) {
        const now = view.project(this.points, 3 * k, b);
        if (known && now) {
          const [pixels, along] = segmentDistance(x, y, a[0], a[1], b[0], b[1]);
          if (pixels < REACH_PX && (!best || pixels <= best.pixels)) best = { pixels, along, r, k };
        }
        known = now;
        [a, b] = [b, a];
      }
    }
    if (!best) return null;
    const item = this.routes[best.r];
    const point = [0, 1, 2].map((j) => this.points[3 * best.k - 3 + j] * (1 - best.along) + this.points[3 * best.k + j] * best.along);
    return { id: item.id, item, pixels: best.pixels, point };
  }
}
