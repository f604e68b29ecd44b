"""Which tables there are, which command writes them, and where their shards lie below a data root.

A table is a folder, a scene a folder in it, a shard a Parquet file; in the release and in the benchmark's tables a
shard is a scene. Names are relative to the data root, with forward slashes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from aerialdojo_gen.base.errors import SceneNameError, UsageError, brief
from aerialdojo_gen.store import schemas

_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
_RELEASE = "release/"


@dataclass(frozen=True)
class Place:
    """Where a table's shards lie and which command writes them."""

    spec: schemas.TableSpec
    template: str
    command: str

    @property
    def in_release(self) -> bool:
        """Whether it is a table of the release."""
        return self.template.startswith(_RELEASE)

    @property
    def one_part(self) -> bool:
        """Whether a scene has one shard of it."""
        return "{part:" not in self.template


_STAGED = "{table}/{scene}/part-{part:05d}.parquet"
_RUN = "{table}/{run}/part-{scene}.parquet"

LAYOUT: dict[str, Place] = {
    **{name: Place(spec, _STAGED, spec.command) for name, spec in schemas.TABLES.items()},
    "tasks/train": Place(schemas.TASKS, "release/tasks/{partition}_train/part-{scene}.parquet", "split"),
    "tasks/test": Place(schemas.TASKS, "release/tasks/{partition}_test/part-{scene}.parquet", "split"),
    "routes/train": Place(schemas.ROUTES, "release/routes/{partition}_train/part-{scene}.parquet", "split"),
    "routes/test": Place(schemas.ROUTES, "release/routes/{partition}_test/part-{scene}.parquet", "split"),
    "release/scenes": Place(schemas.SCENES, "release/scenes/part-{scene}.parquet", "split"),
    "release/landmarks": Place(schemas.LANDMARKS, "release/landmarks/part-{scene}.parquet", "split"),
    "release/objects": Place(schemas.RELEASE_OBJECTS, "release/objects/part-{scene}.parquet", "split"),
    "release/anchors": Place(schemas.RELEASE_ANCHORS, "release/anchors/part-{scene}.parquet", "split"),
    "release/viewpoints": Place(schemas.VIEWPOINTS, "release/viewpoints/part-{scene}.parquet", "split"),
    "episodes": Place(schemas.EPISODES, _RUN, "evaluate"), "steps": Place(schemas.STEPS, _RUN, "evaluate"),
    "timings": Place(schemas.TIMINGS, _RUN, "evaluate"), "failures": Place(schemas.FAILURES, _RUN, "evaluate"),
}  # fmt: skip


_HELD_OUT = re.compile(r"[UNID]_[A-Za-z]+-h\d+")


def partition(scene: str) -> str:
    """Return a scene's partition: ``"ood"`` for the suffix ``_1`` and worlds that are held out, else ``"id"``."""
    return "ood" if scene.endswith("_1") or _HELD_OUT.fullmatch(scene) else "id"


def check_scene_name(scene: str) -> str:
    """Return the name if it is a plain one; it becomes part of paths, so SceneNameError for anything else."""
    if not _PLAIN.fullmatch(scene):
        shown = brief(repr(scene), 60)
        raise SceneNameError(f"{shown} is not a scene name: use letters, digits, _ and - (64 at most)")
    return scene


def check_run_name(run: str) -> str:
    """Return the name if it is a plain one; it becomes part of paths, so UsageError for anything else."""
    if not _PLAIN.fullmatch(run):
        raise UsageError(f"{brief(repr(run), 60)} is no name of a run: use letters, digits, _ and - (64 at most)")
    return run


def shard_name(table: str, scene: str, part: int = 0, run: str = "default") -> str:
    """Return the name of a shard, relative to the data root; `run` names the run in tables of the benchmark."""
    return LAYOUT[table].template.format(
        table=table, scene=check_scene_name(scene), part=part, partition=partition(scene), run=check_run_name(run)
    )


def shard_folder(table: str, scene: str, run: str = "default") -> str:
    """Return the folder of a scene's shards, relative to the data root."""
    return shard_name(table, scene, run=run).rpartition("/")[0]


def is_plain(name: str) -> bool:
    """Whether a name may be a scene's or a run's."""
    return _PLAIN.fullmatch(name) is not None
