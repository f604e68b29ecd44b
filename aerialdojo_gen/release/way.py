"""Points along a route, closer together than its poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def sampled(points: NDArray[np.float64], step_m: float = 0.5) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Lay points along a polyline, no farther apart than a step, corners included.

    Parameters
    ----------
    points : (n, 3) float64
        Metres; at least one.
    step_m : float
        Largest distance between consecutive samples.

    Returns
    -------
    samples : (m, 3) float64
    segment : (m,) int64
        The segment that a sample lies on (its first point's index); the last sample is the last point.
    """
    pieces, owners = [], []
    for k in range(len(points) - 1):
        n = max(1, int(np.ceil(np.linalg.norm(points[k + 1] - points[k]) / step_m - 1e-9)))
        share = np.arange(n)[:, None] / n
        pieces.append(points[k] + share * (points[k + 1] - points[k]))
        owners += [k] * n
    return np.concatenate([*pieces, points[-1:]]), np.array([*owners, max(0, len(points) - 2)], dtype=np.int64)
