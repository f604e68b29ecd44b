// Which nodes are drawn while one moves: those in the picture that cover so many pixels. At rest all of them are.
import * as THREE from "three";

export class NodeCuller {
  constructor(payload, meshes) {
    this.meshes = meshes;
    this.groups = payload.groups;
    this.whole = meshes.map((mesh) => mesh.geometry.index);
    const n = payload.nodes.length;
    this.spheres = new Float32Array(4 * n);
    for (let k = 0; k < n; k++) {
      const box = payload.boxes.subarray(6 * k, 6 * k + 6);
      for (let j = 0; j < 3; j++) this.spheres[4 * k + j] = (box[j] + box[j + 3]) / 2;
      this.spheres[4 * k + 3] = Math.hypot(box[3] - box[0], box[4] - box[1], box[5] - box[2]) / 2;
    }
    this.shown = new Uint8Array(n);
    this.frustum = new THREE.Frustum();
  }

  /** Leave out what is outside of the picture or smaller than so many pixels. */
  cull(camera, height, leastPixels) {
    this.regard(camera, height / (2 * Math.tan(camera.fov * Math.PI / 360)), leastPixels);
    this.part ??= this.whole.map((index) => {
      const part = new THREE.BufferAttribute(new Uint32Array(index.array.length), 1);
      part.setUsage(THREE.DynamicDrawUsage);
      return part;
    });
    this.groups.forEach(({ ranges, behind, beyond }, g) => {
      if (behind || beyond) return; // no nodes: the sky and the land beyond are always drawn
      const part = this.part[g];
      let at = 0;
      for (let i = 0; i < ranges.length; i += 3) {
        if (!this.shown[ranges[i]]) continue;
        const first = 3 * ranges[i + 1], count = 3 * ranges[i + 2];
        part.array.set(this.whole[g].array.subarray(first, first + count), at);
        at += count;
      }
      part.clearUpdateRanges();
      part.addUpdateRange(0, at);
      part.needsUpdate = true;
      this.meshes[g].geometry.setIndex(part);
      this.meshes[g].geometry.setDrawRange(0, at);
    });
  }

  /** Draw everything again. */
  release() {
    this.meshes.forEach((mesh, g) => {
      mesh.geometry.setIndex(this.whole[g]);
      mesh.geometry.setDrawRange(0, Infinity);
    });
  }

  regard(camera, focal, leastPixels) {
    const { planes } = this.frustum.setFromProjectionMatrix(
      new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
    const { x, y, z } = camera.position, spheres = this.spheres;
    for (let k = 0; k < this.shown.length; k++) {
      const cx = spheres[4 * k], cy = spheres[4 * k + 1], cz = spheres[4 * k + 2], radius = spheres[4 * k + 3];
      const distance = Math.hypot(cx - x, cy - y, cz - z);
      let inside = distance <= radius || 2 * radius * focal >= leastPixels * distance;
      for (let p = 0; inside && p < 6; p++) {
        const { normal, constant } = planes[p];
        inside = normal.x * cx + normal.y * cy + normal.z * cz + constant >= -radius;
      }
      this.shown[k] = inside ? 1 : 0;
    }
  }
}
