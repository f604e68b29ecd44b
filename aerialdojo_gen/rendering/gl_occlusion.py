"""Occlusion culling for all cameras of a body in one pass: they share their centre.

OpenGL in software takes a microsecond for a triangle, however few pixels of it are visible, and a small picture has
few pixels. So triangles are first drawn here, nearest first and depth only, and what lies entirely behind them is
culled, whole chunks at once. Margins exceed OpenGL's rounding, so the pictures do not change.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.rendering.gl_culling import NEAR_W, ROUNDING_PX, box_pixels, chunks_in_view
from aerialdojo_gen.rendering.gl_geometry import CHUNK_TRIANGLES, Chunks
from aerialdojo_gen.rendering.gl_tiles import MOVED_PX, NEARER, NEAREST, Tiles

Floats = NDArray[np.float64]

# Triangles per loop, padded to a constant length for vectorisation.
_SIZE = CHUNK_TRIANGLES


class BodyCulling:
    """Culls the triangles of one kind of surface for the views of a body."""

    def __init__(self, chunks: Chunks, hides: bool = True) -> None:
        self._chunks = chunks
        self._hides = hides
        self._out = np.empty((0, 0), np.uint32)
        self._planes, self._corners = _blocks(chunks.planes, chunks.starts), _blocks(chunks.corners, chunks.starts)

    def visible_indices(
        self, clips: Floats, eye: Floats, width: int, height: int, nearness: NDArray[np.float32]
    ) -> list[NDArray[np.uint32]]:
        """Vertex indices (3 k,) of every view, nearest first; valid until the next call; raises `nearness`."""
        c = self._chunks
        if not self._hides:
            return c.visible_indices(clips, eye, Tiles.empty(len(clips), width, height), hides=False)
        if len(self._out) < len(clips):
            self._out = np.empty((len(clips), len(c.vertices)), np.uint32)
        counts = _visible_triangles(
            c.starts, self._planes, self._corners, clips, eye, c.low, c.high, nearness, self._out
        )
        return [self._out[v, :n] for v, n in enumerate(counts.tolist())]


def _blocks(rows: NDArray[Any], starts: NDArray[np.int64]) -> NDArray[Any]:
    """Lay triangles' rows out by chunk, field and triangle, for vectorised loops."""
    out = np.zeros((len(starts) - 1, rows.shape[1], CHUNK_TRIANGLES), rows.dtype)
    chunk = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    out[chunk, :, np.arange(len(rows)) - starts[chunk]] = rows
    return out.reshape(len(out), -1)


@njit(cache=True, error_model="numpy")
def _visible_triangles(
    starts: NDArray[np.int64], planes: Floats, corners: NDArray[np.float32], clips: Floats, eye: Floats,
    low: Floats, high: Floats, nearness: NDArray[np.float32], out: NDArray[np.uint32],
) -> NDArray[np.int64]:  # fmt: skip
    views, height, width = nearness.shape
    order, in_view = chunks_in_view(low, high, eye, clips)
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
                if min(w0, min(w1, w2)) >= NEAR_W and not _covers(
                    places[_SIZE + i], places[2 * _SIZE + i], places[3 * _SIZE + i],
                    places[5 * _SIZE + i], places[6 * _SIZE + i], places[7 * _SIZE + i],
                    places[9 * _SIZE + i], places[10 * _SIZE + i], places[11 * _SIZE + i],
                    int(boxes[i]), int(boxes[_SIZE + i]), int(boxes[2 * _SIZE + i]), int(boxes[3 * _SIZE + i]),
                    nearness[v],
                ):  # fmt: skip
                    continue
                t = 3 * (first + i)
                out[v, at], out[v, at + 1], out[v, at + 2] = t, t + 1, t + 2
                at += 3
            counts[v] = at
    return counts


@njit(cache=True)
def _face(planes: Floats, x: float, y: float, z: float, facing: Floats) -> None:
    """Write the signed distances of a point from the planes of a chunk's triangles, scaled."""
    for i in range(_SIZE):
        facing[i] = planes[i] * x + planes[i + _SIZE] * y + planes[i + 2 * _SIZE] * z + planes[i + 3 * _SIZE]


@njit(cache=True, error_model="numpy")
def _project(corners: NDArray[np.float32], m: Floats, width: int, height: int, places: Floats) -> None:
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
def _choose(
    n: int, facing: Floats, places: Floats, width: int, height: int, boxes: Floats, kept: NDArray[np.int64]
) -> int:  # fmt: skip
    """Write which triangles face the eye and could cover a pixel's centre, without a branch; return how many.

    A triangle that reaches nearer than is projected is kept, one that lies there is not. The first and last column
    and row of pixels that a triangle could cover go into the boxes.
    """
    for i in range(_SIZE):
        u0, u1, u2 = places[_SIZE + i], places[5 * _SIZE + i], places[9 * _SIZE + i]
        v0, v1, v2 = places[2 * _SIZE + i], places[6 * _SIZE + i], places[10 * _SIZE + i]
        w0, w1, w2 = places[i], places[4 * _SIZE + i], places[8 * _SIZE + i]
        left = max(np.ceil(min(u0, min(u1, u2)) - ROUNDING_PX), 0.0)
        right = min(np.floor(max(u0, max(u1, u2)) + ROUNDING_PX), width - 1.0)
        top = max(np.ceil(min(v0, min(v1, v2)) - ROUNDING_PX), 0.0)
        bottom = min(np.floor(max(v0, max(v1, v2)) + ROUNDING_PX), height - 1.0)
        boxes[i], boxes[_SIZE + i], boxes[2 * _SIZE + i], boxes[3 * _SIZE + i] = left, right, top, bottom
        covers = ((left <= right) & (top <= bottom)) | (min(w0, min(w1, w2)) < NEAR_W)
        keep = covers & (facing[i] > 0.0) & (max(w0, max(w1, w2)) >= NEAR_W)
        boxes[4 * _SIZE + i] = 1.0 if keep else 0.0
    k = 0
    for i in range(n):
        kept[k] = i
        k += boxes[4 * _SIZE + i] > 0.0
    return k


@njit(cache=True, error_model="numpy")
def _box_hidden(low: Floats, high: Floats, m: Floats, nearness: NDArray[np.float32]) -> bool:
    """Whether a box lies behind the occluders at every pixel centre that it could cover."""
    height, width = nearness.shape
    left, right, top, bottom, nearest = box_pixels(low, high, m, width, height)
    limit = np.float32(nearest + NEARER)
    for y in range(top, bottom + 1):
        for x in range(left, right + 1):
            if nearness[y, x] <= limit:
                return False
    return True


@njit(cache=True, error_model="numpy")
def _covers(
    u0: float, v0: float, n0: float, u1: float, v1: float, n1: float, u2: float, v2: float, n2: float,
    left: int, right: int, top: int, bottom: int, nearness: NDArray[np.float32],
) -> bool:  # fmt: skip
    """Whether a triangle may be visible at a pixel's centre; raises the nearness in its conservative interior.

    Corners are in pixels, with their inverse depth, which is linear over the picture.
    """
    a0, b0, a1, b1, a2, b2 = u1 - u0, v1 - v0, u2 - u1, v2 - v1, u0 - u2, v0 - v2
    area = a0 * b1 - b0 * a1
    if area < 0.0:
        a0, b0, a1, b1, a2, b2 = -a0, -b0, -a1, -b1, -a2, -b2
    # Maximum change of an edge's function by a moved corner.
    s0, s1, s2 = MOVED_PX * (abs(a0) + abs(b0)), MOVED_PX * (abs(a1) + abs(b1)), MOVED_PX * (abs(a2) + abs(b2))
    flat = abs(area) < 1e-9
    dx = 0.0 if flat else ((n1 - n0) * (v2 - v0) - (n2 - n0) * (v1 - v0)) / area
    dy = 0.0 if flat else ((n2 - n0) * (u1 - u0) - (n1 - n0) * (u2 - u0)) / area
    min_depth, max_depth = min(n0, min(n1, n2)), max(n0, max(n1, n2))
    if flat:
        min_depth = max_depth
    slack = NEARER + MOVED_PX * (abs(dx) + abs(dy))
    hides, seen = not flat and max_depth <= NEAREST, False
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
