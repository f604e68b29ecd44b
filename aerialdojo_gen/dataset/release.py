"""A release in Python: its tables, scenes, meshes, pictures and recordings, and any task by its id."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import as_names, check_known
from aerialdojo_gen.base.pictures import decode_rgb
from aerialdojo_gen.dataset.contents import TABLES, scenes_in_release
from aerialdojo_gen.dataset.lookup import SIDES, ReleasedScene, TaskRecord, find_task, read_side
from aerialdojo_gen.rendering.reader import Recording, read_recording
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, open_root
from aerialdojo_gen.store.schemas import SUBSETS

# Each keeps its mesh once that is read, 10 to 100 MB.
_MAX_SCENES = 4


class Release:
    """A release that was made, or copied here; everything is read on first access.

    Parameters
    ----------
    data : str, Path or DataRoot
        The data directory, in which ``release/`` lies, and beside it ``meshes/`` and ``media/``.

    Attributes
    ----------
    scenes : list of str
        Names of its scenes, sorted.

    Raises
    ------
    StoreError
        There is no release.
    """

    def __init__(self, data: str | Path | DataRoot) -> None:
        self._data = open_root(data)
        self.scenes = scenes_in_release(self._data)
        self._scene = lru_cache(maxsize=_MAX_SCENES)(lambda name: ReleasedScene(self._data, name))

    def __repr__(self) -> str:
        return f"<release in {self._data}, {len(self.scenes)} scenes>"

    def table(
        self,
        name: str,
        *,
        split: str | Sequence[str] | None = None,
        scene: str | Sequence[str] | None = None,
        columns: Sequence[str] | None = None,
    ) -> pa.Table:
        """Read a table.

        Parameters
        ----------
        name : str
            ``tasks``, ``routes``, ``objects``, ``landmarks``, ``anchors`` or ``scenes``.
        split : str or sequence of str, optional
            Of ``id_train``, ``id_test``, ``ood_train``, ``ood_test``; all where absent. For tasks and routes.
        scene : str or sequence of str, optional
            Names or globs; all where absent.
        columns : sequence of str, optional
            Read these alone.

        Returns
        -------
        pyarrow.Table
            The columns of docs/release-format.md; tasks and routes with ``split`` besides. Ordered by scene and key.
            ``.to_pandas()`` makes a DataFrame of it.

        Raises
        ------
        UsageError
            There is no table, split, scene or column of that name.
        StoreError
            A part is missing or damaged.
        """
        check_known("no table", [name], TABLES)
        table_of = TABLES[name]
        splits = as_names(SUBSETS if split is None else split) or SUBSETS
        check_known("no split", splits, SUBSETS)
        if split is not None and not table_of.split:
            raise UsageError(f"{name} is one table, not split: leave split out")
        read = None if columns is None else [column for column in columns if column != "split" or not table_of.split]
        check_known(f"no column of {name}", read or (), table_of.spec.schema.names)
        parts = []
        for scene_name in scenes_in_release(self._data, None if scene is None else as_names(scene)):
            if not table_of.split:
                parts.append(store.read_scene(self._data, f"release/{name}", scene_name, read))
                continue
            sides = [side for side in SIDES if f"{store.partition(scene_name)}_{side}" in splits]
            parts += [read_side(self._data, name, side, scene_name, read) for side in sides]
        if not parts:
            raise UsageError(f"no scene that was asked for has a part in {', '.join(splits)}")
        table = pa.concat_tables(parts)
        return table if columns is None else table.select(list(columns))

    def tasks(
        self, *, split: str | Sequence[str] | None = None, scene: str | Sequence[str] | None = None
    ) -> pa.Table:
        """Read the task instances: what an agent may know; parameters as for `table`."""
        return self.table("tasks", split=split, scene=scene)

    def routes(
        self, *, split: str | Sequence[str] | None = None, scene: str | Sequence[str] | None = None
    ) -> pa.Table:
        """Read the navigation tasks: goal and reference trajectory, for the evaluator; parameters as for `table`."""
        return self.table("routes", split=split, scene=scene)

    def objects(self, *, scene: str | Sequence[str] | None = None) -> pa.Table:
        """Read the objects, reference images (PNG bytes) and all."""
        return self.table("objects", scene=scene)

    def landmarks(self, *, scene: str | Sequence[str] | None = None) -> pa.Table:
        """Read the landmarks."""
        return self.table("landmarks", scene=scene)

    def anchors(self, *, scene: str | Sequence[str] | None = None) -> pa.Table:
        """Read the anchors."""
        return self.table("anchors", scene=scene)

    def task(self, task_id: str) -> TaskRecord:
        """Find a task by its ``task_id`` or ``nav_id``; UsageError if there is none, with the nearest."""
        return find_task(self._data, task_id)

    def scene(self, name: str) -> ReleasedScene:
        """Open a scene; UsageError if there is none, with the nearest."""
        opened: ReleasedScene = self._scene(name)
        return opened

    def mesh(self, name: str) -> Scene:
        """Read a scene's mesh: named instances with their triangles, metres, world frame.

        Raises
        ------
        UsageError
            There is no such scene.
        AssetError
            The mesh is missing, or is not the one that the release was made from.
        """
        return self.scene(name).model

    def picture(self, task_id: str) -> NDArray[np.uint8] | None:
        """Return the picture of a task's target, (H, W, 3) uint8, sRGB; None where the target has none."""
        found = self.task(task_id)
        return decode_rgb(found.scene.object(found.route["target_object_id"])["reference_image"])

    def recorded(self) -> list[str]:
        """List the ``nav_id`` of the trajectories that were rendered, sorted."""
        return sorted(path.split("/")[-2] for path in open_root(self._data).list("media", "*/*/recording.json"))

    def recording(self, task_id: str) -> Recording:
        """Open the recording of a task's reference trajectory; RenderError where it was not rendered."""
        found = self.task(task_id)
        return read_recording(self._data.local_copy(f"media/{found.scene.name}/{found.nav_id}"))


def open_release(data: str | Path | DataRoot = "data") -> Release:
    """Open a release.

    Parameters
    ----------
    data : str, Path or DataRoot
        The data directory.

    Returns
    -------
    Release

    Raises
    ------
    StoreError
        There is no release.
    """
    return Release(data)
