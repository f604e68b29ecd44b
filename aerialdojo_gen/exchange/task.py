"""What a reader makes of one record, whatever its format, and the rows and tables of imports that it becomes.

The tables have the release's columns, nullable where formats lack them, and say where a row is from. Poses are in the
world frame.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.config.shared import TaskConfig
from aerialdojo_gen.exchange.folder import check_picture, inside
from aerialdojo_gen.exchange.frames import Frame
from aerialdojo_gen.exchange.records import BadField
from aerialdojo_gen.geometry.frames import quaternion_xyzw_to_yaw, wrap_turned_rad
from aerialdojo_gen.geometry.motion import route_length_m
from aerialdojo_gen.store.schemas import RELEASE_OBJECTS, ROUTES, TASKS, TableSpec
from aerialdojo_gen.store.schemas.staged import column, list_of
from aerialdojo_gen.store.tables import check_table, from_rows, write_file

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
    action: list[int] | None  # What is done at every pose, in our set; None where a step is none of ours
    source_action: list[str]  # The file's own names
    replay_error_m: float  # Metres between the recorded end and the replayed one


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

    def start_pose(self, position: Floats, yaw_rad: ArrayLike) -> Floats:
        """Make a world pose, (4,) float64, of a position and a yaw of the file's frame."""
        return np.append(self.frame.positions_to_world(position), self.frame.yaw_to_world(yaw_rad))

    def upright_pose(self, position: Floats, quaternion_xyzw: Floats) -> Floats:
        """Make a world pose, (4,) float64; roll and pitch, which the tables lack, are noted."""
        if abs(quaternion_xyzw[0]) > 1e-6 or abs(quaternion_xyzw[1]) > 1e-6:
            self.notes["the start's attitude has roll or pitch: only its yaw is kept"] += 1
        return self.start_pose(position, quaternion_xyzw_to_yaw(quaternion_xyzw))


_SOURCE = (
    column("source_file", pa.string(), "file that the row is from, relative to what was imported"),
    column("source_row", pa.int64(), "its place in that file's list, from 0"),
    column("source_id", pa.string(), "its id there"),
)
_REPLAY = "metres between the recorded end and that of a replay of the file's actions; null without either"


def _imported(spec: TableSpec, key: tuple[str, ...], required: tuple[str, ...], *more: pa.Field) -> TableSpec:
    """The table as imports have it: all but the key and required columns may be null, and some stand beside them."""
    fields = [f.with_nullable(f.name not in key + required) for f in spec.schema]
    return TableSpec(spec.name, pa.schema([*fields, *more]), key)


IMPORTED_TASKS = _imported(
    TASKS, ("source_file", "source_row", "modality"),
    ("task_id", "nav_id", "scene", "start_x_m", "start_y_m", "start_z_m", "start_yaw_rad"), *_SOURCE,
)  # fmt: skip
IMPORTED_ROUTES = _imported(
    ROUTES, ("source_file", "source_row"), ("nav_id", "scene"),
    column("replay_error_m", pa.float64(), _REPLAY, "m", True),
    column("source_action", list_of(pa.string()), "the file's own names of actions", nullable=True),
    column("stated_length_m", pa.float64(), "length of the shortest way, as the file states it", "m", True), *_SOURCE,
)  # fmt: skip
IMPORTED_OBJECTS = _imported(
    RELEASE_OBJECTS, ("scene", "object_id", "reference_image_id"), (),
    column("landmark", pa.string(), "name of the landmark nearest to it", nullable=True),
)  # fmt: skip


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
    """Make the task's rows of `IMPORTED_TASKS`, one an instance."""
    known = task.known
    setting = known.get("setting")
    shared = source | {name: known.get(name) for name in _KNOWN} | {
        "nav_id": nav_id, "scene": task.scene, "setting": setting,
        "action_budget": _BUDGETS.get(setting) if setting else None,
        **dict(zip(("start_x_m", "start_y_m", "start_z_m", "start_yaw_rad"), task.start.tolist(), strict=True)),
    }  # fmt: skip
    return [
        shared | {
            "task_id": f"{nav_id}-{instance.modality[0]}", "modality": instance.modality,
            "description": instance.description, "reference_image_id": picture,
        }
        for instance, picture in zip(task.instances, pictures, strict=True)
    ]  # fmt: skip


def route_row(task: Task, nav_id: str, source: dict[str, Any]) -> dict[str, Any]:
    """Make the task's row of `IMPORTED_ROUTES`; lengths follow from the poses."""
    columns = IMPORTED_ROUTES.schema.names
    row = source | {name: value for name, value in task.known.items() if name in columns}
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
        # One a pose: what is done there, the last being Stop.
        "n_actions": len(poses),
    }
    return row


# A part of a table is full at so many rows, poses or bytes of pictures.
_FULL = {"tasks": 8192, "routes": 1 << 17, "objects": 16 << 20}
_SPECS = {spec.name: spec for spec in (IMPORTED_TASKS, IMPORTED_ROUTES, IMPORTED_OBJECTS)}


class Tables:
    """Writes rows as they come, a part when enough are there, so that memory does not grow with the files."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._rows: dict[str, list[dict[str, Any]]] = {table: [] for table in _SPECS}
        self._weight: Counter[str] = Counter()
        self._parts: Counter[str] = Counter()
        self.written: Counter[str] = Counter()
        self.nulls: Counter[str] = Counter()

    def add(self, table: str, row: dict[str, Any]) -> None:
        """Add a row of tasks, routes or objects, null where it has no value; objects come in the order of the key."""
        self._rows[table].append(dict.fromkeys(_SPECS[table].schema.names) | row)
        if table == "objects":
            self._weight[table] += len(row["reference_image"] or b"") + 1000
        else:
            self._weight[table] += len(row.get("x_m") or ".")
        if self._weight[table] >= _FULL[table]:
            self._flush(table)

    def _flush(self, table: str) -> None:
        rows, self._rows[table], self._weight[table] = self._rows[table], [], 0
        if not rows and self._parts[table]:
            return
        written = check_table(_SPECS[table], from_rows(_SPECS[table], rows))
        for name in written.column_names:
            self.nulls[f"{table}.{name}"] += written.column(name).null_count
        folder = self._root / table
        folder.mkdir(exist_ok=True)
        write_file(folder / f"part-{self._parts[table]:05d}.parquet", written)
        self._parts[table] += 1
        self.written[table] += written.num_rows

    def close(self) -> None:
        """Write what is left; every table has at least one part, if an empty one."""
        for table in _SPECS:
            self._flush(table)
