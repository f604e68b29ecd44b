// Markers and routes over the scene: each layer is one draw call, whatever it holds, and finds what is under the cursor.
import * as THREE from "three";
import { segmentDistance } from "./picking.js";

export const bytes = (colour) => {
  const value = parseInt(colour.slice(1), 16);
  return [(value >> 16) & 255, (value >> 8) & 255, value & 255];
};

const LINE_VERTEX = /* glsl */ `
  in vec3 a, b;
  in vec3 colour;
  uniform vec2 resolution;
  uniform float width;
  out vec3 vColour;
  out float across;
  void main() {
    vec4 va = viewMatrix * vec4(a, 1.0), vb = viewMatrix * vec4(b, 1.0);
    float near = -0.2;
    if (va.z > near && vb.z < near) va = mix(vb, va, (near - vb.z) / (va.z - vb.z));
    if (vb.z > near && va.z < near) vb = mix(va, vb, (near - va.z) / (vb.z - va.z));
    vec4 ca = projectionMatrix * va, cb = projectionMatrix * vb;
    vec2 along = (cb.xy / cb.w - ca.xy / ca.w) * resolution;
    along = dot(along, along) > 1e-9 ? normalize(along) : vec2(1.0, 0.0);
    vec2 side = vec2(-along.y, along.x);
    vec4 clip = mix(ca, cb, position.x);
    // Ends reach out by half a width, so that bends close.
    vec2 offset = side * position.y + along * (position.x * 2.0 - 1.0);
    clip.xy += offset * width / resolution * clip.w;
    vColour = colour;
    across = position.y;
    gl_Position = clip;
  }`;
const LINE_FRAGMENT = /* glsl */ `
  in vec3 vColour;
  in float across;
  uniform float opacity;
  out vec4 pixel;
  void main() { pixel = vec4(vColour * (1.0 - 0.35 * across * across), opacity); }`;

/** Four corners a segment. Not instanced: without a GPU an instance costs as much as a draw call. */
function quads(ends, colours, n) {
  const corners = new Float32Array(12 * n), both = new Float32Array(24 * n), tint = new Uint8Array(16 * n), index = new Uint32Array(6 * n);
  for (let k = 0; k < n; k++) {
    corners.set([0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0], 12 * k);
    for (let c = 0; c < 4; c++) {
      both.set(ends.subarray(6 * k, 6 * k + 6), 6 * (4 * k + c));
      tint.set(colours.subarray(4 * k, 4 * k + 4), 4 * (4 * k + c));
    }
    index.set([4 * k, 4 * k + 1, 4 * k + 2, 4 * k, 4 * k + 2, 4 * k + 3], 6 * k);
  }
  const geometry = new THREE.BufferGeometry(), segments = new THREE.InterleavedBuffer(both, 6);
  geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
  geometry.setAttribute("a", new THREE.InterleavedBufferAttribute(segments, 3, 0));
  geometry.setAttribute("b", new THREE.InterleavedBufferAttribute(segments, 3, 3));
  geometry.setAttribute("colour", new THREE.BufferAttribute(tint, 4, true));
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  return geometry;
}

/** Polylines of constant width on the screen: [{id, points: flat xyz, colour: "#rrggbb" or one a segment}]. */
export class RouteLayer {
  constructor(routes, { width = 2.5, opacity = 0.9, onTop = false, pickable = true } = {}) {
    this.routes = routes;
    this.width = width;
    this.pickable = pickable;
    const n = routes.reduce((sum, route) => sum + Math.max(0, route.points.length / 3 - 1), 0);
    this.ends = new Float32Array(6 * n);
    this.owner = new Uint32Array(n);
    const colours = new Uint8Array(4 * n);
    let k = 0;
    routes.forEach((route, r) => {
      for (let i = 0; i + 5 < route.points.length; i += 3, k++) {
        for (let j = 0; j < 6; j++) this.ends[6 * k + j] = route.points[i + j];
        colours.set(bytes(Array.isArray(route.colour) ? route.colour[i / 3] : route.colour), 4 * k);
        this.owner[k] = r;
      }
    });
    const geometry = quads(this.ends, colours, n);
    this.object = new THREE.Mesh(geometry, new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: LINE_VERTEX, fragmentShader: LINE_FRAGMENT, side: THREE.DoubleSide,
      transparent: true, depthWrite: false, depthTest: !onTop,
      uniforms: { resolution: { value: new THREE.Vector2(1, 1) }, width: { value: width }, opacity: { value: opacity } },
    }));
    this.object.frustumCulled = false;
    this.object.renderOrder = onTop ? 5 : 2;
  }

  resize(width, height) {
    this.object.material.uniforms.resolution.value.set(width, height);
  }

  /** Nearest route within reach of the cursor: {id, item, pixels, point} or null. */
  pick(view, x, y) {
    let best = null;
    const reach = this.width / 2 + 5, a = [0, 0, 0], b = [0, 0, 0];
    for (let k = 0; k < this.owner.length; k++) {
      if (!view.project(this.ends, 6 * k, a) || !view.project(this.ends, 6 * k + 3, b)) continue;
      const [pixels, along] = segmentDistance(x, y, a[0], a[1], b[0], b[1]);
      if (pixels < reach && (!best || pixels < best.pixels)) {
        const item = this.routes[this.owner[k]];
        const point = [0, 1, 2].map((j) => this.ends[6 * k + j] * (1 - along) + this.ends[6 * k + 3 + j] * along);
        best = { id: item.id, item, pixels, point };
      }
    }
    return best;
  }
}

const POINT_VERTEX = /* glsl */ `
  in vec3 colour;
  in float size;
  uniform float scale;
  out vec3 vColour;
  out float radius;
  void main() {
    vec4 p = viewMatrix * vec4(position, 1.0);
    radius = 0.5 * size * scale;
    vColour = colour;
    gl_PointSize = 2.0 * radius;
    gl_Position = projectionMatrix * p;
  }`;
const POINT_FRAGMENT = /* glsl */ `
  in vec3 vColour;
  in float radius;
  out vec4 pixel;
  void main() {
    float r = length(gl_PointCoord - 0.5) * 2.0 * radius;
    if (r > radius) discard;
    float edge = smoothstep(radius - 2.5, radius - 1.5, r);
    pixel = vec4(mix(vColour, vec3(0.08), edge), smoothstep(radius, radius - 1.0, r));
  }`;

/** Round markers of constant size on the screen: [{id, position: [x, y, z], colour, size (px), label}]. */
export class MarkerLayer {
  constructor(markers, { size = 12, onTop = true, pickable = true } = {}) {
    this.markers = markers;
    this.pickable = pickable;
    this.size = size;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(
      new Float32Array(markers.flatMap((marker) => [...marker.position])), 3));
    geometry.setAttribute("colour", new THREE.BufferAttribute(
      new Uint8Array(markers.flatMap((marker) => [...bytes(marker.colour), 255])), 4, true));
    geometry.setAttribute("size", new THREE.BufferAttribute(
      new Float32Array(markers.map((marker) => marker.size ?? size)), 1));
    this.object = new THREE.Points(geometry, new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: POINT_VERTEX, fragmentShader: POINT_FRAGMENT,
      transparent: true, depthWrite: false, depthTest: !onTop, uniforms: { scale: { value: 1 } },
    }));
    this.object.frustumCulled = false;
    this.object.renderOrder = onTop ? 6 : 3;
    this.labels = markers.filter((marker) => marker.label).map((marker) => {
      const element = document.createElement("div");
      element.className = "scene-label";
      element.textContent = marker.label;
      return { element, position: marker.position };
    });
  }

  resize(width, height, pixelRatio) {
    this.object.material.uniforms.scale.value = pixelRatio;
  }

  pick(view, x, y) {
    let best = null;
    const p = [0, 0, 0];
    for (const item of this.markers) {
      if (!view.project(item.position, 0, p)) continue;
      const pixels = Math.hypot(x - p[0], y - p[1]);
      if (pixels < (item.size ?? this.size) / 2 + 2 && (!best || p[2] < best.depth)) {
        best = { id: item.id, item, pixels, depth: p[2], point: [...item.position] };
      }
    }
    return best;
  }
}
