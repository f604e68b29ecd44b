"""The one rule of direction: a compass octant from the nearest landmark, from centroid to centroid in the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.geometry.frames import compass_direction, wrap_angle_rad

# Nearer to the border of an octant than this, texts name no direction.
BORDER_DEG = 5.0
_HALF_DEG = 22.5


@dataclass(frozen=True)
class Bearing:
    """Index of the nearest landmark in the plane, and the compass direction from it."""

    landmark: int
    direction: str
    clear: bool = field(default=True, compare=False)  # At least `BORDER_DEG` from the octant's borders


def nearest_landmark(centre_m: NDArray[np.float64], landmarks_m: NDArray[np.float64]) -> Bearing | None:
    """Find the nearest landmark in the plane (centres in world metres); None where there is no direction."""
    if len(landmarks_m) == 0:
        return None
    offset = np.asarray(centre_m)[:2] - np.asarray(landmarks_m)[:, :2]
    # Rounded to millimetres, so that the result does not depend on floating-point noise.
    nearest = int(np.argmin(np.round(np.hypot(offset[:, 0], offset[:, 1]), 3)))
    dx, dy = float(offset[nearest, 0]), float(offset[nearest, 1])
    if dx == 0.0 and dy == 0.0:
        return None
    direction = compass_direction(dx, dy)
    return Bearing(nearest, direction, lies_towards(offset[nearest], direction, _HALF_DEG - BORDER_DEG))


def lies_towards(offset_m: ArrayLike, direction: str, most_deg: float = _HALF_DEG) -> bool:
    """Whether a displacement in metres is at most so many degrees off the middle of an octant."""
    dx, dy = (float(c) for c in np.asarray(offset_m)[:2])
    middle = math.radians(45.0 * DIRECTIONS.index(direction))
    return (dx, dy) != (0.0, 0.0) and abs(float(wrap_angle_rad(math.atan2(dy, dx) - middle))) <= math.radians(
        most_deg
    )
