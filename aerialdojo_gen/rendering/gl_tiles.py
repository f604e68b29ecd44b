"""Occlusion buffers of the views of one eye: tiles of 8 x 8 pixels, with a bit a pixel and two depths.

As in *Masked Software Occlusion Culling* (Hasselgren, Andersson, Akenine-Möller, 2016): the larger triangles are
drawn into tiles, the nearest first, and triangles behind them are culled. Margins exceed OpenGL's rounding, so the
pictures do not change by a bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.rendering.picture import NEAR_M

Floats = NDArray[np.float64]

# How far OpenGL moves a corner at most, pixels: it counts them in 256ths; and how much nearer something must be to
# hide another, in inverse metres: several steps of the depth buffer.
MOVED_PX, NEARER = 0.004, 1e-5
# Triangles in front of OpenGL's near plane hide nothing.
NEAREST = 1.0 / NEAR_M
# Twice the area, in pixels, of the smallest occluder: smaller ones cost more than they hide.
_MIN_AREA_PX2 = 400.0
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
_COLUMN = np.uint64(0x0101010101010101)


@dataclass(frozen=True, eq=False)
class Tiles:
    """Occluders drawn so far in some views, by tiles, rows first."""

    width: int  # Pixels of each view
    height: int
    whole: NDArray[np.float32]  # (views, rows, columns) float32
    part: NDArray[np.float32]  # (views, rows, columns) float32; the same of the pixels in `covered`
    covered: NDArray[np.uint64]  # (views, rows, columns) uint64; a bit a pixel, eight a row

    @classmethod
    def empty(cls, views: int, width: int, height: int) -> Tiles:
        """Make tiles that hide nothing."""
        shape = (views, (height + 7) // 8, (width + 7) // 8)
        return cls(
            width, height, np.zeros(shape, np.float32), np.zeros(shape, np.float32), np.zeros(shape, np.uint64)
        )


@njit(cache=True, error_model="numpy")
def hidden(left: int, right: int, top: int, bottom: int, nearest: float, whole: NDArray[np.float32]) -> bool:
    """Whether a rectangle of pixels, no nearer than an inverse depth, is behind the occluders."""
    limit = np.float32(nearest + NEARER)
    for row in range(top >> 3, (bottom >> 3) + 1):
        for column in range(left >> 3, (right >> 3) + 1):
            if whole[row, column] <= limit:
                return False
    return True


@njit(cache=True, error_model="numpy")
def cover(
    u0: float, v0: float, n0: float, u1: float, v1: float, n1: float, u2: float, v2: float, n2: float,
    left: int, right: int, top: int, bottom: int, width: int, height: int,
    whole: NDArray[np.float32], part: NDArray[np.float32], covered: NDArray[np.uint64],
) -> None:  # fmt: skip
    """Draw a triangle's conservative interior into the tiles.

    Corners are in pixels, with their inverse depth, which is linear over the picture; the rectangle encloses it.
    """
    a0, b0, a1, b1, a2, b2 = u1 - u0, v1 - v0, u2 - u1, v2 - v1, u0 - u2, v0 - v2
    area = a0 * b1 - b0 * a1
    if abs(area) < _MIN_AREA_PX2 or max(n0, n1, n2) > NEAREST:
        return
    if area < 0.0:
        a0, b0, a1, b1, a2, b2 = -a0, -b0, -a1, -b1, -a2, -b2
    dx = ((n1 - n0) * (v2 - v0) - (n2 - n0) * (v1 - v0)) / area
    dy = ((n2 - n0) * (u1 - u0) - (n1 - n0) * (u2 - u0)) / area
    min_depth = min(n0, n1, n2)
    # From a tile's middle to its farthest pixel, and what moved corners change.
    below = 3.5 * (abs(dx) + abs(dy))
    slack = NEARER + MOVED_PX * (abs(dx) + abs(dy))
    begin, end = np.empty(8, np.int64), np.empty(8, np.int64)
    for row in range(top >> 3, (bottom >> 3) + 1):
        low, high = width, -1
        for k in range(8):
            y = (row << 3) + k
            begin[k], end[k] = 1, 0
            if y < top or y > bottom:
                continue
            first, last, empty = float(left), float(right), False
            for a, b, u, v in ((a0, b0, u0, v0), (a1, b1, u1, v1), (a2, b2, u2, v2)):
                # An edge's function, a (y - v) - b (x - u), exceeds on the inner side what a moved corner changes.
                over = a * (y - v) - MOVED_PX * (abs(a) + abs(b))
                if b > 0.0:
                    last = min(last, u + over / b)
                elif b < 0.0:
                    first = max(first, u + over / b)
                elif over <= 0.0:
                    empty = True
            if empty or first > last:
                continue
            begin[k], end[k] = math.ceil(first + 1e-6), math.floor(last - 1e-6)
            if begin[k] <= end[k]:
                low, high = min(low, begin[k]), max(high, end[k])
        if low > high:
            continue
        for column in range(low >> 3, (high >> 3) + 1):
            x = column << 3
            middle = n0 + dx * (x + 3.5 - u0) + dy * ((row << 3) + 3.5 - v0)
            depth = np.float32(max(middle - below, min_depth) - slack)
            if depth <= whole[row, column]:
                continue
            bits = covered[row, column]
            if bits:
                depth = min(depth, part[row, column])
            for k in range(8):
                first_bit, last_bit = max(begin[k] - x, 0), min(end[k] - x, 7)
                if first_bit <= last_bit:
                    bits |= np.uint64((0xFF << first_bit) & (0xFF >> (7 - last_bit))) << np.uint64(k << 3)
            if bits == _pixels(row, column, width, height):
                whole[row, column], part[row, column], covered[row, column] = depth, np.float32(0.0), np.uint64(0)
            else:
                part[row, column], covered[row, column] = depth, bits


@njit(cache=True)
def _pixels(row: int, column: int, width: int, height: int) -> np.uint64:
    """Return the bits of a tile's pixels: not all where the picture ends."""
    across, down = width - (column << 3), height - (row << 3)
    bits = _ALL
    if across < 8:
        bits = np.uint64(0xFF >> (8 - across)) * _COLUMN
    if down < 8:
        bits &= _ALL >> np.uint64((8 - down) << 3)
    return bits
