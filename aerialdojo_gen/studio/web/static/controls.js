// Orbit and fly: one camera, two ways to move it. Keys work in both; nothing moves while a text field has the focus.
import * as THREE from "three";
import { OrbitControls } from "three/addons/OrbitControls.js";

const MOVES = {
  KeyW: [0, 1, 0], ArrowUp: [0, 1, 0], KeyS: [0, -1, 0], ArrowDown: [0, -1, 0],
  KeyA: [-1, 0, 0], ArrowLeft: [-1, 0, 0], KeyD: [1, 0, 0], ArrowRight: [1, 0, 0],
  KeyE: [0, 0, 1], PageUp: [0, 0, 1], KeyQ: [0, 0, -1], PageDown: [0, 0, -1],
};

export class CameraControls extends EventTarget {
  constructor(camera, element) {
    super();
    this.camera = camera;
    this.element = element;
    this.mode = "orbit";
    this.orbit = new OrbitControls(camera, element);
    this.orbit.maxPolarAngle = Math.PI * 0.95;
    this.orbit.minDistance = 0.5;
    this.orbit.maxDistance = 1500;
    this.orbit.zoomToCursor = true;
    this.orbit.addEventListener("change", () => this.changed());
    this.held = new Set();
    this.fast = false;
    element.tabIndex = 0;
    element.addEventListener("keydown", (event) => {
      this.fast = event.shiftKey;
      if (MOVES[event.code] && !event.ctrlKey && !event.metaKey && !event.altKey) {
        this.held.add(event.code);
        event.preventDefault();
        this.changed();
      }
    });
    element.addEventListener("keyup", (event) => { this.held.delete(event.code); this.fast = event.shiftKey; });
    element.addEventListener("blur", () => this.held.clear());
    element.addEventListener("pointerdown", () => element.focus({ preventScroll: true }));
    element.addEventListener("pointermove", (event) => this.look(event));
    element.addEventListener("wheel", (event) => {
      if (this.mode !== "fly") return;
      event.preventDefault();
      this.move(new THREE.Vector3(0, 1, 0), -Math.sign(event.deltaY) * 3);
    }, { passive: false });
  }

  changed() { this.dispatchEvent(new Event("change")); }

  get moving() { return this.held.size > 0; }

  setMode(mode) {
    this.mode = mode;
    this.orbit.enabled = mode === "orbit";
    if (mode === "orbit") {
      const ahead = new THREE.Vector3();
      this.camera.getWorldDirection(ahead);
      const distance = Math.max(5, Math.min(60, this.camera.position.z / Math.max(0.1, -ahead.z)));
      this.orbit.target.copy(this.camera.position).addScaledVector(ahead, distance);
      this.orbit.update();
    }
    this.changed();
  }

  /** Look from one point at another; both arrays of 3, metres. */
  lookFrom(eye, target) {
    this.camera.position.set(...eye);
    this.orbit.target.set(...target);
    this.camera.lookAt(this.orbit.target);
    if (this.mode === "orbit") this.orbit.update();
    this.changed();
  }

  look(event) {
    if (this.mode !== "fly" || !(event.buttons & 3)) return;
    const angles = new THREE.Euler().setFromQuaternion(this.camera.quaternion, "ZXY");
    angles.z += event.movementX * 0.0035;
    angles.x = Math.min(Math.PI - 0.02, Math.max(0.02, angles.x + event.movementY * 0.0035));
    angles.y = 0;
    this.camera.quaternion.setFromEuler(angles);
    this.changed();
  }

  /** Step by the held keys; seconds since the last step. */
  update(seconds) {
    if (!this.held.size) return;
    const wish = new THREE.Vector3();
    for (const code of this.held) wish.add(new THREE.Vector3(...MOVES[code]));
    if (wish.lengthSq() === 0) return;
    const pace = this.mode === "fly" ? 12 : Math.max(4, this.camera.position.distanceTo(this.orbit.target) * 0.6);
    this.move(wish.normalize(), pace * (this.fast ? 4 : 1) * Math.min(seconds, 0.1));
  }

  /** Move by metres along a wish: x right, y ahead (in fly mode where one looks, in orbit level), z up. */
  move(wish, metres) {
    const ahead = new THREE.Vector3();
    this.camera.getWorldDirection(ahead);
    const right = new THREE.Vector3().crossVectors(ahead, this.camera.up).normalize();
    if (this.mode === "orbit") ahead.crossVectors(this.camera.up, right);
    const step = right.multiplyScalar(wish.x).addScaledVector(ahead, wish.y).addScaledVector(this.camera.up, wish.z)
      .multiplyScalar(metres);
    this.camera.position.add(step);
    this.orbit.target.add(step);
    if (this.mode === "orbit") this.orbit.update();
    this.changed();
  }
}
