"""Numbers along a space-filling curve that keeps neighbours together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def morton_codes(points: NDArray[np.float64], bits: int = 21) -> NDArray[np.uint64]:
    """Number points along a Morton curve through the cube that holds them.

    Parameters
    ----------
    points : (n, 3) float64
        Metres; one at least.
    bits : int
        Of each coordinate, 21 at most: the cube is cut into ``2**bits`` cells an axis.

    Returns
    -------
    (n,) uint64
        The bits of the three cell numbers, interleaved.
    """
    low = points.min(axis=0)
    extent = max(float((points.max(axis=0) - low).max()), 1e-9)
    cells = ((points - low) / extent * (2**bits - 1)).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for bit in range(bits):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return code
