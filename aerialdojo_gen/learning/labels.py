"""Labels of samples, distances along flyable paths, which no agent may know, and samples joined to batches."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import RADIUS_M
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.motion import DISPLACEMENTS
from aerialdojo_gen.learning.index import Index
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


def blocked_at(space: FlightSpace, poses: ArrayLike) -> NDArray[np.bool_]:
    """Blocked actions at poses (n, 4): those that collide or are refused, (n, 16) bool."""
    collides, refused, _ = blocked_actions(space, poses)
    return collides | refused


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
        costs = np.asarray(costs_at(np.ascontiguousarray(p), self._grid.arrays, self._field(*g.tolist())))
        return np.maximum(costs, np.linalg.norm(p - g, axis=1))

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


PRIVILEGED = ("pose", "goal_distance_m", "actions")
# In the place of the action before the first one.
NO_ACTION = N_ACTIONS


def labels_at(
    index: Index, k: int, steps: NDArray[np.int64], privileged: Sequence[str] = ()
) -> dict[str, NDArray[Any]]:
    """Labels of some steps of trajectory k, by name: arrays that lead with the step."""
    actions, poses = index.routes[k].astype(np.int64), index.poses_of(k)
    out: dict[str, NDArray[Any]] = {
        "action": actions[steps],
        "previous_action": np.concatenate([[NO_ACTION], actions[:-1]])[steps],
        "remaining_actions": (index.budget[k] - steps).astype(np.int32),
        "odometry": odometry(poses)[steps].astype(np.float32),
    }
    if "pose" in privileged:
        out["pose"] = poses[steps]
    if {"goal_distance_m", "actions"} & {*privileged}:
        geodesics, goal = geodesic(*mesh_of(*index.sources[k])), index.goal[k]
        if "goal_distance_m" in privileged:
            out["goal_distance_m"] = geodesics.distances_m(goal, poses[steps, :3]).astype(np.float32)
        if "actions" in privileged:
            out["action_collides"], out["action_refused"], cost = geodesics.actions(goal, poses[steps])
            out["action_cost_to_go_m"] = cost.astype(np.float32)
    return out


def odometry(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses in the frame of the first: x ahead, y left, z up in metres, and yaw in radians."""
    return np.column_stack([to_body_frame(poses[:1], poses[:, :3]), wrap_angle_rad(poses[:, 3] - poses[0, 3])])


def to_body_frame(poses: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places (n, 3) in the frames of bodies (n, 4) or (1, 4): ahead, left, up, metres."""
    away = places - poses[:, :3]
    c, s = np.cos(poses[:, 3]), np.sin(poses[:, 3])
    return np.column_stack([away[:, 0] * c + away[:, 1] * s, away[:, 1] * c - away[:, 0] * s, away[:, 2]])


# What a sample has once, and not for every step.
WHOLE = ("step", "tokens", "image", "has_image")


def collate(samples: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Join samples to a batch, as `Trajectories.batch` gives it: a ``collate_fn`` that needs no torch.

    Parameters
    ----------
    samples : sequence of dict
        Of one data set; of different T they are padded at their front.

    Returns
    -------
    dict
        Arrays that lead with the sample, and lists of texts.
    """
    window = max(len(sample["mask"]) for sample in samples)
    out: dict[str, Any] = {name: [sample[name] for sample in samples] for name in samples[0]}
    for name, values in out.items():
        if name in WHOLE:
            out[name] = np.stack(values)
        elif not isinstance(values[0], str):
            pad = [np.zeros((window - len(v), *v.shape[1:]), v.dtype) for v in values]
            out[name] = np.stack([*map(np.concatenate, zip(pad, values, strict=True))])
    return out


def split_batch(batch: dict[str, Any], k: int, whole: bool) -> dict[str, Any]:
    """Return one of a batch's samples; a whole trajectory without what it was padded with."""
    begin = int(batch["mask"][k].argmax()) if whole else 0
    return {
        name: value[k] if isinstance(value, list) or name in WHOLE else value[k, begin:]
        for name, value in batch.items()
    }


def scatter_rows(seen: NDArray[Any], mask: NDArray[np.bool_]) -> NDArray[Any]:
    """Put rows in their places of a mask, and zeros elsewhere."""
    out = np.zeros((*mask.shape, *seen.shape[1:]), seen.dtype)
    out[mask] = seen
    return out
