"""One planning attempt as a single kernel: search, refine, fly, measure clearance.

Passing arrays to a kernel takes longer than a short search, so they are passed once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import APPROACH, STOP
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Floats, Singles
from aerialdojo_gen.geometry.motion import fly
from aerialdojo_gen.planning.certify import ClearanceProfile, clearance_profile
from aerialdojo_gen.planning.cost_to_go import cost_at, extra_cost
from aerialdojo_gen.planning.grid_kernels import GridArrays
from aerialdojo_gen.planning.hybrid_astar import FOUND, SearchArrays, SearchOptions, search
from aerialdojo_gen.planning.refine import legs_to_actions

# No Approach is needed for a goal nearer than this.
_ON_GOAL_M = 1e-9


class PlanResult(NamedTuple):
    """Result of one planning attempt."""

    status: int  # One of `aerialdojo_gen.planning.hybrid_astar`: FOUND, EXHAUSTED, BUDGET
    expansions: int
    poses: Floats  # (K + 1, 4) float64; x, y, z in metres and yaw in (-pi, pi]; no rows unless FOUND
    actions: NDArray[np.int8]  # (K + 1,) int8; action at every pose, Stop at the last
    length: float  # The paper's L, metres
    profile: ClearanceProfile  # Of the route; meaningless unless FOUND


@njit(cache=True)
def lengths_at(
    points: Floats, goal: Floats, grid: GridArrays, moves: NDArray[np.uint32], cost: Singles, clearance_cost: Singles
) -> Floats:
    """Lengths of the cheapest grid paths from points, (n, 3) float64 metres; (n,) float64 metres."""
    values = np.empty(len(points))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        values[i] = cost_at(x, y, z, grid, cost)
        if values[i] < np.inf:
            values[i] -= extra_cost(x, y, z, goal, grid, moves, cost, clearance_cost)
    return values


@njit(cache=True)
def costs_at(points: Floats, grid: GridArrays, cost: Singles) -> Floats:
    """Cost-to-go of points, (n, 3) float64 metres; (n,) float64 metres."""
    values = np.empty(len(points))
    for i in range(len(points)):
        values[i] = cost_at(points[i, 0], points[i, 1], points[i, 2], grid, cost)
    return values


@njit(cache=True)
def plan_once(
    start: Floats,
    goal: Floats,
    goal_heading: int,
    cost_to_go: Singles,
    grid: GridArrays,
    memory: SearchArrays,
    options: SearchOptions,
    radius: float,
    bound: float,
) -> PlanResult:
    """Search a route from a pose (4,) to a goal (3,), order its moves, fly it and measure its clearance, metres."""
    status, expansions, directions, metres = search(start, goal, goal_heading, cost_to_go, grid, memory, options)
    if status != FOUND:
        no_profile = ClearanceProfile(np.empty((0, 3)), False, np.empty(0, np.bool_), 0.0)
        return PlanResult(status, expansions, np.empty((0, 4)), np.empty(0, np.int8), 0.0, no_profile)
    moved = legs_to_actions(start, directions, metres, goal_heading, options, grid)
    poses = fly(start, moved)
    n = len(moved)
    dx, dy, dz = goal[0] - poses[n, 0], goal[1] - poses[n, 1], goal[2] - poses[n, 2]
    approach = 1 if math.sqrt(dx * dx + dy * dy + dz * dz) > _ON_GOAL_M else 0
    route = np.empty((n + 1 + approach, 4))
    actions = np.empty(n + 1 + approach, np.int8)
    route[: n + 1], actions[:n], actions[n] = poses, moved, APPROACH
    route[n + approach, :3], route[n + approach, 3] = goal, poses[n, 3]
    actions[n + approach] = STOP
    length = 0.0
    for k in range(n + approach):
        ax, ay, az = route[k + 1, 0] - route[k, 0], route[k + 1, 1] - route[k, 1], route[k + 1, 2] - route[k, 2]
        length += math.sqrt(ax * ax + ay * ay + az * az)
    profile = clearance_profile(np.ascontiguousarray(route[:, :3]), radius, bound, grid)
    return PlanResult(status, expansions, route, actions, length, profile)
