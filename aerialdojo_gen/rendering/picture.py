"""The output of every renderer, and the depth range of all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Planar depths between which surfaces are drawn, metres.
NEAR_M, FAR_M = 0.1, 2000.0


@dataclass(frozen=True, eq=False)
class Picture:
    """Output of a renderer for one camera."""

    rgb: NDArray[np.uint8]  # (H, W, 3) uint8; sRGB
    depth_m: NDArray[np.float32]  # (H, W) float32; planar depth, metres; inf where nothing is hit
    instance: NDArray[np.int32] | None = None  # (H, W) int32 or None
