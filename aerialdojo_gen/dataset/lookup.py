"""Access to a release: a scene with its mesh, a task by its id."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.annotations.language.sides import described
from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AssetError, StoreError, UsageError
from aerialdojo_gen.base.names import choose_scenes, closest, unknown
from aerialdojo_gen.dataset.contents import existing_parts, no_release, scenes_in_release
from aerialdojo_gen.planning.collision import collision_world
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.stored import mesh_copy
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, Where, open_root
from aerialdojo_gen.store.shards import read_scene, shards

_TASK_ID = re.compile(r"(?P<nav>(?P<scene>[A-Za-z0-9][A-Za-z0-9_-]*)-(?P<key>[0-9a-f]{12}))(?:-[si])?")
SIDES = ("train", "test")


def read_side(root: DataRoot, table: str, side: str, scene: str, columns: Sequence[str] | None) -> pa.Table:
    """Read a scene's ``tasks`` or ``routes`` of train or test, with the column ``split`` (``id_train``, …)."""
    part = store.read_scene(root, f"{table}/{side}", scene, columns)
    split = f"{store.partition(scene)}_{side}"
    return part.append_column("split", pa.array([split] * part.num_rows, pa.string()))


class ReleasedScene:
    """One scene of a release; tables and mesh are read on first access."""

    def __init__(self, data: Where, name: str) -> None:
        self.root = open_root(data)
        known = scenes_in_release(self.root)
        if name not in known:
            raise UsageError(unknown(f"the release in {self.root} has no scene", name, known, most=3))
        self.name = name

    @cached_property
    def row(self) -> dict[str, Any]:
        """The row of `scenes`."""
        rows = self._rows("scenes")
        if len(rows) != 1:
            raise StoreError(
                f"release/scenes has {len(rows)} rows of {self.name}: run {command('split', scene=self.name)}"
            )
        return rows[0]

    @cached_property
    def landmarks(self) -> list[dict[str, Any]]:
        """Rows of `landmarks`."""
        return self._rows("landmarks")

    @cached_property
    def objects(self) -> list[dict[str, Any]]:
        """Rows of `objects`, reference images and all."""
        return self._rows("objects")

    @cached_property
    def anchors(self) -> list[dict[str, Any]]:
        """Rows of `anchors`."""
        return self._rows("anchors")

    def _rows(self, table: str) -> list[dict[str, Any]]:
        return store.read_scene(self.root, f"release/{table}", self.name).to_pylist()

    def both_sides(self, table: str, columns: Sequence[str] | None = None) -> pa.Table:
        """Read ``tasks`` or ``routes`` of train and test together, with the column ``split`` (``id_train``, …)."""
        return pa.concat_tables([read_side(self.root, table, side, self.name, columns) for side in SIDES])

    @cached_property
    def routes(self) -> pa.Table:
        """All of `routes`, with the column ``split``."""
        return self.both_sides("routes")

    @property
    def model(self) -> Scene:
        """The scene's mesh, of its context: read again where that had to go."""
        mesh_path = self.row["mesh_path"]
        try:
            path = mesh_copy(self.root, mesh_path)
        except FileNotFoundError:
            raise AssetError(
                f"the mesh {self.root.at(mesh_path)} is missing: run {command('build-scenes', scene=self.name)}"
            ) from None
        return open_scene(path, self.row["mesh_sha256"], SEVERAL).scene

    def route(self, nav_id: str) -> dict[str, Any]:
        """Return the row of `routes`, with ``split``; UsageError if there is none."""
        found = self.routes.filter(pc.equal(self.routes["nav_id"], nav_id)).to_pylist()
        if not found:
            raise UsageError(unknown("no navigation task", nav_id, self.routes["nav_id"].to_pylist()))
        return dict(found[0])

    def instances(self, nav_id: str) -> list[dict[str, Any]]:
        """Return the rows of `tasks` of a navigation task: semantic first, then image."""
        rows = self._tasks.filter(pc.equal(self._tasks["nav_id"], nav_id)).to_pylist()
        return sorted(rows, key=lambda row: row["modality"] != "semantic")

    @cached_property
    def _tasks(self) -> pa.Table:
        return self.both_sides("tasks")

    def object(self, object_id: int) -> dict[str, Any]:
        """Return the row of `objects`; UsageError if there is none."""
        return self._one(self.objects, "object", object_id)

    def landmark(self, landmark_id: int) -> dict[str, Any]:
        """Return the row of `landmarks`; UsageError if there is none."""
        return self._one(self.landmarks, "landmark", landmark_id)

    def _one(self, rows: list[dict[str, Any]], what: str, number: int) -> dict[str, Any]:
        for row in rows:
            if row[f"{what}_id"] == number:
                return row
        raise UsageError(f"{self.name} has no {what} {number}")

    def clearance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances from points (n, 3), world frame, to the nearest surface (n,), metres, by FCL."""
        world = collision_world(self.model)
        return np.array([world.distance_m(p) for p in points], dtype=np.float64)


@dataclass(frozen=True)
class TaskRecord:
    """What an id stands for."""

    scene: ReleasedScene
    nav_id: str
    route: dict[str, Any]  # The row of `routes`, with ``split``
    instances: list[dict[str, Any]]  # Its rows of `tasks`, semantic first

    def as_json(self) -> dict[str, Any]:
        """Return the rows that belong to the task: of `routes`, `tasks`, `objects`, `landmarks` and `scenes`."""
        scene, route = self.scene, self.route
        target = scene.object(route["target_object_id"])
        return {
            "nav_id": self.nav_id, "scene": scene.row, "tasks": self.instances, "route": route,
            "target": target, "start_object": scene.object(route["start_object_id"]),
            "landmark": scene.landmark(target["landmark_id"]),
        }  # fmt: skip


def find_task(data: Where, task_id: str) -> TaskRecord:
    """Find a task by its ``task_id`` or ``nav_id``; UsageError, which names the nearest, if there is none."""
    root = open_root(data)
    known = scenes_in_release(root)
    match = _TASK_ID.fullmatch(task_id)
    listing = f'tasks are listed by pandas.read_parquet({f"{root}/release/tasks"!r})["task_id"]'
    if match is None:
        example = ReleasedScene(root, known[0]).routes["nav_id"].to_pylist()
        like = f", e.g. {min(example)}-s" if example else ""
        raise UsageError(
            f"{task_id!r} is no task id: <scene>-<12 hexadecimal digits>, or with -s or -i{like}; {listing}"
        )
    scene = ReleasedScene(root, match["scene"])
    ids = scene.routes["nav_id"].to_pylist()
    nav_id = match["nav"]
    if nav_id not in ids:
        near = closest(nav_id, ids, cutoff=0.0)
        hint = f"the nearest is {near[0]}; " if near else ""
        raise UsageError(f"no task {task_id!r} in the release of {scene.name}: {hint}{listing}")
    instances = scene.instances(nav_id)
    if not instances:
        raise StoreError(
            f"release/tasks has no instance of {nav_id}, which release/routes has: "
            f"run {command('split', scene=scene.name)}"
        )
    return TaskRecord(scene, nav_id, scene.route(nav_id), instances)


def scenes_with_pictures(where: Where, patterns: Sequence[str] | None = None) -> list[str]:
    """List the scenes that have reference pictures."""
    root = open_root(where)
    folders = {PurePosixPath(path).name for path in root.list("references")}
    staged = {scene for scene in folders if shards(root, "references", scene)}
    there = sorted(staged | set(existing_parts(root)["release/objects"]))
    if not there:
        raise no_release(root)
    return choose_scenes(patterns, there)


def pictured_objects(where: Where, scene: str) -> list[dict[str, Any]]:
    """Read a scene's objects with their pictures: rows of `objects`, `descriptions` and `references` together."""
    root = open_root(where)
    if not shards(root, "references", scene):
        rows: list[dict[str, Any]] = read_scene(root, "release/objects", scene).to_pylist()
        return rows
    table = described(read_scene(root, "objects", scene), read_scene(root, "descriptions", scene))
    objects = {row["object_id"]: row for row in table.to_pylist()}
    return [objects[row["object_id"]] | row for row in read_scene(root, "references", scene).to_pylist()]
