"""What certifies a route: its sweep touches no surface, and its smallest clearance is known.

Every leg is checked by FCL as a capsule, the exact sweep of the body, except where the clearance grid proves it free:
the grid's distances are lower bounds of FCL's, and the tests check that on random segments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.grid_kernels import GridArrays, inside, polyline_clearance, segment_free


class ClearanceProfile(NamedTuple):
    """Clearance of a route by the grid and the triangles."""

    corners: NDArray[np.float64]  # (m, 3) float64; the route's vertices without collinear ones, metres
    inside: bool  # Whether it stays in the flight volume
    undecided: NDArray[np.bool_]  # (max(1, m - 1),) bool; legs that the grid does not prove free
    clearance: float  # Smallest distance from the centre line to any surface, metres, capped at the bound


@njit(cache=True)
def corners(points: NDArray[np.float64]) -> NDArray[np.float64]:
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
def _undecided_legs(points: NDArray[np.float64], radius: float, grid: GridArrays) -> NDArray[np.bool_]:
    flags = np.ones(max(1, points.shape[0] - 1), np.bool_)
    for i in range(points.shape[0] - 1):
        p, q = points[i], points[i + 1]
        flags[i] = not segment_free(p[0], p[1], p[2], q[0], q[1], q[2], radius, grid, True)
    return flags


@njit(cache=True)
def _all_inside(points: NDArray[np.float64], grid: GridArrays) -> bool:
    for i in range(points.shape[0]):
        if not inside(points[i, 0], points[i, 1], points[i, 2], grid.lower, grid.upper):
            return False
    return True


@njit(cache=True)
def clearance_profile(points: NDArray[np.float64], radius: float, bound: float, grid: GridArrays) -> ClearanceProfile:
    """Measure a route's points (n, 3), world metres, by the clearance grid alone, without FCL."""
    p = corners(points)
    return ClearanceProfile(
        p, _all_inside(p, grid), _undecided_legs(p, radius, grid), polyline_clearance(p, bound, grid)
    )


def certify(profile: ClearanceProfile, radius_m: float, world: CollisionWorld, prove: bool = True) -> bool:
    """Whether a route stays in the flight volume and touches nothing: FCL decides the undecided legs, or all."""
    p, legs = profile.corners, np.flatnonzero(profile.undecided | np.bool_(not prove)).tolist()
    return profile.inside and not any(
        world.segment_in_collision(p[i], p[min(i + 1, len(p) - 1)], radius_m) for i in legs
    )
