"""What certifies a route: its sweep touches no surface, and its smallest clearance is known.

Every leg is checked by FCL as a capsule, the exact sweep of the body, except where the clearance grid proves it free:
the grid's distances are lower bounds of FCL's, and the tests check that on random segments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.grid_kernels import GridArrays, inside, polyline_clearance, segment_free


class ClearanceProfile(NamedTuple):
    """Clearance of a route by the grid and the triangles."""

    corners: Floats  # (m, 3) float64; the route's vertices without collinear ones, metres
    inside: bool  # Whether it stays in the flight volume
    undecided: Flags  # (max(1, m - 1),) bool; legs that the grid does not prove free
    clearance: float  # Smallest distance from the centre line to any surface, metres, capped at the bound


@njit(cache=True)
def corners(points: Floats) -> Floats:
    """Drop repeated and collinear points: (n, 3) to (m, 3), ends included."""
    n = points.shape[0]
    kept = np.empty((n, 3))
    kept[0] = points[0]
    m = 1
    for i in range(1, n):
        d = points[i] - kept[m - 1]
        if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < 1e-18:
            continue
        if m >= 2:
            e = kept[m - 1] - kept[m - 2]
            cx, cy, cz = e[1] * d[2] - e[2] * d[1], e[2] * d[0] - e[0] * d[2], e[0] * d[1] - e[1] * d[0]
            along = e[0] * d[0] + e[1] * d[1] + e[2] * d[2]
            if along > 0.0 and cx * cx + cy * cy + cz * cz < 1e-18 * along * along:
                kept[m - 1] = points[i]
                continue
        kept[m] = points[i]
        m += 1
    return kept[:m].copy()


@njit(cache=True)
def clearance_profile(points: Floats, radius: float, bound: float, grid: GridArrays) -> ClearanceProfile:
    """Measure a route's points (n, 3), world metres, by the clearance grid alone, without FCL."""
    path, all_inside = corners(points), True
    undecided = np.ones(max(1, len(path) - 1), np.bool_)
    for i in range(len(path)):
        p, q = path[i - 1], path[i]
        all_inside = all_inside and inside(q[0], q[1], q[2], grid.lower, grid.upper)
        if i > 0:
            undecided[i - 1] = not segment_free(p[0], p[1], p[2], q[0], q[1], q[2], radius, grid, True)
    return ClearanceProfile(path, all_inside, undecided, polyline_clearance(path, bound, grid))


def certify(profile: ClearanceProfile, radius_m: float, world: CollisionWorld, prove: bool = True) -> bool:
    """Whether a route stays in the flight volume and touches nothing: FCL decides the undecided legs, or all."""
    p, legs = profile.corners, np.flatnonzero(profile.undecided | np.bool_(not prove)).tolist()
    return profile.inside and not any(
        world.segment_in_collision(p[i], p[min(i + 1, len(p) - 1)], radius_m) for i in legs
    )
