// Where to look from: each gives [eye, target], arrays of 3, metres.
import * as THREE from "three";

/** Box around some of a payload's nodes. */
export function boxOf(payload, indices) {
  const box = new THREE.Box3();
  for (const k of indices) {
    box.expandByPoint(new THREE.Vector3(...payload.boxes.subarray(6 * k, 6 * k + 3)));
    box.expandByPoint(new THREE.Vector3(...payload.boxes.subarray(6 * k + 3, 6 * k + 6)));
  }
  return box;
}

export function homeEye([low, high]) {
  const x = (low[0] + high[0]) / 2, y = (low[1] + high[1]) / 2, size = Math.hypot(high[0] - low[0], high[1] - low[1]);
  return [[x - 0.28 * size, y - 0.42 * size, low[2] + 0.36 * size], [x, y, low[2] + 2]];
}

export function topEye([low, high], camera) {
  const half = Math.max(high[1] - low[1], (high[0] - low[0]) / camera.aspect) / 2;
  const x = (low[0] + high[0]) / 2, y = (low[1] + high[1]) / 2;
  // A hair south of straight down: there the orbit knows which way is up.
  return [[x, y - 0.01, high[2] + 1.05 * half / Math.tan(camera.fov * Math.PI / 360)], [x, y, low[2]]];
}

/** To see a box whole: nearest to where one looks from now, from a little above, and with nothing in between. */
export function eyeFor(box, camera, picker, wished) {
  const centre = box.getCenter(new THREE.Vector3()), radius = box.getSize(new THREE.Vector3()).length() / 2;
  const distance = wished ?? Math.max(7, 2.4 * radius), now = new THREE.Vector3();
  camera.getWorldDirection(now).negate();
  const azimuth = Math.atan2(now.y, now.x), elevation = Math.max(0.35, Math.asin(Math.min(1, now.z)));
  const along = (turn, up) => new THREE.Vector3(
    Math.cos(azimuth + turn) * Math.cos(up), Math.sin(azimuth + turn) * Math.cos(up), Math.sin(up));
  let best = along(0, elevation);
  search: for (const up of [elevation, 0.35, 0.8, 1.2]) {
    for (const turn of [0, 0.6, -0.6, 1.2, -1.2, 1.8, -1.8, 2.4, -2.4, Math.PI]) {
      const direction = along(turn, up), eye = centre.clone().addScaledVector(direction, distance);
      const hit = picker.cast(eye.toArray(), direction.clone().negate().toArray());
      if (!hit || hit.distance > distance - radius - 0.2) {
        best = direction;
        break search;
      }
    }
  }
  return [centre.clone().addScaledVector(best, distance).toArray(), centre.toArray()];
}
