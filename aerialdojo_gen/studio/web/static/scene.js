// A scene in the browser: loads the payload into three.js and offers layers, picking and cameras to a page.
//
//   const view = await SceneView.load(element, "/api/scene");
//   view.addMarkers("objects", [{id, position: [x, y, z], colour: "#e6a13c", label}]);
//   view.addRoutes("routes", [{id, points: [x, y, z, ...], colour: "#3b82f6"}]);
//   view.onPick((hit) => ...);      // {kind: "marker" | "route" | "node", layer, id, node, point} or null
//   view.focusOn("delivery_van_003"); view.setVisible("objects", false);
import * as THREE from "three";
import { CameraControls } from "./controls.js";
import { CrowdLayer } from "./crowd.js";
import { NodeCuller } from "./culling.js";
import { MarkerLayer, RouteLayer } from "./layers.js";
import { drawnBySoftware, LEVELS, Pace, SOFTWARE_LEVEL } from "./pace.js";
import { loadPayload } from "./payload.js";
import { NodePicker } from "./picking.js";
import { boxOf, eyeFor, homeEye, topEye } from "./viewpoints.js";
import { castShadow, groupMesh, lightUniforms, skyMesh } from "./shading.js";

const FIELD_OF_VIEW_DEG = 60;
// A pick that takes longer than this waits until the cursor rests.
const SLOW_MS = 12, REST_MS = 120;

// What has stood still for so long is drawn whole.
const SETTLE_MS = 180;

function makeRenderer(software) {
  try {
    // Four samples a pixel cost half of the time where no GPU takes them.
    return new THREE.WebGLRenderer({ antialias: !software, powerPreference: "high-performance" });
  } catch (error) {
    throw new Error("this browser shows no WebGL 2: switch hardware acceleration on, or try another browser", { cause: error });
  }
}

export class SceneView {
  /** Load a scene into an element that has a size. */
  static async load(element, url) {
    return new SceneView(element, await loadPayload(url));
  }

  constructor(element, payload) {
    this.element = element;
    this.payload = payload;
    this.nodes = payload.nodes;
    this.index = new Map(payload.nodes.map((entry, k) => [entry.node, k]));
    this.layers = new Map();
    this.level = -1;
    this.resting = 0;
    this.frameListeners = [];
    this.pickListeners = [];
    this.hoverListeners = [];
    const software = drawnBySoftware();
    this.renderer = makeRenderer(software);
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute("aria-label", `3D view of ${payload.name}`);
    this.canvas.setAttribute("role", "application");
    this.overlay = document.createElement("div");
    this.overlay.className = "scene-overlay";
    element.append(this.canvas, this.overlay);
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.1, 4000);
    this.camera.up.set(0, 0, 1);
    this.three = new THREE.Scene();
    const uniforms = lightUniforms(payload);
    const anisotropy = Math.min(8, this.renderer.capabilities.getMaxAnisotropy());
    this.meshes = payload.groups.map((group) => groupMesh(group, uniforms, anisotropy));
    this.three.add(skyMesh(payload), ...this.meshes);
    const extent = boxOf(payload, payload.nodes.map((_, k) => k));
    castShadow(this.renderer, this.meshes, uniforms, extent.min, extent.max, software ? 2048 : 4096);
    this.picker = new NodePicker(payload);
    this.culler = new NodeCuller(payload, this.meshes);
    this.pace = new Pace(this.renderer.getContext(), software ? SOFTWARE_LEVEL : 0);
    this.controls = new CameraControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.invalidate());
    this.listen();
    new ResizeObserver(() => { if (this.resize()) this.draw(); }).observe(element);
    this.resize();
    this.home();
    this.aim();
  }

  // ---- drawing: a frame is made when something changed, and not before ----

  invalidate() {
    if (this.pending) return;
    this.pending = requestAnimationFrame((now) => {
      this.pending = 0;
      if (this.pace.busy) {
        this.invalidate();
        return;
      }
      // The first frame of a motion may wait behind the last one at rest.
      const first = this.resting === 0;
      clearTimeout(this.resting);
      this.controls.update(this.last ? (now - this.last) / 1000 : 1 / 60);
      this.last = this.controls.moving ? now : 0;
      this.draw(this.pace.level);
      this.pace.watch((took) => {
        if (!first) this.pace.learn(took);
        this.resting = setTimeout(() => { if (this.level) this.draw(); this.resting = 0; }, SETTLE_MS);
      });
      if (this.controls.moving) this.invalidate();
    });
  }

  /** Draw everything, or what a level of LEVELS leaves of it. */
  draw(level = 0) {
    this.aim();
    this.measure(level);
    this.renderer.render(this.three, this.camera);
    this.placeLabels();
    for (const listener of this.frameListeners) listener(this);
  }

  /** Where the camera is now, whether or not that is drawn yet. */
  aim() {
    this.camera.updateMatrixWorld();
    this.matrix = new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
  }

  measure(level) {
    const { ratio, leastPixels, mostSegments } = LEVELS[level];
    if (level !== this.level) {
      this.level = level;
      this.renderer.setPixelRatio(ratio * Math.min(window.devicePixelRatio, 2));
      for (const layer of this.layers.values()) this.fit(layer);
    }
    if (level) this.culler.cull(this.camera, this.height, leastPixels);
    else this.culler.release();
    for (const layer of this.layers.values()) layer.thin?.(mostSegments);
  }

  /** Take the element's size; whether that is another one, so that nothing is on the canvas any more. */
  resize() {
    const width = Math.max(1, this.element.clientWidth), height = Math.max(1, this.element.clientHeight);
    if (width === this.width && height === this.height) return false;
    Object.assign(this, { width, height });
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    for (const layer of this.layers.values()) this.fit(layer);
    return true;
  }

  fit(layer) { layer.resize(this.width, this.height, this.renderer.getPixelRatio()); }

  // ---- layers ----

  addMarkers(name, markers, options) { this.replace(name, new MarkerLayer(markers, options)); }

  addRoutes(name, routes, options) { this.replace(name, new RouteLayer(routes, options)); }

  addCrowd(name, routes, options) { this.replace(name, new CrowdLayer(routes, options)); }

  replace(name, layer) {
    const visible = this.layers.get(name)?.object.visible ?? true;
    this.remove(name);
    layer.object.visible = visible;
    this.layers.set(name, layer);
    this.three.add(layer.object);
    this.overlay.append(...(layer.labels ?? []).map((label) => label.element));
    this.fit(layer);
    this.invalidate();
  }

  remove(name) {
    const layer = this.layers.get(name);
    if (!layer) return;
    this.three.remove(layer.object);
    layer.object.geometry.dispose();
    layer.object.material.dispose();
    for (const label of layer.labels ?? []) label.element.remove();
    this.layers.delete(name);
    this.invalidate();
  }

  setVisible(name, visible) {
    if (name === "scene") for (const mesh of this.meshes) mesh.visible = visible;
    else if (this.layers.has(name)) this.layers.get(name).object.visible = visible;
    this.invalidate();
  }

  /** Share of a layer of routes that covers what is behind it: 0 to 1. */
  setOpacity(name, opacity) {
    const uniform = this.layers.get(name)?.object.material.uniforms.opacity;
    if (uniform) uniform.value = opacity;
    this.invalidate();
  }

  placeLabels() {
    const p = [0, 0, 0];
    for (const layer of this.layers.values()) {
      for (const { element, position } of layer.labels ?? []) {
        const shown = layer.object.visible && this.project(position, 0, p);
        element.hidden = !shown;
        if (shown) element.style.transform = `translate(${p[0].toFixed(1)}px, ${p[1].toFixed(1)}px)`;
      }
    }
  }

  // ---- picking ----

  /** Pixel (x, y from the element's top left) and depth of a point; false where it lies behind the camera. */
  project(points, at, out) {
    const m = this.matrix.elements, x = points[at], y = points[at + 1], z = points[at + 2];
    const w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w < 0.2) return false;
    out[0] = ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w * 0.5 + 0.5) * this.width;
    out[1] = (0.5 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w * 0.5) * this.height;
    out[2] = w;
    return true;
  }

  /** Ray through a pixel: [origin, unit direction], arrays of 3. */
  ray(x, y) {
    this.aim();
    const o = this.camera.position;
    const d = new THREE.Vector3(2 * x / this.width - 1, 1 - 2 * y / this.height, 0.5).unproject(this.camera)
      .sub(o).normalize();
    return [o.toArray(), d.toArray()];
  }

  /** The node under a pixel: {kind: "node", node, instance, point, distance} or null. */
  pickNode(x, y) {
    if (!this.meshes[0].visible) return null;
    const [o, d] = this.ray(x, y);
    const hit = this.picker.cast(o, d);
    if (!hit) return null;
    return { kind: "node", node: this.nodes[hit.node].node, instance: this.nodes[hit.node], distance: hit.distance,
      point: o.map((v, k) => v + d[k] * hit.distance) };
  }

  /** What lies under a pixel: markers before routes before nodes; a route behind a surface is not picked. */
  pick(x, y) {
    this.aim();
    const node = this.pickNode(x, y);
    for (const kind of ["marker", "route"]) {
      let best = null;
      for (const [name, layer] of this.layers) {
        if (!layer.object.visible || !layer.pickable || (kind === "marker") !== layer instanceof MarkerLayer) continue;
        const hit = layer.pick(this, x, y);
        if (hit && layer.object.material.depthTest && node) {
          const distance = this.camera.position.distanceTo(new THREE.Vector3(...hit.point));
          if (distance > node.distance * 1.01 + 0.3) continue;
        }
        if (hit && (!best || hit.pixels < best.pixels)) best = { kind, layer: name, ...hit };
      }
      if (best) return { ...best, under: node };
    }
    return node;
  }

  onPick(listener) { this.pickListeners.push(listener); }

  onHover(listener) { this.hoverListeners.push(listener); }

  onFrame(listener) { this.frameListeners.push(listener); }

  listen() {
    let down = null, waiting = 0, slow = false;
    const inside = (event) => {
      const box = this.canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    this.canvas.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY, event.button]; });
    this.canvas.addEventListener("pointerup", (event) => {
      if (down && down[2] === 0 && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 4) {
        const hit = this.pick(...inside(event));
        for (const listener of this.pickListeners) listener(hit, event);
      }
      down = null;
    });
    this.canvas.addEventListener("pointermove", (event) => {
      clearTimeout(waiting);
      if (!this.hoverListeners.length || event.buttons) return;
      waiting = setTimeout(() => {
        const begin = performance.now(), hit = this.pick(...inside(event));
        slow = performance.now() - begin > SLOW_MS;
        for (const listener of this.hoverListeners) listener(hit, event);
      }, slow ? REST_MS : 0);
    });
    this.canvas.addEventListener("pointerleave", (event) => {
      clearTimeout(waiting);
      for (const listener of this.hoverListeners) listener(null, event);
    });
  }

  // ---- cameras ----

  /** Vertical field of view, degrees; without one, the usual. */
  setFieldOfView(degrees = FIELD_OF_VIEW_DEG) {
    this.camera.fov = degrees;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  /** The whole flight volume, seen from the south-west. */
  home() { this.controls.lookFrom(...homeEye(this.payload.bounds_m)); }

  /** The whole flight volume from above, north at the top. */
  top() { this.controls.lookFrom(...topEye(this.payload.bounds_m, this.camera)); }

  /** Bring a node (by name), a point, or a list of points (arrays of 3) into the middle, from where one looks now. */
  focusOn(what, { distance } = {}) {
    let box;
    if (typeof what === "string") {
      if (!this.index.has(what)) return;
      box = boxOf(this.payload, [this.index.get(what)]);
    } else {
      const points = typeof what[0] === "number" ? [what] : what;
      box = new THREE.Box3().setFromPoints(points.map((p) => new THREE.Vector3(...p)));
    }
    this.controls.lookFrom(...eyeFor(box, this.camera, this.picker, distance));
  }
}
