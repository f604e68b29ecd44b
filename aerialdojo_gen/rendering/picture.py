"""What a renderer gives, and how near and how far it sees, whichever it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Planar depths between which surfaces are drawn, metres.
NEAR_M, FAR_M = 0.1, 2000.0


@dataclass(frozen=True, eq=False)
class Picture:
    """What a camera sees.

    Attributes
    ----------
    rgb : (H, W, 3) uint8
        sRGB.
    depth_m : (H, W) float32
        Planar depth, metres; inf where nothing is hit.
    instance : (H, W) int32 or None
        Number of the instance in the scene's order, -1 where nothing is hit; None where it was not asked for.
    """

    rgb: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    instance: NDArray[np.int32] | None = None
