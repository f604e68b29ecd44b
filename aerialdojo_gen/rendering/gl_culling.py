"""Culling for the views of one eye: triangles that face it, lie in the picture and cover a pixel's centre.

The views of a pose share their eye, and so the order of the chunks and the facing of triangles: both are computed
once for all four.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.rendering.gl_tiles import cover, hidden

Floats = NDArray[np.float64]

# Corners nearer than this are not projected; and OpenGL's rounding of corners, pixels.
NEAR_W, ROUNDING_PX = 0.05, 0.02


@njit(cache=True)
def chunks_in_view(
    low: Floats, high: Floats, eye: Floats, clips: Floats
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Chunks in at least one view frustum, nearest first, and whether each is in each view, (m, v) bool."""
    in_view = _boxes_in_view(low, high, clips)
    found, away = np.empty(len(low), np.int64), np.empty(len(low), np.float64)
    n = 0
    for k in range(len(low)):
        in_any_view = False
        for v in range(len(clips)):
            in_any_view |= in_view[k, v]
        if in_any_view:
            x = max(low[k, 0] - eye[0], 0.0) + max(eye[0] - high[k, 0], 0.0)
            y = max(low[k, 1] - eye[1], 0.0) + max(eye[1] - high[k, 1], 0.0)
            z = max(low[k, 2] - eye[2], 0.0) + max(eye[2] - high[k, 2], 0.0)
            found[n], away[n] = k, x * x + y * y + z * z
            n += 1
    # Stable, for boxes that are equally near.
    order = found[:n][np.argsort(away[:n], kind="mergesort")]
    return order, in_view[order]


@njit(cache=True)
def _boxes_in_view(low: Floats, high: Floats, clips: Floats) -> NDArray[np.bool_]:
    out = np.ones((len(low), len(clips)), dtype=np.bool_)
    for v in range(len(clips)):
        w = clips[v, 3]
        # A point is in view where -w <= x, y <= w and z >= -w in clip coordinates.
        for row, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0)):
            a, b, c, d = w + sign * clips[v, row]
            for k in range(len(low)):
                # The box's corner farthest along the side's normal is the one that would be inside.
                reach = a * (high[k, 0] if a > 0.0 else low[k, 0]) + b * (high[k, 1] if b > 0.0 else low[k, 1])
                out[k, v] &= reach + c * (high[k, 2] if c > 0.0 else low[k, 2]) + d > 0.0
    return out


@njit(cache=True, fastmath={"contract", "arcp", "nsz"})
def triangles_in_view(
    order: NDArray[np.int64], in_view: NDArray[np.bool_], starts: NDArray[np.int64], planes: Floats,
    corners: NDArray[np.float32], clips: Floats, eye: Floats, low: Floats, high: Floats, hides: bool, width: int,
    height: int, whole: NDArray[np.float32], part: NDArray[np.float32], covered: NDArray[np.uint64],
) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:  # fmt: skip
    """Cull the triangles of every view: vertex indices (v, 3 max_triangles) uint32, by chunk, and their counts."""
    views = len(clips)
    max_triangles = 0
    for chunk in order:
        max_triangles += starts[chunk + 1] - starts[chunk]
    out = np.empty((views, 3 * max_triangles), dtype=np.uint32)
    count = np.zeros(views, dtype=np.int64)
    half_w, half_h = 0.5 * width, 0.5 * height
    visible_in = np.empty(views, dtype=np.bool_)
    for c in range(len(order)):
        chunk, in_any_view = order[c], False
        for v in range(views):
            visible_in[v] = in_view[c, v] and not _box_hidden(
                low[chunk], high[chunk], clips[v], width, height, whole[v]
            )
            in_any_view |= visible_in[v]
        if not in_any_view:
            continue
        for t in range(starts[chunk], starts[chunk + 1]):
            if planes[t, 0] * eye[0] + planes[t, 1] * eye[1] + planes[t, 2] * eye[2] + planes[t, 3] <= 0.0:
                continue
            ax, ay, az = corners[t, 0] - eye[0], corners[t, 1] - eye[1], corners[t, 2] - eye[2]
            bx, by, bz = corners[t, 3] - eye[0], corners[t, 4] - eye[1], corners[t, 5] - eye[2]
            cx, cy, cz = corners[t, 6] - eye[0], corners[t, 7] - eye[1], corners[t, 8] - eye[2]
            for v in range(views):
                if not visible_in[v]:
                    continue
                # Seen from the eye, x, y and w have no constant part.
                m0, m1, m2 = clips[v, 3, 0], clips[v, 3, 1], clips[v, 3, 2]
                aw, bw, cw = m0 * ax + m1 * ay + m2 * az, m0 * bx + m1 * by + m2 * bz, m0 * cx + m1 * cy + m2 * cz
                if aw < NEAR_W and bw < NEAR_W and cw < NEAR_W:
                    continue
                m0, m1, m2 = clips[v, 0, 0], clips[v, 0, 1], clips[v, 0, 2]
                au, bu, cu = m0 * ax + m1 * ay + m2 * az, m0 * bx + m1 * by + m2 * bz, m0 * cx + m1 * cy + m2 * cz
                if (au > aw and bu > bw and cu > cw) or (au < -aw and bu < -bw and cu < -cw):
                    continue
                m0, m1, m2 = clips[v, 1, 0], clips[v, 1, 1], clips[v, 1, 2]
                av, bv, cv = m0 * ax + m1 * ay + m2 * az, m0 * bx + m1 * by + m2 * bz, m0 * cx + m1 * cy + m2 * cz
                if (av > aw and bv > bw and cv > cw) or (av < -aw and bv < -bw and cv < -cw):
                    continue
                if aw >= NEAR_W and bw >= NEAR_W and cw >= NEAR_W:
                    aw, bw, cw = 1.0 / aw, 1.0 / bw, 1.0 / cw
                    au, bu, cu = _pixel(au * aw, half_w), _pixel(bu * bw, half_w), _pixel(cu * cw, half_w)
                    left, right = _centres(au, bu, cu, width)
                    if left > right:
                        continue
                    av, bv, cv = _pixel(av * aw, half_h), _pixel(bv * bw, half_h), _pixel(cv * cw, half_h)
                    top, bottom = _centres(av, bv, cv, height)
                    if top > bottom or hidden(left, right, top, bottom, max(aw, bw, cw), whole[v]):
                        continue
                    if hides:
                        cover(
                            au, av, aw, bu, bv, bw, cu, cv, cw, left, right, top, bottom, width, height,
                            whole[v], part[v], covered[v],
                        )  # fmt: skip
                n = count[v]
                out[v, n], out[v, n + 1], out[v, n + 2] = 3 * t, 3 * t + 1, 3 * t + 2
                count[v] = n + 3
    return out, count


@njit(cache=True, inline="always")
def _pixel(place: float, half: float) -> float:
    """From -1 to 1 across the picture, to pixels, centres at whole numbers."""
    return (place + 1.0) * half - 0.5


@njit(cache=True, inline="always")
def _centres(a: float, b: float, c: float, size: int) -> tuple[int, int]:
    """First and last pixel whose centre may lie between three places; the first is the larger where none does."""
    return max(math.ceil(min(a, b, c) - ROUNDING_PX), 0), min(math.floor(max(a, b, c) + ROUNDING_PX), size - 1)


@njit(cache=True, error_model="numpy")
def _box_hidden(low: Floats, high: Floats, m: Floats, width: int, height: int, whole: NDArray[np.float32]) -> bool:
    """Whether a box lies behind the occluders at every pixel centre that it could cover."""
    left, right, top, bottom, nearest = box_pixels(low, high, m, width, height)
    return left > right or top > bottom or hidden(left, right, top, bottom, nearest, whole)


@njit(cache=True, error_model="numpy")
def box_pixels(low: Floats, high: Floats, m: Floats, width: int, height: int) -> tuple[int, int, int, int, float]:
    """Columns and rows of pixels that a box could cover, and the inverse depth of its nearest corner."""
    u0, u1, v0, v1, nearest = np.inf, -np.inf, np.inf, -np.inf, np.inf
    for corner in range(8):
        x = high[0] if corner & 1 else low[0]
        y = high[1] if corner & 2 else low[1]
        z = high[2] if corner & 4 else low[2]
        w = m[3, 0] * x + m[3, 1] * y + m[3, 2] * z + m[3, 3]
        if w < NEAR_W:
            return 0, width - 1, 0, height - 1, np.inf
        u = _pixel((m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3]) / w, 0.5 * width)
        v = _pixel((m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3]) / w, 0.5 * height)
        u0, u1, v0, v1, nearest = min(u0, u), max(u1, u), min(v0, v), max(v1, v), min(nearest, w)
    left, right = max(math.ceil(u0 - ROUNDING_PX), 0), min(math.floor(u1 + ROUNDING_PX), width - 1)
    top, bottom = max(math.ceil(v0 - ROUNDING_PX), 0), min(math.floor(v1 + ROUNDING_PX), height - 1)
    return left, right, top, bottom, 1.0 / nearest
