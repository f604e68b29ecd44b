"""Distances to a goal along flyable paths, and blocked actions: for rewards and teachers; no agent may know them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import RADIUS_M
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.geometry.motion import DISPLACEMENTS
from aerialdojo_gen.planning.cost_to_go import cost_to_go, costs_at
from aerialdojo_gen.planning.flight_space import FlightSpace, flight_space
from aerialdojo_gen.scenes.context import context_of

Floats = NDArray[np.float64]


def blocked_actions(space: FlightSpace, poses: ArrayLike) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Floats]:
    """For poses (n, 4): whether actions collide or are refused, (n, 16) each, and where they lead, (n, 16, 3)."""
    p = np.asarray(poses, np.float64).reshape(-1, 4)
    c, s = np.cos(p[:, 3])[:, None], np.sin(p[:, 3])[:, None]
    ahead, left, up = DISPLACEMENTS[:N_ACTIONS].T
    ends = np.stack([p[:, :1] + (c * ahead - s * left), p[:, 1:2] + (s * ahead + c * left), p[:, 2:3] + up], axis=2)
    collides, refused = np.zeros((2, len(p), N_ACTIONS), np.bool_)
    moves = np.flatnonzero(DISPLACEMENTS[:N_ACTIONS].any(axis=1)).tolist()
    for k, here in enumerate(map(tuple, p[:, :3].tolist())):
        for a in moves:
            collides[k, a], refused[k, a] = space.motion_outcome(here, tuple(ends[k, a].tolist()))
    ends[refused] = np.broadcast_to(p[:, None, :3], ends.shape)[refused]
    return collides, refused, ends


# Ways longer than this are not found, metres: the longest tasks have routes of 100 m, and who strays flies farther.
_FARTHEST_M = 200.0
# How far from the goal a way over the grid may end: what a reference's Approach flies at most, metres.
_REACH_M = 1.0
# Fields that a scene keeps, some ten megabytes each.
_KEPT = 8


class Geodesic:
    """Lengths of shortest ways to the goals of a scene."""

    def __init__(self, space: FlightSpace) -> None:
        self._space, self._grid = space, space.grid
        self._field = lru_cache(maxsize=_KEPT)(self._make_field)

    def distances_m(self, goal: ArrayLike, points: ArrayLike) -> Floats:
        """Shortest way lengths (n,), metres in the action metric, from points (n, 3) to a goal; inf for none."""
        g, p = np.asarray(goal, np.float64), np.asarray(points, np.float64).reshape(-1, 3)
        found = np.asarray(costs_at(np.ascontiguousarray(p), self._grid.arrays, self._field(*g.tolist())))
        return np.maximum(found, np.linalg.norm(p - g, axis=1))

    def actions(self, goal: ArrayLike, poses: ArrayLike) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Floats]:
        """For poses (n, 4), (n, 16) each: whether actions collide or are refused, and the cost-to-go in metres."""
        collides, refused, ends = blocked_actions(self._space, poses)
        cost = self.distances_m(goal, ends.reshape(-1, 3)).reshape(-1, N_ACTIONS)
        return collides, refused, np.where(collides, np.inf, cost)

    def _make_field(self, *goal: float) -> NDArray[np.float32]:
        return cost_to_go(np.array([*goal, 0.0]), self._grid, _REACH_M, _FARTHEST_M, _FARTHEST_M + 2 * _REACH_M)


def geodesic(mesh: Path, sha256: str, radius_m: float = RADIUS_M) -> Geodesic:
    """Return a scene's distances, a part of its context; parameters as for `flight_space`."""
    space = flight_space(mesh, sha256, radius_m)
    return context_of(space.scene).part("geodesic", lambda: Geodesic(space), radius_m)
