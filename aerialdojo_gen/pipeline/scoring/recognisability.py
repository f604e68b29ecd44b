"""How recognisable an object is from a viewpoint: its front and its identifying parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PARTS_WEIGHT, FRONT_WEIGHT = 0.35, 0.3
_ANGLES_RAD, _MARKS = np.radians([0.0, 25.0, 60.0, 60.001, 120.0]), (1.0, 1.0, 0.5, 0.15, 0.0)


def part_score(part_visibility: Floats) -> Floats:
    """Score how well identifying parts (n, t), 0 to 1, are seen: half the worst one, half their mean."""
    return np.asarray((part_visibility.min(axis=1) + part_visibility.mean(axis=1)) / 2.0)


def front_score(off_front_rad: Floats | None) -> Floats | None:
    """Mark angles off the front: full up to 25°, half at 60°, little beyond; None for an object without a front."""
    return None if off_front_rad is None else np.asarray(np.interp(off_front_rad, _ANGLES_RAD, _MARKS))


def clarity_score(unoccluded: Floats, framed: Floats, foreground: Floats, level: Floats) -> Floats:
    """Factor (n,) in (0, 1] for what hides the object, cuts it off or stands nearer, and for looking up or down."""
    return np.asarray(
        np.interp(unoccluded, (0.4, 0.95), (0.4, 1.0))
        * np.interp(framed, (0.5, 0.98), (0.6, 1.0))
        * np.interp(foreground, (0.05, 0.5), (1.0, 0.5))
        * np.interp(level, (0.0, 1.0), (0.7, 1.0))
    )


def recognisability(score: Floats, parts: Floats | None, front: Floats | None) -> Floats:
    """Combine the silhouette's score with those of parts and front, (n,); None leaves its weight to the first."""
    known = [(weight, mark) for weight, mark in ((PARTS_WEIGHT, parts), (FRONT_WEIGHT, front)) if mark is not None]
    rest = 1.0 - sum(weight for weight, _ in known)
    return np.asarray(rest * score + sum(weight * mark for weight, mark in known))
