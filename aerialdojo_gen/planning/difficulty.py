"""What a certified route tells of its task: how hard it is, and what an agent would do to fly it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import APPROACH
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.free_length import free_lengths_m
from aerialdojo_gen.planning.grid_kernels import GridArrays, segment_free

Floats = NDArray[np.float64]

_FREE, _BLOCKED, _UNDECIDED = 0, 1, 2
# What the triangles say is blocked by more than rounding is blocked for FCL too.
_ROUNDING_M = 1e-6


class Difficulty(NamedTuple):
    """How hard routes are, a value each."""

    free_length_m: Floats  # (n,) float64; shortest length without obstacles (`aerialdojo_gen.planning.free_length`)
    plan_detour: Floats  # (n,) float64; the route's length over it, at least 1
    straight_line_free: NDArray[np.bool_]  # (n,) bool; whether the body could fly straight from start to goal
    climb_m: Floats  # (n,) float64; metres flown upwards, the Approach's among them


@njit(cache=True)
def _judge(starts: Floats, goals: Floats, radius: float, grid: GridArrays) -> NDArray[np.int8]:
    verdicts = np.full(len(starts), _UNDECIDED, np.int8)
    for i in range(len(starts)):
        px, py, pz, qx, qy, qz = starts[i, 0], starts[i, 1], starts[i, 2], goals[i, 0], goals[i, 1], goals[i, 2]
        if segment_free(px, py, pz, qx, qy, qz, radius, grid, True):
            verdicts[i] = _FREE
        elif not segment_free(px, py, pz, qx, qy, qz, radius - _ROUNDING_M, grid, False):
            verdicts[i] = _BLOCKED
    return verdicts


def straight_lines_free(
    starts: Floats, goals: Floats, radius_m: float, grid: ClearanceGrid, world: CollisionWorld
) -> NDArray[np.bool_]:
    """Whether the body touches nothing on the straight lines from starts to goals, (n, 3) world metres; (n,) bool."""
    p, q = (np.ascontiguousarray(points, np.float64) for points in (starts, goals))
    verdicts = _judge(p, q, radius_m, grid.arrays)
    free = verdicts == _FREE
    for i in np.flatnonzero(verdicts == _UNDECIDED):
        free[i] = not world.segment_in_collision(p[i], q[i], radius_m)
    return np.asarray(free)


def difficulty_of(
    routes: Sequence[Floats],
    lengths_m: Floats,
    max_approach_m: float,
    radius_m: float,
    grid: ClearanceGrid,
    world: CollisionWorld,
) -> Difficulty:
    """Difficulty of routes, each (K + 1, 4) poses in world metres and radians, in their order."""
    starts = np.array([r[0] for r in routes]).reshape(-1, 4)
    goals = np.array([r[-1, :3] for r in routes]).reshape(-1, 3)
    free_m = free_lengths_m(starts, goals, max_approach_m)
    # Where start and goal are one place there is no way to compare; the last bits may round either way.
    detour = np.maximum(np.divide(lengths_m, free_m, out=np.ones_like(free_m), where=free_m > 0.0), 1.0)
    climb = np.array([np.maximum(np.diff(r[:, 2]), 0.0).sum() for r in routes])
    return Difficulty(free_m, detour, straight_lines_free(starts[:, :3], goals, radius_m, grid, world), climb)


def agent_actions(actions: NDArray[np.int8]) -> NDArray[np.int8]:
    """Actions of a route that an agent has: all but the Approach; (K + 1,) int8 to (K,) or (K + 1,) int8.

    The body stops where the Approach would begin, at most its longest from the goal and with the route's last yaw.
    """
    return actions[actions != APPROACH]
