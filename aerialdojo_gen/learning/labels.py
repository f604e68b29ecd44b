"""Labels of samples, what only teachers and rewards may know, and samples joined to batches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.learning.geodesic import geodesic
from aerialdojo_gen.learning.index import Index

PRIVILEGED = ("pose", "goal_distance_m", "actions")
# In the place of the action before the first one.
NO_ACTION = N_ACTIONS


class Labels:
    """Labels of a selection's trajectories."""

    def __init__(self, index: Index, privileged: tuple[str, ...]) -> None:
        self.index, self.privileged = index, privileged

    def of(self, rows: NDArray[np.int64], steps: NDArray[np.int64], mask: NDArray[np.bool_]) -> dict[str, Any]:
        """Labels of windows of steps (n, T), by name; 0 where the mask is false."""
        index = self.index
        n, window = steps.shape
        out: dict[str, Any] = {
            "action": np.zeros((n, window), np.int64),
            "previous_action": np.zeros((n, window), np.int64),
            "remaining_actions": np.zeros((n, window), np.int32),
            "odometry": np.zeros((n, window, 4), np.float32),
        }
        if "pose" in self.privileged:
            out["pose"] = np.zeros((n, window, 4))
        if "goal_distance_m" in self.privileged:
            out["goal_distance_m"] = np.zeros((n, window), np.float32)
        if "actions" in self.privileged:
            out["action_collides"], out["action_refused"] = np.zeros((2, n, window, N_ACTIONS), np.bool_)
            out["action_cost_to_go_m"] = np.zeros((n, window, N_ACTIONS), np.float32)
        for i, k in enumerate(rows.tolist()):
            here, at = mask[i], steps[i, mask[i]]
            actions, poses = index.actions_of(k), index.poses_of(k)
            out["action"][i, here] = actions[at]
            out["previous_action"][i, here] = np.concatenate([[NO_ACTION], actions[:-1]])[at]
            out["remaining_actions"][i, here] = index.budget[k] - at
            out["odometry"][i, here] = odometry(poses)[at]
            if "pose" in self.privileged:
                out["pose"][i, here] = poses[at]
            if self.privileged and self.privileged != ("pose",):
                self._known(out, i, here, k, poses[at])
        return out

    def _known(
        self, out: dict[str, Any], i: int, here: NDArray[np.bool_], k: int, poses: NDArray[np.float64]
    ) -> None:  # fmt: skip
        ways, goal = geodesic(*mesh_of(*self.index.scene_of(k))), self.index.goal[k]
        if "goal_distance_m" in self.privileged:
            out["goal_distance_m"][i, here] = ways.distances_m(goal, poses[:, :3])
        if "actions" in self.privileged:
            out["action_collides"][i, here], out["action_refused"][i, here], cost = ways.actions(goal, poses)
            out["action_cost_to_go_m"][i, here] = cost


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
    out: dict[str, Any] = {}
    for name, first in samples[0].items():
        values = [sample[name] for sample in samples]
        if isinstance(first, str):
            out[name] = values
        elif name in WHOLE:
            out[name] = np.stack(values)
        else:
            out[name] = np.stack(
                [np.concatenate([np.zeros((window - len(v), *v.shape[1:]), v.dtype), v]) for v in values]
            )
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
