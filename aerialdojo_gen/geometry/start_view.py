"""What of an object the four views show from a pose: how much a start gives away (paper: sensors)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.common.terms import VIEWS
from aerialdojo_gen.geometry.rays import TriangleRayCaster

Floats = NDArray[np.float64]


def view_of(points: Floats, poses: Floats) -> NDArray[np.int64]:
    """Find the view in whose picture points lie, whatever stands before them.

    The views are square, of 90° and level: the four of them are faces of a cube around the body's centre.

    Parameters
    ----------
    points : (n, 3) float64
        Metres, world frame.
    poses : (n, 4) float64
        The body's, one a point: x, y, z in metres and yaw in radians, world frame.

    Returns
    -------
    (n,) int64
        Index into `VIEWS`, the first where a point is on the border of two; -1 behind and above.
    """
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
    """Say how much of an object is seen from poses, and by which view.

    Parameters
    ----------
    scene : TriangleRayCaster
        Everything that may stand in the way, the object included.
    own : TriangleRayCaster
        The object alone.
    points : (m, 3) array_like
        Of the object's surface, metres, world frame.
    poses : (n, 4) array_like
        The body's: x, y, z in metres and yaw in radians, world frame.

    Returns
    -------
    share : (n,) float64
        Of the points that the object's own body does not hide from the pose, the share that lies in one of the views
        and that nothing else hides; 0 where there are none.
    view : (n,) int64
        Index into `VIEWS` of the view that sees most points, the first of equals; -1 where nothing is seen.
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
