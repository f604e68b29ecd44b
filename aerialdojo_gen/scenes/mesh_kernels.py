"""What meshes are made by: compiled, because meshes are many and small.

All sums have the order that NumPy's expressions over the components would have, so that the last bit stays.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Faces flatter than this (cosine of the slope) take their texture straight from above, so that a
# gently rolling surface shows no jump of the pattern between its triangles.
_FLAT_COSINE = 0.96


@njit(cache=True, error_model="numpy")
def face_areas(v: Floats, f: Ints) -> Floats:
    """Areas (m,) of faces (m, 3) over vertices (n, 3)."""
    out = np.empty(len(f))
    for n in range(len(f)):
        a, b, c = f[n, 0], f[n, 1], f[n, 2]
        ux, uy, uz = v[b, 0] - v[a, 0], v[b, 1] - v[a, 1], v[b, 2] - v[a, 2]
        wx, wy, wz = v[c, 0] - v[a, 0], v[c, 1] - v[a, 1], v[c, 2] - v[a, 2]
        x, y, z = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        out[n] = np.sqrt(x * x + y * y + z * z) / 2.0
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
        a, b, c = f[n, 0], f[n, 1], f[n, 2]
        x = v[b, 1] * v[c, 2] - v[b, 2] * v[c, 1]
        y = v[b, 2] * v[c, 0] - v[b, 0] * v[c, 2]
        z = v[b, 0] * v[c, 1] - v[b, 1] * v[c, 0]
        out[n] = v[a, 0] * x + v[a, 1] * y + v[a, 2] * z
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
        a, b, c = f[n, 0], f[n, 1], f[n, 2]
        ux, uy, uz = v[b, 0] - v[a, 0], v[b, 1] - v[a, 1], v[b, 2] - v[a, 2]
        wx, wy, wz = v[c, 0] - v[a, 0], v[c, 1] - v[a, 1], v[c, 2] - v[a, 2]
        x, y, z = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        length = max(np.sqrt(x * x + y * y + z * z), 1e-300)
        x, y, z = x / length, y / length, z / length
        if abs(z) > _FLAT_COSINE:
            sx, sy, sz = 1.0, 0.0, 0.0
            tx, ty, tz = 0.0, 1.0, 0.0
        else:
            sx, sy, sz = -y, x, 0.0
            length = max(np.sqrt(sx * sx + sy * sy + sz * sz), 1e-12)
            sx, sy, sz = sx / length, sy / length, sz / length
            tx, ty, tz = y * sz - z * sy, z * sx - x * sz, x * sy - y * sx
        for k in range(3):
            p = f[n, k]
            s = v[p, 0] * sx + v[p, 1] * sy + v[p, 2] * sz
            t = v[p, 0] * tx + v[p, 1] * ty + v[p, 2] * tz
            if len(given):
                s = s if np.isnan(given[n, k, 0]) else given[n, k, 0]
                t = t if np.isnan(given[n, k, 1]) else given[n, k, 1]
            uv[3 * n + k, 0], uv[3 * n + k, 1] = np.float32(s / tile_m), np.float32(t / tile_m)
    return uv
