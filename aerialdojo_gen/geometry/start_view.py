"""What of an object the four views show from a pose: how much a start gives away (paper: sensors)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import VIEWS
from aerialdojo_gen.geometry.rays import TriangleRayCaster

Floats = NDArray[np.float64]


def view_of(points: Floats, poses: Floats) -> NDArray[np.int64]:
    """Index into `VIEWS` of the 90° view that contains each point, (n,), from poses (n, 4); -1 behind and above."""
    away = points - poses[:, :3]
    c, s = np.cos(poses[:, 3]), np.sin(poses[:, 3])
    forward, left, up = c * away[:, 0] + s * away[:, 1], c * away[:, 1] - s * away[:, 0], away[:, 2]
    x, y, z = np.abs(forward), np.abs(left), np.abs(up)
    inside = {
        "front": (forward > 0) & (y <= x) & (z <= x),
        "left": (left > 0) & (x <= y) & (z <= y),
        "right": (left < 0) & (x <= y) & (z <= y),
        "down": (up < 0) & (x <= z) & (y <= z),
    }
    return np.asarray(np.select([inside[view] for view in VIEWS], range(len(VIEWS)), -1), dtype=np.int64)


def seen_from(
    scene: TriangleRayCaster, own: TriangleRayCaster, points: ArrayLike, poses: ArrayLike
) -> tuple[Floats, NDArray[np.int64]]:
    """Share of an object's points (m, 3) seen from each pose (n, 4).

    And the view that sees most of them (-1 for none).
    """
    p, q = np.asarray(points, dtype=np.float64), np.asarray(poses, dtype=np.float64)
    m = len(p)
    view = view_of(np.tile(p, (len(q), 1)), np.repeat(q, m, axis=0)).reshape(-1, m)
    who, what = np.nonzero(view >= 0)
    seen = np.zeros((len(q), m), dtype=np.bool_)
    seen[who, what] = scene.unobstructed(q[who, :3], p[what])
    votes = np.stack([(seen & (view == k)).sum(axis=1) for k in range(len(VIEWS))], axis=1)
    some = np.flatnonzero(votes.any(axis=1))
    share = np.zeros(len(q))
    # What hides the rest matters only where something is seen.
    who, what = np.nonzero(~seen[some])
    facing = seen[some]
    facing[who, what] = own.unobstructed(q[some[who], :3], p[what])
    share[some] = seen[some].sum(axis=1) / facing.sum(axis=1)
    return share, np.where(votes.any(axis=1), votes.argmax(axis=1), -1)
