"""Tasks of the release, joined with what only the evaluator may know, and the order in which they are drawn."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.annotations.language.sides import of_side
from aerialdojo_gen.base import rng
from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.constants import MODALITIES
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.base.pictures import decode_rgb
from aerialdojo_gen.benchmark.agents.goal import HINTS, Goal, Heading, Rules
from aerialdojo_gen.dataset.contents import scenes_in_release
from aerialdojo_gen.dataset.lookup import read_side
from aerialdojo_gen.dataset.protocol import check_protocol, read_sample
from aerialdojo_gen.geometry.frames import compass_heading
from aerialdojo_gen.planning.flight_space import Point
from aerialdojo_gen.scenes.stored import mesh_copy
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, Where, open_root
from aerialdojo_gen.store.schemas import SETTINGS, SUBSETS, TASKS

# What an episode needs of a task. Releases of other versions have these, whatever else stands in their tables; only
# the last may be missing there.
_COLUMNS = (
    "task_id", "nav_id", "scene", "family", "scene_type", "partition", "subset", "setting", "modality",
    "action_budget", "start_x_m", "start_y_m", "start_z_m", "start_yaw_rad", "target_name", "landmark", "direction",
    "description", "reference_image_id", "image_distance_m",
)  # fmt: skip
_USUAL = {"train": ("id_train", "ood_train"), "test": ("id_test", "ood_test"), "all": tuple(SUBSETS)}
NO_TARGET = -1  # Of a task whose goal is withheld
_FACTS = ("nav_id", "goal_x_m", "goal_y_m", "goal_z_m", "euclidean_m", "length_m", "target_object_id")


@dataclass(frozen=True)
class Selection:
    """Which tasks; an empty field chooses all. ``train``, ``test`` and ``all`` become the names of splits."""

    splits: tuple[str, ...] = ()  # Of `aerialdojo_gen.store.schemas.SUBSETS`
    settings: tuple[str, ...] = ()
    modalities: tuple[str, ...] = ()
    scenes: tuple[str, ...] = ()  # Names or globs
    limit: int | None = None  # How many are drawn, evenly over the scenes; a larger limit only adds to them
    seed: int = 0  # Of the draw
    protocol: str = ""  # ``paper``: the tasks of the paper's sample (`aerialdojo_gen.dataset.protocol`) alone

    def __post_init__(self) -> None:
        """Refuse what does not exist, with what there is; give splits their names."""
        names = [name for split in self.splits for name in _USUAL.get(split, (split,))]
        object.__setattr__(self, "splits", tuple(dict.fromkeys(names)))
        check_known("no split", self.splits, (*SUBSETS, *_USUAL))
        check_known("no setting", self.settings, SETTINGS)
        check_known("no modality", self.modalities, MODALITIES)
        check_protocol(self.protocol)
        if self.limit is not None and self.limit < 1:
            raise UsageError(f"a limit is at least 1, not {self.limit}")


@dataclass(frozen=True)
class Task:
    """A task instance with its goal: the evaluator's, never an agent's."""

    row: dict[str, Any]  # Its row of `tasks`, with ``split``
    goal: Point  # Position of the goal anchor, metres, world frame
    euclidean_m: float  # Straight distance from start to goal
    length_m: float  # Of the reference trajectory
    target_id: int  # ``object_id`` of the target; `NO_TARGET` where the release withholds the goals

    @property
    def start(self) -> tuple[float, float, float, float]:
        """Start pose: x, y, z in metres, world frame, and yaw in radians."""
        row = self.row
        return row["start_x_m"], row["start_y_m"], row["start_z_m"], row["start_yaw_rad"]


def select(data: Where, selection: Selection) -> pa.Table:
    """Find the tasks of a selection: `_COLUMNS` and ``split``, sorted by scene, navigation task and modality."""
    root = open_root(data)
    sample = read_sample(root) if selection.protocol else None
    tables = []
    for scene in scenes_in_release(root, selection.scenes):
        if sample is not None and scene not in sample.tasks:
            continue
        for subset in ("train", "test") if sample is None else ("test",):
            if f"{store.partition(scene)}_{subset}" not in (selection.splits or SUBSETS):
                continue
            table = read_side(root, "tasks", subset, scene, _COLUMNS)
            table = table if sample is None else sample.of(scene, table)
            for column, chosen in (("setting", selection.settings), ("modality", selection.modalities)):
                if chosen:
                    table = table.filter(pc.is_in(table[column], pa.array(chosen, pa.string())))
            tables.append(table)
    found = pa.concat_tables(tables) if tables else None
    if found is None or not found.num_rows:
        what = "the paper's sample, test tasks of base and standard," if selection.protocol else "the release"
        raise UsageError(f"no task of {what} fits: widen --split, --setting, --modality or --scene")
    found = found.sort_by([(key, "ascending") for key in TASKS.key])
    if selection.limit is None:
        return found
    scenes, ids = (found[column].to_pylist() for column in ("scene", "task_id"))
    return found.take(pa.array(draw_evenly(scenes, ids, selection.limit, selection.seed, "evaluate")))


def draw_evenly(scenes: Sequence[str], ids: Sequence[str], limit: int, seed: int, stage: str) -> list[int]:
    """Draw rows, ascending: the first of every scene in random order, then the second, and so on, up to the limit."""
    order = {scene: rng.rank(seed, stage, scene) for scene in set(scenes)}
    turns: Counter[str] = Counter()
    keys = []
    for _, i in sorted((rng.rank(seed, stage, name), i) for i, name in enumerate(ids)):
        keys.append((turns[scenes[i]], order[scenes[i]], i))
        turns[scenes[i]] += 1
    return sorted(i for _, _, i in sorted(keys)[:limit])


def goals_withheld(root: DataRoot, scene: str, subset: str) -> bool:
    """Whether a release has the tasks of a scene and not their routes, as who runs a contest may publish it."""
    return bool(store.shards(root, f"tasks/{subset}", scene)) and not store.shards(root, f"routes/{subset}", scene)


def read_tasks(data: Where, rows: pa.Table, *, withheld: bool = False) -> list[Task]:
    """Join rows of `select` with their goals; `withheld` gives goals of NaN where the release has no routes."""
    root = open_root(data)
    tasks = []
    for row in rows.to_pylist():
        if withheld and goals_withheld(root, row["scene"], row["subset"]):
            tasks.append(Task(row, (math.nan,) * 3, math.nan, math.nan, NO_TARGET))
            continue
        fact = _facts(root, row["scene"], row["subset"]).get(row["nav_id"])
        if fact is None:
            raise StoreError(
                f"task {row['task_id']} has no route in {root}/release: run {command('split', scene=row['scene'])}"
            )
        *goal, euclidean_m, length_m, target_id = fact
        tasks.append(Task(row, (goal[0], goal[1], goal[2]), euclidean_m, length_m, int(target_id)))
    return tasks


@cache
def _facts(root: DataRoot, scene: str, subset: str) -> dict[str, tuple[float, ...]]:
    columns = store.read_scene(root, f"routes/{subset}", scene, _FACTS).to_pydict()
    return dict(zip(columns["nav_id"], zip(*(columns[name] for name in _FACTS[1:]), strict=True), strict=True))


def reference_actions(
    root: DataRoot, scene: str, subsets: Sequence[str], column: str = "action"
) -> dict[str, list[int]]:
    """Read a list of actions of `routes`, by navigation task: for the oracle alone; an older release may lack it."""
    found: dict[str, list[int]] = {}
    for subset in subsets:
        routes = store.read_stored(root, f"routes/{subset}", scene, ("nav_id", column))
        if column not in routes.column_names:
            raise StoreError(
                f"the routes of {scene} in {root}/release have no {column}: they were made by an older version"
            )
        found |= zip(routes["nav_id"].to_pylist(), (row or [] for row in routes[column].to_pylist()), strict=True)
    return found


def check_hints(hints: Sequence[str]) -> tuple[str, ...]:
    """Return the names of hints in their fixed order; UsageError for an unknown one."""
    check_known("no hint", hints, HINTS)
    return tuple(name for name in HINTS if name in hints)


def goal_of(root: DataRoot, task: Task, rules: Rules, hints: Sequence[str] = ()) -> Goal:
    """Make an agent's goal; `hints` names the hints."""
    row = task.row
    image_id = row["reference_image_id"]
    image = None if image_id is None else reference_image(root, row["scene"], image_id)
    words = (row["modality"], row["target_name"], row["landmark"], row["direction"], row["description"])
    distance_m = None if image is None else row["image_distance_m"]
    heading = Heading(*compass_heading(row["start_yaw_rad"])) if "heading" in hints else None
    return Goal(*words, image, rules, heading, distance_m)


def image_shape(root: DataRoot, rows: pa.Table) -> tuple[int, ...] | None:
    """Return the shape of the goals' pictures of tasks; None where no goal is a picture."""
    at = pc.index(pc.is_valid(rows["reference_image_id"]), True).as_py()
    if at < 0:
        return None
    row = rows.slice(at, 1).to_pylist()[0]
    return reference_image(root, row["scene"], row["reference_image_id"]).shape


@lru_cache(maxsize=256)
def reference_image(root: DataRoot, scene: str, image_id: str) -> NDArray[np.uint8]:
    """Read a goal's picture: (H, W, 3) uint8, sRGB, read-only."""
    picture = decode_rgb(_pictures(root, scene).get(image_id))
    if picture is None:
        raise StoreError(
            f"reference image {image_id} of {scene} is not in {root}/release/objects: "
            f"run {command('split', scene=scene)}"
        )
    picture.setflags(write=False)
    return picture


@lru_cache(maxsize=4)
def _pictures(root: DataRoot, scene: str) -> dict[str, bytes]:
    rows = store.read_scene(root, "release/objects", scene, ("reference_image_id", "reference_image")).to_pylist()
    return {row["reference_image_id"]: row["reference_image"] for row in rows if row["reference_image"]}


@lru_cache(maxsize=64)
def mesh_of(root: DataRoot, scene: str) -> tuple[Path, str]:
    """Find a scene's mesh: its path and SHA-256; AssetError where the release names one outside of the data root."""
    row = store.read_scene(root, "release/scenes", scene, ("mesh_path", "mesh_sha256")).to_pylist()[0]
    try:
        return mesh_copy(root, row["mesh_path"]), row["mesh_sha256"]
    except FileNotFoundError:
        path = root.at(row["mesh_path"])
        raise StoreError(f"the mesh {path} is missing: run {command('build-scenes', scene=scene)}") from None


# The descriptions that a task may have: its own, or one of its target's drawn for an episode.
_PARAPHRASES = ("task", "random")


def check_paraphrase(choice: str) -> str:
    """Return the choice; UsageError for an unknown one."""
    check_known("no choice of paraphrase", [choice], _PARAPHRASES)
    return choice


@lru_cache(maxsize=100)
def texts_of_tasks(root: DataRoot, scene: str, subset: str) -> dict[str, tuple[str, ...]]:
    """Read the texts that tasks of a subset may have, by navigation task: of test tasks those that are held out."""
    objects = store.read_stored(root, "release/objects", scene, ("object_id", "paraphrases"))
    if "paraphrases" not in objects.column_names:
        raise StoreError(f"the objects of {scene} in {root}/release have no paraphrases: an older version made them")
    texts = {
        row["object_id"]: tuple(text["text"] for text in of_side(row["paraphrases"], held_out=subset == "test"))
        for row in objects.to_pylist()
    }
    routes = store.read_scene(root, f"routes/{subset}", scene, ("nav_id", "target_object_id"))
    return {row["nav_id"]: texts[row["target_object_id"]] for row in routes.to_pylist()}


class TaskSampler:
    """Samples tasks with replacement, in blocks of one scene: the first from all tasks, the others from its scene."""

    def __init__(self, scenes: Sequence[str], run_length: int = 1) -> None:
        self._scenes = scenes
        self._in_a_row = run_length
        self._by_scene: dict[str, NDArray[np.int64]] = {
            scene: np.array([i for i, own in enumerate(scenes) if own == scene]) for scene in sorted(set(scenes))
        }
        self._all: NDArray[np.int64] = np.arange(len(scenes))
        self.restart()

    def restart(self) -> None:
        """Drop the task drawn ahead: what follows depends on the generator alone."""
        self._scene, self._left = "", 0
        self._ahead: int | None = None

    def restrict(self, scenes: Sequence[str]) -> None:
        """Draw only from some scenes; UsageError if they have no task."""
        own = [self._by_scene[scene] for scene in sorted(set(scenes)) if scene in self._by_scene]
        if not own:
            raise UsageError(f"no task of the selection is in {', '.join(scenes)}")
        self._all = np.sort(np.concatenate(own))
        self.restart()

    @property
    def coming(self) -> str | None:
        """The scene of the next block; None before the first draw."""
        return None if self._ahead is None else self._scenes[self._ahead]

    def next(self, draw: np.random.Generator) -> int:
        """Draw the next task: its number."""
        if self._left:
            self._left -= 1
            own = self._by_scene[self._scene]
            return int(own[draw.integers(len(own))])
        at = self._any(draw) if self._ahead is None else self._ahead
        self._scene, self._left = self._scenes[at], self._in_a_row - 1
        # Always drawn, so that prefetching changes no draw.
        self._ahead = self._any(draw)
        return at

    def _any(self, draw: np.random.Generator) -> int:
        return int(self._all[draw.integers(len(self._all))])
