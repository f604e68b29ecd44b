"""Exact distances between points, segments and triangles as Numba kernels; splitting; Morton codes.

All coordinates are float64, metres, world frame. A triangle is nine consecutive numbers of a row: ax, ay, az, bx,
… cz. Distances are returned squared. The closed forms are Ericson's, Real-Time Collision Detection, chapter 5.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats, Ints

_PARALLEL = 1e-14


@njit(cache=True, inline="always")
def point_segment_d2(
    px: float, py: float, pz: float, ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> float:
    """Squared distance from point p to segment ab."""
    ux, uy, uz = bx - ax, by - ay, bz - az
    wx, wy, wz = px - ax, py - ay, pz - az
    uu = ux * ux + uy * uy + uz * uz
    t = 0.0
    if uu > 0.0:
        t = min(1.0, max(0.0, (wx * ux + wy * uy + wz * uz) / uu))
    ex, ey, ez = wx - t * ux, wy - t * uy, wz - t * uz
    return ex * ex + ey * ey + ez * ez


@njit(cache=True)
def point_triangle_d2(px: float, py: float, pz: float, tri: Floats, k: int) -> float:
    """Squared distance from point p to triangle `tri[k]`; right for degenerate triangles too."""
    ax, ay, az = tri[k, 0], tri[k, 1], tri[k, 2]
    bx, by, bz = tri[k, 3], tri[k, 4], tri[k, 5]
    cx, cy, cz = tri[k, 6], tri[k, 7], tri[k, 8]
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    nn = nx * nx + ny * ny + nz * nz
    wx, wy, wz = px - ax, py - ay, pz - az
    if nn > 0.0:
        # Barycentric coordinates of the foot on the plane: inside means that the plane decides.
        s = ((uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz) / nn
        t = ((wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz) / nn
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            h = wx * nx + wy * ny + wz * nz
            return h * h / nn
    d = point_segment_d2(px, py, pz, ax, ay, az, bx, by, bz)
    d = min(d, point_segment_d2(px, py, pz, bx, by, bz, cx, cy, cz))
    return min(d, point_segment_d2(px, py, pz, cx, cy, cz, ax, ay, az))


@njit(cache=True)
def closest_point_d2(p: Floats, t: Floats) -> float:
    """Squared distance from point p, (3,), to the triangle t, (9,), by its closest point (Ericson, 5.1.5).

    Not `point_triangle_d2`, which differs from it in the last bits: the distances that anchors are stored with are
    this one's, and certified routes' clearances that one's.
    """
    a0, a1, a2 = t[0], t[1], t[2]
    ab0, ab1, ab2 = t[3] - a0, t[4] - a1, t[5] - a2
    ac0, ac1, ac2 = t[6] - a0, t[7] - a1, t[8] - a2
    ap0, ap1, ap2 = p[0] - a0, p[1] - a1, p[2] - a2
    d1 = ab0 * ap0 + ab1 * ap1 + ab2 * ap2
    d2 = ac0 * ap0 + ac1 * ap1 + ac2 * ap2
    d3 = d1 - (ab0 * ab0 + ab1 * ab1 + ab2 * ab2)
    d4 = d2 - (ab0 * ac0 + ab1 * ac1 + ab2 * ac2)
    d5 = d1 - (ab0 * ac0 + ab1 * ac1 + ab2 * ac2)
    d6 = d2 - (ac0 * ac0 + ac1 * ac1 + ac2 * ac2)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w = d1 / (d1 - d3), 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        total = va + vb + vc
        v, w = vb / total, vc / total
    x = ap0 - v * ab0 - w * ac0
    y = ap1 - v * ab1 - w * ac1
    z = ap2 - v * ab2 - w * ac2
    return x * x + y * y + z * z


@njit(cache=True, inline="always")
def segment_segment_d2(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float,
    ax: float, ay: float, az: float, bx: float, by: float, bz: float,
) -> float:  # fmt: skip
    """Squared distance between segments pq and ab."""
    ux, uy, uz = qx - px, qy - py, qz - pz
    vx, vy, vz = bx - ax, by - ay, bz - az
    wx, wy, wz = px - ax, py - ay, pz - az
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    uw = ux * wx + uy * wy + uz * wz
    vw = vx * wx + vy * wy + vz * wz
    s, t = 0.0, 0.0
    if uu <= 0.0:
        if vv > 0.0:
            t = min(1.0, max(0.0, vw / vv))
    elif vv <= 0.0:
        s = min(1.0, max(0.0, -uw / uu))
    else:
        det = uu * vv - uv * uv
        if det > _PARALLEL * uu * vv:
            s = min(1.0, max(0.0, (uv * vw - uw * vv) / det))
        t = (uv * s + vw) / vv
        if t < 0.0:
            t = 0.0
            s = min(1.0, max(0.0, -uw / uu))
        elif t > 1.0:
            t = 1.0
            s = min(1.0, max(0.0, (uv - uw) / uu))
    ex, ey, ez = wx + s * ux - t * vx, wy + s * uy - t * vy, wz + s * uz - t * vz
    return ex * ex + ey * ey + ez * ez


@njit(cache=True)
def segment_triangle_d2(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float, tri: Floats, k: int, bound: float
) -> float:
    """Squared distance between segment pq and triangle `tri[k]`, metres²; inf where it exceeds `bound` squared."""
    ax, ay, az = tri[k, 0], tri[k, 1], tri[k, 2]
    bx, by, bz = tri[k, 3], tri[k, 4], tri[k, 5]
    cx, cy, cz = tri[k, 6], tri[k, 7], tri[k, 8]
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    nn = nx * nx + ny * ny + nz * nz
    limit = bound * bound
    if nn > 0.0:
        hp = (px - ax) * nx + (py - ay) * ny + (pz - az) * nz
        hq = (qx - ax) * nx + (qy - ay) * ny + (qz - az) * nz
        if hp * hq > 0.0:
            h = min(abs(hp), abs(hq))
            if h * h > limit * nn:
                return np.inf
        else:
            f = hp / (hp - hq) if hp != hq else 0.0
            wx, wy, wz = px + f * (qx - px) - ax, py + f * (qy - py) - ay, pz + f * (qz - pz) - az
            s = ((uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz) / nn
            t = ((wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz) / nn
            if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
                return 0.0
    d = segment_segment_d2(px, py, pz, qx, qy, qz, ax, ay, az, bx, by, bz)
    d = min(d, segment_segment_d2(px, py, pz, qx, qy, qz, bx, by, bz, cx, cy, cz))
    d = min(d, segment_segment_d2(px, py, pz, qx, qy, qz, cx, cy, cz, ax, ay, az))
    d = min(d, point_triangle_d2(px, py, pz, tri, k))
    d = min(d, point_triangle_d2(qx, qy, qz, tri, k))
    return d if d <= limit else np.inf


def split_triangles(triangles: Floats, max_edge_m: float, lower: Floats, upper: Floats) -> tuple[Floats, Ints]:
    """Halve triangles (n, 9) until no edge exceeds `max_edge_m`, dropping those outside a box: pieces, their rows."""
    todo = triangles.reshape(-1, 3, 3)
    near, small = _within(triangles, lower, upper, max_edge_m)
    rows = np.flatnonzero(near & ~small)
    # What is small needs no lengths of edges; it stays among the others that need no cut, in their order.
    lengths = _edges(todo[rows]).max(axis=1, initial=0.0)
    small[rows[lengths <= max_edge_m]] = True
    whose = [np.flatnonzero(near & small)]
    done = [todo[whose[0]]]
    rows = rows[lengths > max_edge_m]
    todo = todo[rows]
    edges = _edges(todo)
    while len(todo):
        every = np.arange(len(todo))
        i = edges.argmax(axis=1)
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b, c = todo[every, i], todo[every, j], todo[every, k]
        middle = (a + b) / 2
        todo = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        rows = np.concatenate([rows, rows])
        inside = ((todo.min(axis=1) <= upper) & (todo.max(axis=1) >= lower)).all(axis=1)
        todo, rows = todo[inside], rows[inside]
        edges = _edges(todo)
        short = edges.max(axis=1, initial=0.0) <= max_edge_m
        done.append(todo[short])
        whose.append(rows[short])
        todo, edges, rows = todo[~short], edges[~short], rows[~short]
    return np.concatenate(done).reshape(-1, 9), np.concatenate(whose)


def _edges(triangles: Floats) -> Floats:
    """Lengths of the edges of triangles (n, 3, 3), each from its own corner: (n, 3)."""
    return np.asarray(np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2))


@njit(cache=True)
def _within(triangles: Floats, lower: Floats, upper: Floats, longest: float) -> tuple[Flags, Flags]:
    """Which triangles have a box that touches a box, and which a box so small that no edge of theirs is longer."""
    near, small = np.ones(len(triangles), np.bool_), np.empty(len(triangles), np.bool_)
    for n in range(len(triangles)):
        t = triangles[n]
        across2 = 0.0
        for a in range(3):
            low, high = min(t[a], t[a + 3], t[a + 6]), max(t[a], t[a + 3], t[a + 6])
            near[n] &= low <= upper[a] and high >= lower[a]
            across2 += (high - low) * (high - low)
        small[n] = across2 < longest * longest * 0.999
    return near, small


@njit(cache=True)
def _interleaved(points: Floats, low: Floats, extent: float, most: int) -> NDArray[np.uint64]:
    out = np.empty(len(points), np.uint64)
    for n in range(len(points)):
        code = np.uint64(0)
        for axis in range(3):
            cell = np.uint64((points[n, axis] - low[axis]) / extent * most)
            # Two free bits after every one of 21.
            cell = (cell | cell << np.uint64(32)) & np.uint64(0x1F00000000FFFF)
            cell = (cell | cell << np.uint64(16)) & np.uint64(0x1F0000FF0000FF)
            cell = (cell | cell << np.uint64(8)) & np.uint64(0x100F00F00F00F00F)
            cell = (cell | cell << np.uint64(4)) & np.uint64(0x10C30C30C30C30C3)
            cell = (cell | cell << np.uint64(2)) & np.uint64(0x1249249249249249)
            code |= cell << np.uint64(axis)
        out[n] = code
    return out


def morton_codes(points: Floats, bits: int = 21) -> NDArray[np.uint64]:
    """Morton codes (n,) uint64 of points (n, 3) in their bounding cube, `bits` (at most 21) a coordinate."""
    low = points.min(axis=0)
    extent = max(float((points.max(axis=0) - low).max()), 1e-9)
    return np.asarray(_interleaved(np.ascontiguousarray(points, np.float64), low, extent, 2**bits - 1))
