// Which node a ray meets: boxes of the nodes first, then the triangles of those that it enters, nearest box first.

export class NodePicker {
  constructor(payload) {
    this.boxes = payload.boxes;
    this.groups = payload.groups;
    this.ranges = payload.nodes.map(() => []);
    payload.groups.forEach((group, g) => {
      for (let i = 0; i < group.ranges.length; i += 3) {
        this.ranges[group.ranges[i]].push([g, group.ranges[i + 1], group.ranges[i + 2]]);
      }
    });
  }

  /** First hit of a ray: {node: index, distance} or null; origin and unit direction are arrays of 3, metres. */
  cast(origin, direction) {
    const entered = [];
    for (let k = 0; k < this.ranges.length; k++) {
      const near = boxEntry(this.boxes, 6 * k, origin, direction);
      if (near !== null) entered.push([near, k]);
    }
    entered.sort((a, b) => a[0] - b[0]);
    let best = null;
    for (const [near, node] of entered) {
      if (best && near > best.distance) break;
      for (const [g, first, count] of this.ranges[node]) {
        const t = firstTriangle(this.groups[g], first, count, origin, direction, best ? best.distance : Infinity);
        if (t !== null) best = { node, distance: t };
      }
    }
    return best;
  }
}

function boxEntry(boxes, at, origin, direction) {
  let near = 0, far = Infinity;
  for (let a = 0; a < 3; a++) {
    const low = boxes[at + a] - 1e-3, high = boxes[at + 3 + a] + 1e-3;
    if (direction[a] === 0) {
      if (origin[a] < low || origin[a] > high) return null;
      continue;
    }
    const t0 = (low - origin[a]) / direction[a], t1 = (high - origin[a]) / direction[a];
    near = Math.max(near, Math.min(t0, t1));
    far = Math.min(far, Math.max(t0, t1));
  }
  return near <= far ? near : null;
}

/** Möller–Trumbore, the faces that are drawn: front faces, and both sides of what has both. */
function firstTriangle({ position: p, index, bothSides }, first, count, o, d, limit) {
  let best = limit;
  for (let f = 3 * first; f < 3 * (first + count); f += 3) {
    const a = 3 * index[f], b = 3 * index[f + 1], c = 3 * index[f + 2];
    const e1x = p[b] - p[a], e1y = p[b + 1] - p[a + 1], e1z = p[b + 2] - p[a + 2];
    const e2x = p[c] - p[a], e2y = p[c + 1] - p[a + 1], e2z = p[c + 2] - p[a + 2];
    const hx = d[1] * e2z - d[2] * e2y, hy = d[2] * e2x - d[0] * e2z, hz = d[0] * e2y - d[1] * e2x;
    const det = e1x * hx + e1y * hy + e1z * hz;
    if (bothSides ? Math.abs(det) <= 1e-12 : det <= 1e-12) continue;
    const sx = o[0] - p[a], sy = o[1] - p[a + 1], sz = o[2] - p[a + 2];
    const u = (sx * hx + sy * hy + sz * hz) / det;
    if (u < 0 || u > 1) continue;
    const qx = sy * e1z - sz * e1y, qy = sz * e1x - sx * e1z, qz = sx * e1y - sy * e1x;
    const v = (d[0] * qx + d[1] * qy + d[2] * qz) / det;
    if (v < 0 || u + v > 1) continue;
    const t = (e2x * qx + e2y * qy + e2z * qz) / det;
    if (t > 1e-6 && t < best) best = t;
  }
  return best < limit ? best : null;
}

/** Distance in pixels from a point to a segment, and how far along it (0 to 1) the nearest point lies. */
export function segmentDistance(px, py, ax, ay, bx, by) {
  const dx = bx - ax, dy = by - ay, square = dx * dx + dy * dy;
  const along = square > 0 ? Math.min(1, Math.max(0, ((px - ax) * dx + (py - ay) * dy) / square)) : 0;
  return [Math.hypot(px - ax - along * dx, py - ay - along * dy), along];
}
