"""What a reader makes of one record, whatever its format: poses in the world frame, names, actions."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.shared import TaskConfig
from aerialdojo_gen.exchange.fields import BadField
from aerialdojo_gen.exchange.folder import check_picture, inside
from aerialdojo_gen.exchange.frames import Frame
from aerialdojo_gen.exchange.tables import IMPORTED_ROUTES
from aerialdojo_gen.geometry.frames import wrap_turned_rad
from aerialdojo_gen.geometry.motion import route_length_m
from aerialdojo_gen.store.schemas import SPLIT_COLUMNS

Floats = NDArray[np.float64]


class Instance(NamedTuple):
    """One of a task's instances: the goal in words or as a picture."""

    modality: str
    description: str | None = None
    picture: Path | None = None


@dataclass(frozen=True)
class Route:
    """A reference trajectory."""

    poses: Floats  # (n, 4) float64; x, y, z in metres and yaw in radians, world frame
    action: list[int] | None = None  # What is done at every pose, in our set; None where a step is none of ours
    source_action: list[str] | None = None  # The file's own names
    replay_error_m: float | None = None  # Metres between the recorded end and the replayed one


@dataclass
class Task:
    """A navigation task."""

    source_id: str  # The record's id in its file
    scene: str  # Name of the scene
    start: Floats  # (4,) float64; start pose, world frame
    goal: Floats | None  # (3,) float64 or None; where success is measured from, world frame
    instances: list[Instance]  # How its goal is described
    nav_id: str | None = None  # None: made of the file's name and the id
    object_key: object = None
    object_m: Floats | None = None  # (3,) float64 or None; where the object is, world frame
    route: Route | None = None  # The reference trajectory
    has_route_row: bool = True  # False where another record of the same navigation task has brought it already
    known: dict[str, Any] = field(default_factory=dict)


@dataclass
class Context:
    """What a reader gets beside the record."""

    file: Path  # The file
    label: str  # Its name as tables have it
    frame: Frame  # The file's frame
    angles: str  # Unit of angles where the format has both: radians, degrees or mixed
    pictures: Path | None  # Folder below which pictures lie; None: leave them aside
    notes: Counter[str]  # Remarks about the file, and of how many records

    def start_pose(self, position: Floats, yaw_rad: float) -> Floats:
        """Make a world pose, (4,) float64, of a position and a yaw of the file's frame."""
        return np.append(self.frame.positions_to_world(position), self.frame.yaw_to_world(yaw_rad))

    def upright_pose(self, position: Floats, quaternion_xyzw: Floats) -> Floats:
        """Make a world pose, (4,) float64; roll and pitch, which the tables lack, are noted."""
        if abs(quaternion_xyzw[0]) > 1e-6 or abs(quaternion_xyzw[1]) > 1e-6:
            self.notes["the start's attitude has roll or pitch: only its yaw is kept"] += 1
        yaw = self.frame.quaternion_to_world_yaw(quaternion_xyzw)
        return np.append(self.frame.positions_to_world(position), yaw)


_KNOWN = ("family", "scene_type", "partition", "subset", "target_name", "landmark", "direction")
_BUDGETS = {name: getattr(TaskConfig(), name).action_budget for name in ("base", "standard", "long_horizon")}


def picture_at(folder: Path, name: str, field: str) -> Path:
    """Find a picture that a field names below a folder."""
    try:
        return check_picture(inside(folder, name))
    except ValueError as error:
        raise BadField(field, str(error)) from None


def digest(*parts: str) -> str:
    """Twelve hexadecimal digits of some strings."""
    return hashlib.blake2b("\n".join(parts).encode(), digest_size=6).hexdigest()


def task_rows(task: Task, nav_id: str, source: dict[str, Any], pictures: list[str | None]) -> list[dict[str, Any]]:
    """Make the task's rows of `aerialdojo_gen.exchange.tables.IMPORTED_TASKS`, one an instance."""
    known = task.known
    setting = known.get("setting")
    shared = source | dict.fromkeys(SPLIT_COLUMNS) | {name: known.get(name) for name in _KNOWN} | {
        "nav_id": nav_id, "scene": task.scene, "setting": setting,
        "action_budget": _BUDGETS.get(setting) if setting else None,
        **dict(zip(("start_x_m", "start_y_m", "start_z_m", "start_yaw_rad"), task.start.tolist(), strict=True)),
    }  # fmt: skip
    return [
        shared | {
            "task_id": f"{nav_id}-{instance.modality[0]}", "modality": instance.modality,
            "description": instance.description, "reference_image_id": picture, "image_distance_m": None,
        }
        for instance, picture in zip(task.instances, pictures, strict=True)
    ]  # fmt: skip


def route_row(task: Task, nav_id: str, source: dict[str, Any]) -> dict[str, Any]:
    """Make the task's row of `aerialdojo_gen.exchange.tables.IMPORTED_ROUTES`; lengths follow from the poses."""
    row: dict[str, Any] = dict.fromkeys(IMPORTED_ROUTES.schema.names)
    row |= {name: value for name, value in task.known.items() if name in row} | source
    row |= {"nav_id": nav_id, "scene": task.scene}
    if task.goal is not None:
        row |= dict(zip(("goal_x_m", "goal_y_m", "goal_z_m"), task.goal.tolist(), strict=True))
        row["euclidean_m"] = float(np.linalg.norm(task.goal - task.start[:3]))
    if task.route is None:
        return row
    poses = task.route.poses
    length = route_length_m(poses[:, :3])
    row |= {
        "length_m": length,
        "detour_ratio": length / row["euclidean_m"] if row["euclidean_m"] else None,
        **{name: poses[:, k].tolist() for k, name in enumerate(("x_m", "y_m", "z_m"))},
        "yaw_rad": wrap_turned_rad(poses[:, 3]).tolist(),
        "action": task.route.action,
        "source_action": task.route.source_action,
        "replay_error_m": task.route.replay_error_m,
    }
    if task.route.source_action is not None:
        # One a pose: what is done there, the last being Stop.
        row["n_actions"] = len(poses)
    return row
