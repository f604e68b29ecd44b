"""Vertices and faces of turned, swept and extruded bodies, compiled; sums in the order of NumPy's expressions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Triple = tuple[float, float, float]


@njit(cache=True, error_model="numpy")
def band_faces(rings: Ints, bands: int, u: Floats, v: Floats) -> tuple[Ints, Floats]:
    """Two triangles between neighbours of each ring (r, n) and the next, and texture coordinates (m, 3, 2) of them.

    `u` holds n + 1 coordinates around, `v` one more than bands along; a ring of one vertex has one triangle a side.
    """
    count, n = rings.shape
    faces, uv = np.empty((2 * bands * n, 3), np.int32), np.empty((2 * bands * n, 3, 2))
    m = 0
    for r in range(bands):
        after = (r + 1) % count
        for k in range(n):
            a, b = rings[r, k], rings[r, (k + 1) % n]
            c, d = rings[after, (k + 1) % n], rings[after, k]
            for upper in range(2):
                if (c == d) if upper else (a == b):
                    continue
                faces[m, 0], faces[m, 1], faces[m, 2] = a, (c if upper else b), (d if upper else c)
                uv[m, 0, 0], uv[m, 0, 1] = u[k], v[r]
                uv[m, 1, 0], uv[m, 1, 1] = u[k + 1], v[r + 1] if upper else v[r]
                uv[m, 2, 0], uv[m, 2, 1] = u[k] if upper else u[k + 1], v[r + 1]
                m += 1
    return faces[:m], uv[:m]


@njit(cache=True, error_model="numpy")
def limb_vertices(line: Floats, radii: Floats, rings: int, cos: Floats, sin: Floats) -> tuple[Floats, Floats]:
    """Rings of a limb along a line (n, 3), turned as little as can be one to the next; distances along it (n,)."""
    last, sides = len(line) - 1, len(cos)
    out = np.empty((rings * sides, 3))
    x, y, z = 1.0, 0.0, 0.0
    for i in range(rings):
        low, high = max(i - 1, 0), min(i + 1, last)
        tx, ty, tz = line[high, 0] - line[low, 0], line[high, 1] - line[low, 1], line[high, 2] - line[low, 2]
        if high - low == 2:
            tx, ty, tz = tx / 2.0, ty / 2.0, tz / 2.0
        length = np.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx / length, ty / length, tz / length
        if i == 0 and not abs(tx) < 0.9:
            x, y = 0.0, 1.0
        along = x * tx + y * ty + z * tz
        x, y, z = x - tx * along, y - ty * along, z - tz * along
        length = np.sqrt(x * x + y * y + z * z)
        x, y, z = x / length, y / length, z / length
        ox, oy, oz = ty * z - tz * y, tz * x - tx * z, tx * y - ty * x
        for k in range(sides):
            out[i * sides + k, 0] = line[i, 0] + radii[i] * (cos[k] * x + sin[k] * ox)
            out[i * sides + k, 1] = line[i, 1] + radii[i] * (cos[k] * y + sin[k] * oy)
            out[i * sides + k, 2] = line[i, 2] + radii[i] * (cos[k] * z + sin[k] * oz)
    along = np.zeros(len(line))
    for i in range(last):
        x, y, z = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1], line[i + 1, 2] - line[i, 2]
        along[i + 1] = along[i] + np.sqrt(x * x + y * y + z * z)
    return out, along


@njit(cache=True, error_model="numpy")
def _dot(a: Triple, b: Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy")
def _unit(v: Triple) -> Triple:
    length = np.sqrt(_dot(v, v))
    return v[0] / length, v[1] / length, v[2] / length


@njit(cache=True, error_model="numpy")
def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def _beside(a: Triple, b: Triple) -> Triple:
    """What is left of one vector beside another, of length 1."""
    along = _dot(a, b)
    return a[0] - b[0] * along, a[1] - b[1] * along, a[2] - b[2] * along


@njit(cache=True, error_model="numpy")
def _ahead(line: Floats, i: int, closed: bool) -> Triple:
    """Direction of a path after its point i."""
    n = len(line)
    a, b = (n - 2, n - 1) if i == n - 1 and not closed else (i, (i + 1) % n)
    return _unit((line[b, 0] - line[a, 0], line[b, 1] - line[a, 1], line[b, 2] - line[a, 2]))


@njit(cache=True, error_model="numpy")
def swept_rings(line: Floats, ring: Floats, closed: bool) -> Floats:
    """Rings (n, k, 3) of a section (k, 2) at the points of a path (n, 3); none where it turns back on itself."""
    n = len(line)
    out = np.empty((n, len(ring), 3))
    right = (0.0, -1.0, 0.0)
    for i in range(n):
        after = _ahead(line, i, closed)
        before = after if i == 0 and not closed else _ahead(line, (i - 1) % n, closed)
        middle = (before[0] + after[0], before[1] + after[1], before[2] + after[2])
        if np.sqrt(_dot(middle, middle)) < 1e-6:
            return out[:0]
        middle = _unit(middle)
        level = _cross(middle, (0.0, 0.0, 1.0))
        # Nearly vertical stretches have no level direction of their own: carry the last one on.
        right = _unit(level if np.sqrt(_dot(level, level)) > 0.1 else _beside(right, middle))
        above = _cross(right, middle)
        bend = _beside((after[0] - before[0], after[1] - before[1], after[2] - before[2]), middle)
        bends, stretch = np.sqrt(_dot(bend, bend)) > 1e-9, 0.0
        if bends:
            bend = _unit(bend)
            stretch = min(1.0 / max(_dot(middle, after), 0.1), 2.5) - 1.0
        for k in range(len(ring)):
            x = ring[k, 0] * right[0] + ring[k, 1] * above[0]
            y = ring[k, 0] * right[1] + ring[k, 1] * above[1]
            z = ring[k, 0] * right[2] + ring[k, 1] * above[2]
            if bends:
                out_by = stretch * _dot((x, y, z), bend)
                x, y, z = x + out_by * bend[0], y + out_by * bend[1], z + out_by * bend[2]
            out[i, k, 0], out[i, k, 1], out[i, k, 2] = line[i, 0] + x, line[i, 1] + y, line[i, 2] + z
    return out


@njit(cache=True, error_model="numpy")
def extruded(flat: Floats, starts: NDArray[np.int64], corners: Floats, height: float) -> tuple[Floats, Ints, Floats]:
    """Vertices, faces and texture coordinates of a polygon's walls and its lids, of triangles (m, 4, 2).

    `starts` says where the rings begin in `flat`, (n, 2), and where the last ends. No faces come back where a corner
    is no vertex.
    """
    n, lids = len(flat), len(corners)
    vertices = np.empty((2 * n, 3))
    for i in range(n):
        vertices[i, 0] = vertices[n + i, 0] = flat[i, 0]
        vertices[i, 1] = vertices[n + i, 1] = flat[i, 1]
        vertices[i, 2], vertices[n + i, 2] = 0.0, height
    faces, uv = np.empty((2 * lids + 2 * n, 3), np.int32), np.full((2 * lids + 2 * n, 3, 2), np.nan)
    for m in range(lids):
        for k in range(3):
            # Two vertices may lie at one place: the last one is taken.
            at = n - 1
            while at >= 0 and (flat[at, 0] != corners[m, k, 0] or flat[at, 1] != corners[m, k, 1]):
                at -= 1
            if at < 0:
                return vertices, faces[:0], uv[:0]
            faces[lids + m, k] = n + at
        a, b, c = corners[m, 0], corners[m, 1], corners[m, 2]
        if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0:
            faces[lids + m, 0], faces[lids + m, 2] = faces[lids + m, 2], faces[lids + m, 0]
        for k in range(3):
            faces[m, k] = faces[lids + m, 2 - k] - n
    first = 2 * lids
    for ring in range(len(starts) - 1):
        start, count = starts[ring], starts[ring + 1] - starts[ring]
        end = 0.0
        for i in range(count):
            a, b = start + i, start + (i + 1) % count
            dx, dy = flat[b, 0] - flat[a, 0], flat[b, 1] - flat[a, 1]
            length = np.sqrt(dx * dx + dy * dy)
            end += length
            begin = end - length
            low, high = first + i, first + count + i
            faces[low, 0], faces[low, 1], faces[low, 2] = a, b, b + n
            faces[high, 0], faces[high, 1], faces[high, 2] = a, b + n, a + n
            uv[low, 0, 0], uv[low, 1, 0], uv[low, 2, 0] = begin, end, end
            uv[low, 0, 1], uv[low, 1, 1], uv[low, 2, 1] = 0.0, 0.0, height
            uv[high, 0, 0], uv[high, 1, 0], uv[high, 2, 0] = begin, end, begin
            uv[high, 0, 1], uv[high, 1, 1], uv[high, 2, 1] = 0.0, height, height
        first += 2 * count
    return vertices, faces, uv
