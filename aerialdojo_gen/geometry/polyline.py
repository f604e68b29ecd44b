"""Points along a route, closer together than its poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def sampled(points: NDArray[np.float64], step_m: float = 0.5) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points along a polyline, at most `step_m` metres apart, corners included, and the segment of each."""
    pieces, owners = [], []
    for k in range(len(points) - 1):
        n = max(1, int(np.ceil(np.linalg.norm(points[k + 1] - points[k]) / step_m - 1e-9)))
        share = np.arange(n)[:, None] / n
        pieces.append(points[k] + share * (points[k + 1] - points[k]))
        owners += [k] * n
    return np.concatenate([*pieces, points[-1:]]), np.array([*owners, max(0, len(points) - 2)], dtype=np.int64)
