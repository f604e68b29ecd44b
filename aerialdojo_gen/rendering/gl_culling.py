"""Culling for the views of one eye: what faces it, covers a pixel's centre and lies behind nothing drawn before.

OpenGL in software takes a microsecond for a triangle, however few pixels of it are visible. So triangles are drawn
here first, nearest first and depth only, and what lies entirely behind them is culled, whole chunks at once. Views
of a pose share their eye, and so the order of the chunks and the facing of triangles: both are computed once for all.
Margins exceed OpenGL's rounding, so the pictures do not change by a bit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats, Ints, Singles
from aerialdojo_gen.rendering.picture import NEAR_M

# Triangles of a chunk: loops have that constant length for vectorisation.
CHUNK_TRIANGLES = _SIZE = 96
# Corners nearer than this are not projected; and OpenGL's rounding of corners, pixels.
_NEAR_W, _ROUNDING_PX = 0.05, 0.02
# How far OpenGL moves a corner at most, pixels: it counts them in 256ths; and how much nearer something must be to
# hide another, in inverse metres: several steps of the depth buffer.
_MOVED_PX, _NEARER = 0.004, 1e-5
# Triangles in front of OpenGL's near plane hide nothing.
_NEAREST = 1.0 / NEAR_M


@njit(cache=True, error_model="numpy")
def visible_triangles(
    starts: Ints, low: Floats, high: Floats, planes: Floats, corners: Singles, hides: bool,
    clips: Floats, eye: Floats, nearness: Singles, out: NDArray[np.uint32],
) -> Ints:  # fmt: skip
    """Write the indices of vertices that the views show into `out` (views, n), by chunk; return how many in each.

    Triangles are drawn into the views' inverse depths `nearness` (views, H, W) if they hide what is behind them.
    """
    views, height, width = nearness.shape
    order, in_view = _chunks_in_view(low, high, eye, clips)
    counts = np.zeros(views, np.int64)
    facing, places, boxes = np.empty(_SIZE), np.empty(12 * _SIZE), np.empty(5 * _SIZE)
    kept = np.empty(_SIZE, np.int64)
    for n in range(len(order)):
        chunk, faced = order[n], False
        first = starts[chunk]
        for v in range(views):
            if not in_view[n, v] or _box_hidden(low[chunk], high[chunk], clips[v], nearness[v]):
                continue
            if not faced:
                _face(planes[chunk], eye[0], eye[1], eye[2], facing)
                faced = True
            for corner in range(3):
                _project(corners[chunk, 3 * corner * _SIZE :], clips[v], width, height, places[4 * corner * _SIZE :])
            at = counts[v]
            for k in range(_choose(starts[chunk + 1] - first, facing, places, width, height, boxes, kept)):
                i = kept[k]
                w0, w1, w2 = places[i], places[4 * _SIZE + i], places[8 * _SIZE + i]
                if min(w0, min(w1, w2)) >= _NEAR_W and not _covers(
                    places[_SIZE + i], places[2 * _SIZE + i], places[3 * _SIZE + i],
                    places[5 * _SIZE + i], places[6 * _SIZE + i], places[7 * _SIZE + i],
                    places[9 * _SIZE + i], places[10 * _SIZE + i], places[11 * _SIZE + i],
                    int(boxes[i]), int(boxes[_SIZE + i]), int(boxes[2 * _SIZE + i]), int(boxes[3 * _SIZE + i]),
                    hides, nearness[v],
                ):  # fmt: skip
                    continue
                t = 3 * (first + i)
                out[v, at], out[v, at + 1], out[v, at + 2] = t, t + 1, t + 2
                at += 3
            counts[v] = at
    return counts


@njit(cache=True)
def _chunks_in_view(low: Floats, high: Floats, eye: Floats, clips: Floats) -> tuple[Ints, Flags]:
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
def _boxes_in_view(low: Floats, high: Floats, clips: Floats) -> Flags:
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


@njit(cache=True, error_model="numpy")
def _box_hidden(low: Floats, high: Floats, m: Floats, nearness: Singles) -> bool:
    """Whether a box lies behind the occluders at every pixel centre that it could cover."""
    height, width = nearness.shape
    u0, u1, v0, v1, nearest = np.inf, -np.inf, np.inf, -np.inf, np.inf
    for corner in range(8):
        x = high[0] if corner & 1 else low[0]
        y = high[1] if corner & 2 else low[1]
        z = high[2] if corner & 4 else low[2]
        w = m[3, 0] * x + m[3, 1] * y + m[3, 2] * z + m[3, 3]
        if w < _NEAR_W:
            return False
        u = ((m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3]) / w + 1.0) * (0.5 * width) - 0.5
        v = ((m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3]) / w + 1.0) * (0.5 * height) - 0.5
        u0, u1, v0, v1, nearest = min(u0, u), max(u1, u), min(v0, v), max(v1, v), min(nearest, w)
    limit = np.float32(1.0 / nearest + _NEARER)
    for row in range(max(math.ceil(v0 - _ROUNDING_PX), 0), min(math.floor(v1 + _ROUNDING_PX), height - 1) + 1):
        for column in range(max(math.ceil(u0 - _ROUNDING_PX), 0), min(math.floor(u1 + _ROUNDING_PX), width - 1) + 1):
            if nearness[row, column] <= limit:
                return False
    return True


@njit(cache=True)
def _face(planes: Floats, x: float, y: float, z: float, facing: Floats) -> None:
    """Write the signed distances of a point from the planes of a chunk's triangles, scaled."""
    for i in range(_SIZE):
        facing[i] = planes[i] * x + planes[i + _SIZE] * y + planes[i + 2 * _SIZE] * z + planes[i + 3 * _SIZE]


@njit(cache=True, error_model="numpy")
def _project(corners: Singles, m: Floats, width: int, height: int, places: Floats) -> None:
    """Project a corner of all triangles of a chunk: w, then the pixel, its centre at whole numbers, and 1 / w."""
    half_w, half_h = 0.5 * width, 0.5 * height
    a0, a1, a2, a3 = m[0, 0], m[0, 1], m[0, 2], m[0, 3]
    b0, b1, b2, b3 = m[1, 0], m[1, 1], m[1, 2], m[1, 3]
    d0, d1, d2, d3 = m[3, 0], m[3, 1], m[3, 2], m[3, 3]
    for i in range(_SIZE):
        x, y, z = corners[i], corners[i + _SIZE], corners[i + 2 * _SIZE]
        w = d0 * x + d1 * y + d2 * z + d3
        inverse = 1.0 / w
        places[i] = w
        places[i + _SIZE] = ((a0 * x + a1 * y + a2 * z + a3) * inverse + 1.0) * half_w - 0.5
        places[i + 2 * _SIZE] = ((b0 * x + b1 * y + b2 * z + b3) * inverse + 1.0) * half_h - 0.5
        places[i + 3 * _SIZE] = inverse


@njit(cache=True)
def _choose(n: int, facing: Floats, places: Floats, width: int, height: int, boxes: Floats, kept: Ints) -> int:
    """Write which triangles face the eye and could cover a pixel's centre, without a branch; return how many.

    A triangle that reaches nearer than is projected is kept, one that lies there is not. The first and last column
    and row of pixels that a triangle could cover go into the boxes.
    """
    for i in range(_SIZE):
        u0, u1, u2 = places[_SIZE + i], places[5 * _SIZE + i], places[9 * _SIZE + i]
        v0, v1, v2 = places[2 * _SIZE + i], places[6 * _SIZE + i], places[10 * _SIZE + i]
        w0, w1, w2 = places[i], places[4 * _SIZE + i], places[8 * _SIZE + i]
        left = max(np.ceil(min(u0, min(u1, u2)) - _ROUNDING_PX), 0.0)
        right = min(np.floor(max(u0, max(u1, u2)) + _ROUNDING_PX), width - 1.0)
        top = max(np.ceil(min(v0, min(v1, v2)) - _ROUNDING_PX), 0.0)
        bottom = min(np.floor(max(v0, max(v1, v2)) + _ROUNDING_PX), height - 1.0)
        boxes[i], boxes[_SIZE + i], boxes[2 * _SIZE + i], boxes[3 * _SIZE + i] = left, right, top, bottom
        covers = ((left <= right) & (top <= bottom)) | (min(w0, min(w1, w2)) < _NEAR_W)
        keep = covers & (facing[i] > 0.0) & (max(w0, max(w1, w2)) >= _NEAR_W)
        boxes[4 * _SIZE + i] = 1.0 if keep else 0.0
    k = 0
    for i in range(n):
        kept[k] = i
        k += boxes[4 * _SIZE + i] > 0.0
    return k


@njit(cache=True, error_model="numpy")
def _covers(
    u0: float, v0: float, n0: float, u1: float, v1: float, n1: float, u2: float, v2: float, n2: float,
    left: int, right: int, top: int, bottom: int, hides: bool, nearness: Singles,
) -> bool:  # fmt: skip
    """Whether a triangle may be visible at a pixel's centre; if it hides, raises the nearness in its interior.

    Corners are in pixels, with their inverse depth, which is linear over the picture.
    """
    a0, b0, a1, b1, a2, b2 = u1 - u0, v1 - v0, u2 - u1, v2 - v1, u0 - u2, v0 - v2
    area = a0 * b1 - b0 * a1
    if area < 0.0:
        a0, b0, a1, b1, a2, b2 = -a0, -b0, -a1, -b1, -a2, -b2
    # Maximum change of an edge's function by a moved corner.
    s0, s1, s2 = _MOVED_PX * (abs(a0) + abs(b0)), _MOVED_PX * (abs(a1) + abs(b1)), _MOVED_PX * (abs(a2) + abs(b2))
    flat = abs(area) < 1e-9
    dx = 0.0 if flat else ((n1 - n0) * (v2 - v0) - (n2 - n0) * (v1 - v0)) / area
    dy = 0.0 if flat else ((n2 - n0) * (u1 - u0) - (n1 - n0) * (u2 - u0)) / area
    min_depth, max_depth = min(n0, min(n1, n2)), max(n0, max(n1, n2))
    if flat:
        min_depth = max_depth
    slack = _NEARER + _MOVED_PX * (abs(dx) + abs(dy))
    hides, seen = hides and not flat and max_depth <= _NEAREST, False
    i0, i1, i2 = 1.0 / b0, 1.0 / b1, 1.0 / b2
    for y in range(top, bottom + 1):
        span = float(left), float(right), left - 0.5, right + 0.5
        span = _clip_span(a0 * (y - v0) + b0 * u0, b0, i0, s0, span)
        span = _clip_span(a1 * (y - v1) + b1 * u1, b1, i1, s1, span)
        span = _clip_span(a2 * (y - v2) + b2 * u2, b2, i2, s2, span)
        first, last = math.ceil(span[0] - 1e-6), math.floor(span[1] + 1e-6)
        row = n0 - dx * u0 + dy * (y - v0)
        if not seen:
            for x in range(first, last + 1):
                if min(max(row + dx * x, min_depth), max_depth) + slack >= nearness[y, x]:
                    seen = True
                    break
        if not seen:
            # This row is behind the occluders.
            continue
        if not hides:
            return True
        for x in range(math.ceil(span[2] + 1e-6), math.floor(span[3] - 1e-6) + 1):
            depth = min(max(row + dx * x, min_depth), max_depth) - slack
            if depth > nearness[y, x]:
                nearness[y, x] = depth
    return seen


@njit(cache=True, error_model="numpy", inline="always")
def _clip_span(
    r: float, b: float, inverse: float, s: float, span: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    """Clip a row of pixels to the inner side of an edge, where r - b x is positive.

    The first two bounds are outer, the others inner bounds; s is the change by moved corners. A difference of a
    millionth of a pixel is within s.
    """
    first, last, sure_first, sure_last = span
    if b > 0.0:
        last, sure_last = min(last, (r + s) * inverse), min(sure_last, (r - s) * inverse)
    elif b < 0.0:
        first, sure_first = max(first, (r + s) * inverse), max(sure_first, (r - s) * inverse)
    else:
        if r + s < 0.0:
            last = -1.0
        if r - s <= 0.0:
            sure_last = -1.0
    return first, last, sure_first, sure_last
