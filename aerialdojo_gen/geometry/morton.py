"""Numbers along a space-filling curve that keeps neighbours together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit


@njit(cache=True)
def _interleaved(
    points: NDArray[np.float64], low: NDArray[np.float64], extent: float, most: int
) -> NDArray[np.uint64]:
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


def morton_codes(points: NDArray[np.float64], bits: int = 21) -> NDArray[np.uint64]:
    """Morton codes (n,) uint64 of points (n, 3) in their bounding cube, `bits` (at most 21) a coordinate."""
    low = points.min(axis=0)
    extent = max(float((points.max(axis=0) - low).max()), 1e-9)
    return np.asarray(_interleaved(np.ascontiguousarray(points, np.float64), low, extent, 2**bits - 1))
