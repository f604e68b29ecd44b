"""What a mesh file holds, before anything is believed of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GREY = (168, 164, 156)


@dataclass(frozen=True, eq=False)
class RawNode:
    """A node of a file: its name and its triangles.

    Attributes
    ----------
    name : str
        As in the file; empty where it has none.
    vertices : (n, 3) float64
        In the file's own axes and units; anything may stand in it, NaN too.
    faces : (m, 3) int64
        Indices into `vertices`.
    colours : (m, 3) uint8
        sRGB of each face.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    colours: NDArray[np.uint8]


def plain(n: int) -> NDArray[np.uint8]:
    """Return the colour of faces whose file has none, (n, 3) uint8."""
    return np.tile(np.array(GREY, dtype=np.uint8), (n, 1))
