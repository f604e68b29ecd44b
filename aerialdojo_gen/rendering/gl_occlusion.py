"""What all cameras of a body draw, chosen in one pass: they share their centre.

OpenGL in software takes a microsecond for a triangle, however few pixels of it are seen, and a small picture has few
pixels. So triangles are drawn here too, the nearest first and their depth alone, and what lies behind it everywhere
is left out, whole chunks at once. OpenGL draws the rest and decides: what is left out could not have been seen, by
margins that exceed what OpenGL rounds.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerialdojo_gen.rendering.gl_culling import NEAR_W, ROUNDING_PX, chunks_in_view
from aerialdojo_gen.rendering.gl_geometry import Chunks
from aerialdojo_gen.rendering.gl_tiles import MOVED_PX, NEARER, NEAREST, Tiles

Floats = NDArray[np.float64]


class BodyCulling:
    """Chooses the triangles of one kind of surface that the views of a body draw.

    Parameters
    ----------
    chunks : Chunks
    hides : bool
        Whether what lies behind its triangles is not seen: not so where their texture has holes.
    """

    def __init__(self, chunks: Chunks, hides: bool = True) -> None:
        self._chunks = chunks
        self._hides = hides
        self._out = np.empty((0, 0), np.uint32)

    def seen(
        self, clips: Floats, eye: Floats, width: int, height: int, nearness: NDArray[np.float32]
    ) -> list[NDArray[np.uint32]]:
        """Choose what every view draws.

        Parameters
        ----------
        clips : (views, 4, 4) float64
            OpenGL's matrices of the cameras, row-major.
        eye : (3,) float64
            Their common centre.
        width, height : int
            Pixels of each.
        nearness : (views, height, width) float32
            Inverse depth of what is drawn already, 0 where nothing is; raised here by what is chosen.

        Returns
        -------
        list of (3 k,) uint32
            By view, indices into the chunks' vertices, chunk by chunk, the nearest first; valid until the next call.
        """
        c = self._chunks
        if not self._hides:
            return c.seen(clips, eye, Tiles.empty(len(clips), width, height), hides=False)
        order, sees = chunks_in_view(c.low, c.high, eye, clips)
        if len(self._out) < len(clips):
            self._out = np.empty((len(clips), len(c.vertices)), np.uint32)
        counts = _triangles_seen(
            order, sees, c.starts, c.planes, c.corners, clips, eye, c.low, c.high, nearness, self._out
        )
        return [self._out[v, :n] for v, n in enumerate(counts.tolist())]


@njit(cache=True, error_model="numpy")
def _triangles_seen(
    order: NDArray[np.int64], sees: NDArray[np.bool_], starts: NDArray[np.int64], planes: Floats,
    corners: NDArray[np.float32], clips: Floats, eye: Floats, low: Floats, high: Floats,
    nearness: NDArray[np.float32], out: NDArray[np.uint32],
) -> NDArray[np.int64]:  # fmt: skip
    views, height, width = nearness.shape
    counts = np.zeros(views, np.int64)
    ex, ey, ez = eye[0], eye[1], eye[2]
    half_w, half_h = 0.5 * width, 0.5 * height
    for n in range(len(order)):
        chunk, mask = order[n], 0
        for v in range(views):
            if sees[n, v] and not _hidden(low[chunk], high[chunk], clips[v], nearness[v]):
                mask |= 1 << v
        if not mask:
            continue
        for t in range(starts[chunk], starts[chunk + 1]):
            if planes[t, 0] * ex + planes[t, 1] * ey + planes[t, 2] * ez + planes[t, 3] <= 0.0:
                continue
            ax, ay, az = corners[t, 0], corners[t, 1], corners[t, 2]
            bx, by, bz = corners[t, 3], corners[t, 4], corners[t, 5]
            cx, cy, cz = corners[t, 6], corners[t, 7], corners[t, 8]
            for v in range(views):
                if not (mask >> v) & 1:
                    continue
                m = clips[v]
                w0 = m[3, 0] * ax + m[3, 1] * ay + m[3, 2] * az + m[3, 3]
                w1 = m[3, 0] * bx + m[3, 1] * by + m[3, 2] * bz + m[3, 3]
                w2 = m[3, 0] * cx + m[3, 1] * cy + m[3, 2] * cz + m[3, 3]
                if w0 >= NEAR_W and w1 >= NEAR_W and w2 >= NEAR_W:
                    # To pixels, centres at whole numbers.
                    w0, w1, w2 = 1.0 / w0, 1.0 / w1, 1.0 / w2
                    u0 = ((m[0, 0] * ax + m[0, 1] * ay + m[0, 2] * az + m[0, 3]) * w0 + 1.0) * half_w - 0.5
                    u1 = ((m[0, 0] * bx + m[0, 1] * by + m[0, 2] * bz + m[0, 3]) * w1 + 1.0) * half_w - 0.5
                    u2 = ((m[0, 0] * cx + m[0, 1] * cy + m[0, 2] * cz + m[0, 3]) * w2 + 1.0) * half_w - 0.5
                    left = max(math.ceil(min(u0, min(u1, u2)) - ROUNDING_PX), 0)
                    right = min(math.floor(max(u0, max(u1, u2)) + ROUNDING_PX), width - 1)
                    if left > right:
                        continue
                    v0 = ((m[1, 0] * ax + m[1, 1] * ay + m[1, 2] * az + m[1, 3]) * w0 + 1.0) * half_h - 0.5
                    v1 = ((m[1, 0] * bx + m[1, 1] * by + m[1, 2] * bz + m[1, 3]) * w1 + 1.0) * half_h - 0.5
                    v2 = ((m[1, 0] * cx + m[1, 1] * cy + m[1, 2] * cz + m[1, 3]) * w2 + 1.0) * half_h - 0.5
                    top = max(math.ceil(min(v0, min(v1, v2)) - ROUNDING_PX), 0)
                    bottom = min(math.floor(max(v0, max(v1, v2)) + ROUNDING_PX), height - 1)
                    if top > bottom:
                        continue
                    if not _covers(u0, v0, w0, u1, v1, w1, u2, v2, w2, left, right, top, bottom, nearness[v]):
                        continue
                elif w0 < NEAR_W and w1 < NEAR_W and w2 < NEAR_W:
                    continue
                n = counts[v]
                out[v, n], out[v, n + 1], out[v, n + 2] = 3 * t, 3 * t + 1, 3 * t + 2
                counts[v] = n + 3
    return counts


@njit(cache=True, error_model="numpy")
def _hidden(low: Floats, high: Floats, m: Floats, nearness: NDArray[np.float32]) -> bool:
    """Whether a box lies behind what is drawn at every pixel whose centre it could hold."""
    height, width = nearness.shape
    u0, u1, v0, v1, nearest = np.inf, -np.inf, np.inf, -np.inf, np.inf
    for corner in range(8):
        x = high[0] if corner & 1 else low[0]
        y = high[1] if corner & 2 else low[1]
        z = high[2] if corner & 4 else low[2]
        w = m[3, 0] * x + m[3, 1] * y + m[3, 2] * z + m[3, 3]
        if w < NEAR_W:
            return False
        u = ((m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3]) / w + 1.0) * 0.5 * width - 0.5
        v = ((m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3]) / w + 1.0) * 0.5 * height - 0.5
        u0, u1, v0, v1, nearest = min(u0, u), max(u1, u), min(v0, v), max(v1, v), min(nearest, w)
    left, right = max(math.ceil(u0 - ROUNDING_PX), 0), min(math.floor(u1 + ROUNDING_PX), width - 1)
    top, bottom = max(math.ceil(v0 - ROUNDING_PX), 0), min(math.floor(v1 + ROUNDING_PX), height - 1)
    limit = np.float32(1.0 / nearest + NEARER)
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
    """Whether a triangle may be seen at a pixel's centre; where it surely lies, the nearness is raised.

    Corners are in pixels, with their inverse depth, which is linear over the picture.
    """
    a0, b0, a1, b1, a2, b2 = u1 - u0, v1 - v0, u2 - u1, v2 - v1, u0 - u2, v0 - v2
    area = a0 * b1 - b0 * a1
    if area < 0.0:
        a0, b0, a1, b1, a2, b2 = -a0, -b0, -a1, -b1, -a2, -b2
    # Where a corner is moved, an edge's function changes by at most so much.
    s0, s1, s2 = MOVED_PX * (abs(a0) + abs(b0)), MOVED_PX * (abs(a1) + abs(b1)), MOVED_PX * (abs(a2) + abs(b2))
    flat = abs(area) < 1e-9
    dx = 0.0 if flat else ((n1 - n0) * (v2 - v0) - (n2 - n0) * (v1 - v0)) / area
    dy = 0.0 if flat else ((n2 - n0) * (u1 - u0) - (n1 - n0) * (u2 - u0)) / area
    least, most = min(n0, min(n1, n2)), max(n0, max(n1, n2))
    slack = NEARER + MOVED_PX * (abs(dx) + abs(dy))
    visible = False
    for y in range(top, bottom + 1):
        e0 = a0 * (y - v0) - b0 * (left - u0)
        e1 = a1 * (y - v1) - b1 * (left - u1)
        e2 = a2 * (y - v2) - b2 * (left - u2)
        n = n0 + dx * (left - u0) + dy * (y - v0)
        for x in range(left, right + 1):
            if e0 >= -s0 and e1 >= -s1 and e2 >= -s2:
                here = most if flat else min(max(n, least), most)
                if here + slack >= nearness[y, x]:
                    visible = True
                    if (
                        e0 > s0
                        and e1 > s1
                        and e2 > s2
                        and not flat
                        and most <= NEAREST
                        and here - slack > nearness[y, x]
                    ):
                        nearness[y, x] = here - slack
            e0 -= b0
            e1 -= b1
            e2 -= b2
            n += dx
    return visible
