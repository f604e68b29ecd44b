"""Difficulty of a task from its certified route, and the route's actions for an agent.

The free length is the shortest length in the action set's metric without obstacles. An agent flies along 24 headings,
up and down, and the reference ends with a straight Approach. So for a displacement (h, v) it is

    min over |a| <= A of  N(h - a_h) + |v - a_v| + |a|,

N the gauge of the regular 24-gon whose corners are the headings, a the Approach, A its longest. Moves may have any
length here, so that no route on the lattice is shorter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import APPROACH
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats
from aerialdojo_gen.geometry.motion import TURN_RAD
from aerialdojo_gen.geometry.portable import atan2
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.grid_kernels import GridArrays, segment_free

_FREE, _BLOCKED, _UNDECIDED = 0, 1, 2
# What is blocked by the triangles by more than rounding is blocked for FCL too.
_ROUNDING_M = 1e-6


class Difficulty(NamedTuple):
    """Difficulty of routes, one value each."""

    free_length_m: Floats  # (n,) float64; shortest length without obstacles
    plan_detour: Floats  # (n,) float64; the route's length over it, at least 1
    straight_line_free: Flags  # (n,) bool; whether the body could fly straight from start to goal
    climb_m: Floats  # (n,) float64; metres flown upwards, including the Approach


@njit(cache=True)
def _classify(starts: Floats, goals: Floats, radius: float, grid: GridArrays) -> NDArray[np.int8]:
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
) -> Flags:
    """Whether the body touches nothing on the straight lines from starts to goals, (n, 3) world metres; (n,) bool."""
    p, q = (np.ascontiguousarray(points, np.float64) for points in (starts, goals))
    verdicts = _classify(p, q, radius_m, grid.arrays)
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
    # A free length of 0 has no detour; rounding may give a ratio just below 1.
    detour = np.maximum(np.divide(lengths_m, free_m, out=np.ones_like(free_m), where=free_m > 0.0), 1.0)
    climb = np.array([np.maximum(np.diff(r[:, 2]), 0.0).sum() for r in routes])
    return Difficulty(free_m, detour, straight_lines_free(starts[:, :3], goals, radius_m, grid, world), climb)


def agent_actions(actions: NDArray[np.int8]) -> NDArray[np.int8]:
    """Actions of a route that an agent has, without the Approach; (K + 1,) int8 to (K,) or (K + 1,) int8."""
    return actions[actions != APPROACH]


# Half a side of the dual 24-gon, whose sides touch the unit circle: its corners lie between two headings.
_HALF_SIDE = math.tan(TURN_RAD / 2)


def free_lengths_m(starts: ArrayLike, goals: ArrayLike, max_approach_m: float) -> Floats:
    """Shortest lengths (n,) without obstacles, metres.

    By duality the maximum of a concave function over a prism, in closed form.
    """
    s, g = np.asarray(starts, np.float64).reshape(-1, 4), np.asarray(goals, np.float64)
    way = (g - s[:, :3]) / max_approach_m
    flat, lift = np.hypot(way[:, 0], way[:, 1]), np.abs(way[:, 2])
    bearing = atan2(way[:, 1], way[:, 0]) - s[:, 3]
    # Components along the nearest heading and across it; a side of the dual 24-gon is perpendicular to a heading.
    off = np.abs(bearing - np.rint(bearing / TURN_RAD) * TURN_RAD)
    along, across = flat * np.cos(off), flat * np.sin(off)

    def side(u: Floats, w: Floats) -> Floats:
        u, w = np.clip(u, 0.0, _HALF_SIDE), np.clip(w, 0.0, 1.0)
        return np.asarray(along + u * across + w * lift - (np.sqrt(1.0 + u * u + w * w) - 1.0))

    def over_root(value: Floats, of: Floats) -> Floats:
        """Divide by sqrt(1 - of²); infinite from of = 1."""
        root = np.sqrt(np.maximum(1.0 - of * of, 0.0))
        return np.asarray(np.divide(value, root, out=np.full_like(value, np.inf), where=root > 0.0))

    straight, beyond = np.hypot(flat, lift), np.hypot(across, lift)
    candidates = [
        straight,
        side(over_root(across, beyond), over_root(lift, beyond)),
        side(np.full_like(flat, _HALF_SIDE), over_root(lift, lift) * math.hypot(1.0, _HALF_SIDE)),
        side(over_root(across, across) * math.sqrt(2.0), np.ones_like(flat)),
        # The goal lies above or below, except for the Approach's horizontal part.
        np.where(flat <= math.sqrt(0.5), lift + 1.0 - np.sqrt(np.maximum(1.0 - flat * flat, 0.0)), 0.0),
    ]
    return np.asarray(max_approach_m * np.maximum.reduce(candidates), np.float64)
