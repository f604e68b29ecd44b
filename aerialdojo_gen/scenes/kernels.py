"""What meshes are made by, compiled, because they are many and small: bodies, textures, places.

All sums have the order that NumPy's expressions over the components would have, so that the last bit stays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Triple = tuple[float, float, float]


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
def _rejected(a: Triple, b: Triple) -> Triple:
    """The part of a vector at right angles to another, of length 1 (its rejection)."""
    along = _dot(a, b)
    return a[0] - b[0] * along, a[1] - b[1] * along, a[2] - b[2] * along


@njit(cache=True, error_model="numpy")
def _minus(v: Floats, a: int, b: int) -> Triple:
    """From vertex b to vertex a."""
    return v[a, 0] - v[b, 0], v[a, 1] - v[b, 1], v[a, 2] - v[b, 2]


@njit(cache=True, error_model="numpy")
def _vertex(v: Floats, a: int) -> Triple:
    return v[a, 0], v[a, 1], v[a, 2]


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
    side = (1.0, 0.0, 0.0)
    for i in range(rings):
        low, high = max(i - 1, 0), min(i + 1, last)
        way = _minus(line, high, low)
        if high - low == 2:
            way = way[0] / 2.0, way[1] / 2.0, way[2] / 2.0
        way = _unit(way)
        if i == 0 and not abs(way[0]) < 0.9:
            side = (0.0, 1.0, side[2])
        side = _unit(_rejected(side, way))
        other = _cross(way, side)
        for k in range(sides):
            for j in range(3):
                out[i * sides + k, j] = line[i, j] + radii[i] * (cos[k] * side[j] + sin[k] * other[j])
    along = np.zeros(len(line))
    for i in range(last):
        step = _minus(line, i + 1, i)
        along[i + 1] = along[i] + np.sqrt(_dot(step, step))
    return out, along


@njit(cache=True, error_model="numpy")
def _ahead(line: Floats, i: int, closed: bool) -> Triple:
    """Direction of a path after its point i."""
    n = len(line)
    a, b = (n - 2, n - 1) if i == n - 1 and not closed else (i, (i + 1) % n)
    return _unit(_minus(line, b, a))


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
        right = _unit(level if np.sqrt(_dot(level, level)) > 0.1 else _rejected(right, middle))
        above = _cross(right, middle)
        bend = _rejected((after[0] - before[0], after[1] - before[1], after[2] - before[2]), middle)
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


# Faces flatter than this (cosine of the slope) take their texture straight from above, so that a
# gently rolling surface shows no jump of the pattern between its triangles.
_FLAT_COSINE = 0.96


@njit(cache=True, error_model="numpy")
def _normal(v: Floats, f: Ints, n: int) -> Triple:
    return _cross(_minus(v, f[n, 1], f[n, 0]), _minus(v, f[n, 2], f[n, 0]))


@njit(cache=True, error_model="numpy")
def face_areas(v: Floats, f: Ints) -> Floats:
    """Areas (m,) of faces (m, 3) over vertices (n, 3)."""
    out = np.empty(len(f))
    for n in range(len(f)):
        normal = _normal(v, f, n)
        out[n] = np.sqrt(_dot(normal, normal)) / 2.0
    return out


@njit(cache=True, error_model="numpy")
def larger_faces(v: Floats, f: Ints, least: float) -> tuple[NDArray[np.bool_], bool]:
    """Which faces have more than the least area, and whether all have."""
    size = face_areas(v, f)
    keep = np.empty(len(f), np.bool_)
    every = True
    for n in range(len(f)):
        keep[n] = size[n] > least
        every = every and keep[n]
    return keep, every


@njit(cache=True, error_model="numpy")
def placed_vertices(
    v: Floats, f: Ints, scale: float, turn: Floats, offset: Floats
) -> tuple[Floats, NDArray[np.bool_], int]:
    """Vertices scaled, turned, moved and rounded to float32; which faces have an area, and how many."""
    out = np.empty((len(v), 3))
    for i in range(len(v)):
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += (v[i, k] * scale) * turn[k, j]
            out[i, j] = np.float64(np.float32(total + offset[j]))
    size = face_areas(out, f)
    solid = np.empty(len(f), np.bool_)
    count = 0
    for n in range(len(f)):
        solid[n] = size[n] > 0.0
        count += solid[n]
    return out, solid, count


@njit(cache=True, error_model="numpy")
def volume_terms(v: Floats, f: Ints) -> Floats:
    """Six times the signed volumes (m,) between the origin and each face."""
    out = np.empty(len(f))
    for n in range(len(f)):
        out[n] = _dot(_vertex(v, f[n, 0]), _cross(_vertex(v, f[n, 1]), _vertex(v, f[n, 2])))
    return out


@njit(cache=True, error_model="numpy")
def textured(v: Floats, f: Ints, given: Floats, tile_m: float) -> tuple[Floats, Ints, NDArray[np.float32]]:
    """Vertices, faces and texture coordinates of a mesh whose vertices have one pair of coordinates each.

    `given`, (m, 3, 2) in metres or empty, says them where it is a number; elsewhere they are projected.
    """
    uv = _texture_places(v, f, given, tile_m)
    corners = f.size
    keys = np.empty((corners, 2), np.int64)
    for i in range(corners):
        for j in range(2):
            keys[i, j] = np.int64(np.rint(uv[i, j] * np.float32(4096.0)))
    order, start = _by_vertex(f, len(v), keys)
    index = np.empty(corners, np.int32)
    first = np.empty(corners, np.int64)
    count = 0
    for vertex in range(len(v)):
        for at in range(start[vertex], start[vertex + 1]):
            i, before = order[at], order[at - 1]
            if at == start[vertex] or keys[i, 0] != keys[before, 0] or keys[i, 1] != keys[before, 1]:
                first[count] = i
                count += 1
            index[i] = count - 1
    vertices, places = np.empty((count, 3)), np.empty((count, 2), np.float32)
    for n in range(count):
        i = first[n]
        for j in range(3):
            vertices[n, j] = v[f[i // 3, i % 3], j]
        places[n, 0], places[n, 1] = uv[i, 0], uv[i, 1]
    return vertices, index.reshape(-1, 3), places


@njit(cache=True, error_model="numpy")
def _by_vertex(f: Ints, vertices: int, keys: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Corners by vertex, then by keys, then as they come; and where those of each vertex start."""
    start = np.zeros(vertices + 1, np.int64)
    for i in range(f.size):
        start[f[i // 3, i % 3] + 1] += 1
    for vertex in range(vertices):
        start[vertex + 1] += start[vertex]
    order, filled = np.empty(f.size, np.int64), np.zeros(vertices, np.int64)
    for i in range(f.size):
        vertex = f[i // 3, i % 3]
        low, at = start[vertex], start[vertex] + filled[vertex]
        filled[vertex] += 1
        while at > low:
            before = order[at - 1]
            if keys[before, 0] < keys[i, 0] or (keys[before, 0] == keys[i, 0] and keys[before, 1] <= keys[i, 1]):
                break
            order[at] = before
            at -= 1
        order[at] = i
    return order, start


@njit(cache=True, error_model="numpy")
def _texture_places(v: Floats, f: Ints, given: Floats, tile_m: float) -> NDArray[np.float32]:
    """Texture coordinates of every corner, in tiles."""
    uv = np.empty((f.size, 2), np.float32)
    for n in range(len(f)):
        normal = _normal(v, f, n)
        length = max(np.sqrt(_dot(normal, normal)), 1e-300)
        normal = normal[0] / length, normal[1] / length, normal[2] / length
        across, up = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
        if not abs(normal[2]) > _FLAT_COSINE:
            across = (-normal[1], normal[0], 0.0)
            length = max(np.sqrt(_dot(across, across)), 1e-12)
            across = across[0] / length, across[1] / length, across[2] / length
            up = _cross(normal, across)
        for k in range(3):
            p = _vertex(v, f[n, k])
            s, t = _dot(p, across), _dot(p, up)
            if len(given):
                s = s if np.isnan(given[n, k, 0]) else given[n, k, 0]
                t = t if np.isnan(given[n, k, 1]) else given[n, k, 1]
            uv[3 * n + k, 0], uv[3 * n + k, 1] = np.float32(s / tile_m), np.float32(t / tile_m)
    return uv
