"""Look into a release: one scene of it with its mesh, one task of it by its id."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.errors import AssetError, StoreError, UsageError
from aerialdojo_gen.planning.collision import collision_world
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store import shards as store

_TASK_ID = re.compile(r"(?P<nav>(?P<scene>[A-Za-z0-9][A-Za-z0-9_-]*)-(?P<key>[0-9a-f]{12}))(?:-[si])?")
_SIDES = ("train", "test")


class ReleasedScene:
    """One scene of a release; tables and mesh are read when they are first asked for.

    Parameters
    ----------
    data : Path
        The data directory.
    name : str
        Name of the scene.

    Raises
    ------
    UsageError
        The release has no such scene; the message names those that it has.
    StoreError
        There is no release.
    """

    def __init__(self, data: Path, name: str) -> None:
        known = store.release_scenes(data)
        if not known:
            raise StoreError(f"there is no release in {data}: run aerialdojo-gen split, or give --data")
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(known)}"
            raise UsageError(f"the release in {data} has no scene {name!r}: {hint}")
        self.data, self.name = data, name

    @cached_property
    def row(self) -> dict[str, Any]:
        """The row of `scenes`."""
        rows = self._rows("scenes")
        if len(rows) != 1:
            raise StoreError(f"release/scenes has {len(rows)} rows of {self.name}: run aerialdojo-gen split")
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
        return store.read_scene(self.data, f"release/{table}", self.name).to_pylist()

    def both_sides(self, table: str, columns: Sequence[str] | None = None) -> pa.Table:
        """Read ``tasks`` or ``routes`` of train and test together, with the column ``split`` (``id_train``, …)."""
        parts = []
        for side in _SIDES:
            part = store.read_scene(self.data, f"{table}/{side}", self.name, columns)
            split = f"{store.partition(self.name)}_{side}"
            parts.append(part.append_column("split", pa.array([split] * part.num_rows, pa.string())))
        return pa.concat_tables(parts)

    @cached_property
    def routes(self) -> pa.Table:
        """All of `routes`, with the column ``split``."""
        return self.both_sides("routes")

    @property
    def model(self) -> Scene:
        """The scene's mesh, of its context: read again where that had to go.

        Raises
        ------
        AssetError
            The mesh is missing, leads out of the data directory, or is not the one that the release was made from.
        """
        path = self.data / self.row["mesh_path"]
        if not path.resolve().is_relative_to(self.data.resolve()):
            raise AssetError(f"release/scenes: mesh_path {self.row['mesh_path']!r} leads out of {self.data}")
        return open_scene(path, self.row["mesh_sha256"], SEVERAL).scene

    def route(self, nav_id: str) -> dict[str, Any]:
        """Return the row of `routes`, with ``split``; UsageError where there is none."""
        found = self.routes.filter(pc.equal(self.routes["nav_id"], nav_id)).to_pylist()
        if not found:
            raise UsageError(f"no navigation task {nav_id!r} in the release")
        return dict(found[0])

    def instances(self, nav_id: str) -> list[dict[str, Any]]:
        """Return the rows of `tasks` of a navigation task: semantic first, then image."""
        tasks = self._tasks
        rows = tasks.filter(pc.equal(tasks["nav_id"], nav_id)).to_pylist()
        return sorted(rows, key=lambda row: row["modality"] != "semantic")

    @cached_property
    def _tasks(self) -> pa.Table:
        return self.both_sides("tasks")

    def object(self, object_id: int) -> dict[str, Any]:
        """Return the row of `objects`; UsageError where there is none."""
        for row in self.objects:
            if row["object_id"] == object_id:
                return row
        raise UsageError(f"{self.name} has no object {object_id}")

    def landmark(self, landmark_id: int) -> dict[str, Any]:
        """Return the row of `landmarks`; UsageError where there is none."""
        for row in self.landmarks:
            if row["landmark_id"] == landmark_id:
                return row
        raise UsageError(f"{self.name} has no landmark {landmark_id}")

    def clearance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances from points (n, 3), world frame, to the nearest surface (n,), metres, by FCL."""
        world = collision_world(self.model)
        return np.array([world.distance_m(p) for p in points], dtype=np.float64)


@dataclass(frozen=True)
class FoundTask:
    """What an id stands for.

    Attributes
    ----------
    scene : ReleasedScene
    nav_id : str
    route : dict
        The row of `routes`, with ``split``.
    instances : list of dict
        Its rows of `tasks`, semantic first.
    """

    scene: ReleasedScene
    nav_id: str
    route: dict[str, Any]
    instances: list[dict[str, Any]]


def find_task(data: Path, task_id: str) -> FoundTask:
    """Find a task of the release.

    Parameters
    ----------
    data : Path
        The data directory.
    task_id : str
        A ``task_id`` or a ``nav_id``.

    Returns
    -------
    FoundTask

    Raises
    ------
    UsageError
        There is no such task; the message names the nearest one, or how to list them.
    StoreError
        There is no release, or a part of it is missing or damaged.
    """
    known = store.release_scenes(data)
    if not known:
        raise StoreError(f"there is no release in {data}: run aerialdojo-gen split, or give --data")
    match = _TASK_ID.fullmatch(task_id)
    listing = f'tasks are listed by pandas.read_parquet({str(data / "release" / "tasks")!r})["task_id"]'
    if match is None:
        example = ReleasedScene(data, known[0]).routes["nav_id"].to_pylist()
        like = f", e.g. {min(example)}-s" if example else ""
        raise UsageError(
            f"{task_id!r} is no task id: <scene>-<12 hexadecimal digits>, or with -s or -i{like}; {listing}"
        )
    scene = ReleasedScene(data, match["scene"])
    ids = scene.routes["nav_id"].to_pylist()
    nav_id = match["nav"]
    if nav_id not in ids:
        near = difflib.get_close_matches(nav_id, ids, n=1, cutoff=0.0)
        hint = f"the nearest is {near[0]}; " if near else ""
        raise UsageError(f"no task {task_id!r} in the release of {scene.name}: {hint}{listing}")
    instances = scene.instances(nav_id)
    if not instances:
        raise StoreError(
            f"release/tasks has no instance of {nav_id}, which release/routes has: run aerialdojo-gen split"
        )
    return FoundTask(scene, nav_id, scene.route(nav_id), instances)
