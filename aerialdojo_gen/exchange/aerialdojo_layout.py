"""The layout in which AerialDojo's authors publish their tasks: its folders, its words, and its reader.

NED metres, quaternions xyzw, a task file a partition, a file a trajectory.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.exchange import records
from aerialdojo_gen.exchange.folder import inside
from aerialdojo_gen.exchange.frames import WORDS, actions_of
from aerialdojo_gen.exchange.records import BadField, Fields, shown
from aerialdojo_gen.exchange.task import Context, Instance, Route, Task, digest, picture_at
from aerialdojo_gen.pipeline.stages.work.build_scenes import parse_name

SEMANTIC, IMAGE, TRAJECTORIES = "SemanticOGS", "ImageOGS", "TrajectoryDATA"
KINDS = {SEMANTIC: "semantic", IMAGE: "image"}
TASK_FILE = "Task.json"
SCHEMA_VERSION = "hybrid_astar_trajectory_v6"

# Setting: the folder, the letter in the partition's name, the word in the task.
SETTING_WORDS = {
    "base": ("1_BaseTasks", "B", "base_task"),
    "standard": ("2_StandardTasks", "S", "standard_task"),
    "long_horizon": ("3_LongHorizonTasks", "L", "long_task"),
}
SETTING_OF = {words[2]: setting for setting, words in SETTING_WORDS.items()}

# What a task says of its route, and our columns.
INFO = {"geodesic_distance": "length_m", "euclidean_distance": "euclidean_m", "complexity": "detour_ratio"}

# The loader says IID, some documents ID.
_SPLIT = re.compile(r"(I?ID|OOD)_(TRAIN|TEST)S")
_FOLDER = re.compile(r"(.+)_([BSL])_(Train|Test)")


@dataclass(frozen=True)
class Partition:
    """One folder of tasks: a split, a setting and a scene."""

    scene: str  # As in our tables
    setting: str
    partition: str  # ID or OOD; train or test
    subset: str
    split: str = ""  # The name of the split's folder, where it is not the usual one

    @property
    def path(self) -> Path:
        """Its folder below SemanticOGS, ImageOGS and TrajectoryDATA."""
        folder, letter, _ = SETTING_WORDS[self.setting]
        split = self.split or f"{'OOD' if self.partition == 'OOD' else 'IID'}_{self.subset.upper()}S"
        return Path(split) / folder / f"{self.scene}_{letter}_{self.subset.capitalize()}"


def parse_partition(folder: Path) -> Partition | None:
    """Read a partition off the last three parts of its path; None where they are none."""
    if len(folder.parts) < 3:
        return None
    split, category, name = folder.parts[-3:]
    is_split, is_name = _SPLIT.fullmatch(split), _FOLDER.fullmatch(name)
    if not is_split or not is_name or is_name[3].upper() != is_split[2]:
        return None
    settings = [setting for setting, words in SETTING_WORDS.items() if words[:2] == (category, is_name[2])]
    part = "OOD" if is_split[1] == "OOD" else "ID"
    return Partition(is_name[1], settings[0], part, is_name[3].lower(), split) if settings else None


_PAIR = re.compile(r"(\d{1,9})_(\d{1,9})__(\d{1,9})")
_NUMBERS = ("start_object_id", "start_anchor_id", "target_object_id")
_TEXTS = ("category", "description", "Landmark", "Direction")
_STEP = ("position_ned_m", "quaternion_xyzw")
_STATED = INFO | {"geodesic_distance": "stated_length_m"}
_START_FAR_M = 0.01
_EXACT = 1e-6


def task_files(path: Path) -> list[Path]:
    """List the task files of a folder of this layout, or the one that is named."""
    if not path.is_dir():
        return [path]
    root = path.resolve()
    files = [p for p in path.rglob(TASK_FILE) if p.resolve().is_relative_to(root)]
    if not files:
        raise UsageError(f"{path} has no {TASK_FILE} below it: name the folder that holds {' and '.join(KINDS)}")
    # A partition's two files come one after the other, so that its trajectories are read once.
    return sorted(files, key=lambda p: (p.parent.parts[-3:], p.parts))


def label(path: Path) -> str | None:
    """Name a task file by its place in the layout, whatever part of it is imported; None where it has none."""
    partition = parse_partition(path.parent)
    if partition is None or path.parents[3].name not in KINDS:
        return None
    return (Path(path.parents[3].name) / partition.path / path.name).as_posix()


class Reader:
    """Reads tasks of one import, and each trajectory once for both of its instances."""

    def __init__(self) -> None:
        self._partition: tuple[str, ...] = ()
        self._tasks: dict[str, Task] = {}
        self._read_ids: set[tuple[str, str]] = set()
        self._nav_ids: set[str] = set()

    def read(self, record: Fields, context: Context) -> Task:
        """Read a task and, where there is one, its trajectory."""
        folder = context.file.absolute().parent
        partition = parse_partition(folder)
        kind = KINDS.get(folder.parents[2].name) if partition else None
        episode = record.name("episode_id")
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,100}", episode):
            raise BadField("episode_id", f"{shown(episode)} cannot name a file")
        if (context.label, episode) in self._read_ids:
            raise BadField("episode_id", f"{episode} appears twice in the file")
        scene = record.text("map_name", empty=False)
        try:
            family, scene_type, by_name = parse_name(scene)
        except StoreError as error:
            raise BadField("map_name", str(error)) from None
        word = record.text("task")
        if word not in SETTING_OF:
            raise BadField("task", f"{shown(word)} is none of {', '.join(SETTING_OF)}")
        trains = record.flag("used-in-train")
        if partition is not None:
            _agree(partition, scene, word, trains)
        pose, goal = record.child("start_pose"), None
        start = context.upright_pose(pose.position("start_position"), _attitude(pose))
        if record.has("goal_pose"):
            goal = context.frame.positions_to_world(record.child("goal_pose").position("goal_position"))
        # Where readable names stand beside them, the others are the actors'.
        actor = record.text("goal_object_name", empty=False)
        target, start_actor = record.optional_text("goal_true_name"), record.optional_text("start_object_name")
        known: dict[str, Any] = {
            "target_name": target or actor,
            "mesh_node": actor if target else None,
            "start_object_name": record.optional_text("start_true_name") or start_actor,
            "start_mesh_node": start_actor if record.has("start_true_name") else None,
            **{name.lower(): record.optional_text(name) for name in _TEXTS},
            "family": family,
            "scene_type": scene_type,
            "partition": partition.partition if partition else by_name,
            "subset": "train" if trains else "test",
            "setting": SETTING_OF[word],
        }
        record.optional_text("coordinate_system")
        if record.has("info"):
            # What a task states of its own route; a trajectory's poses overrule it.
            info = record.child("info")
            known |= {ours: info.number(theirs) for theirs, ours in _STATED.items() if info.has(theirs)}
        image = record.optional_text("image")
        modality = kind or ("image" if image else "semantic")
        instance = Instance("semantic", known["description"])
        if modality == "image":
            # What the picture shows is the object's to say, not the image task's: it would give the goal away.
            instance = Instance("image")
            if context.pictures is not None:
                if image is None:
                    raise BadField("image", "is missing")
                instance = Instance("image", picture=picture_at(context.file.parent, image, "image"))
        task = Task(episode, scene, start=start, goal=goal, instances=[instance], object_key=actor, known=known)
        self._join(task, context, folder, partition, record.optional_text("trajectory_id"))
        self._read_ids.add((context.label, episode))
        return task

    def _join(self, task: Task, context: Context, folder: Path, partition: Partition | None, own: str | None) -> None:
        """Give the task its trajectory, or what its other instance brought already; `own` is its trajectory's id."""
        place = folder.parts[-3:] if partition else (context.label,)
        if place != self._partition:
            self._partition, self._tasks = place, {}
            self._read_ids = {pair for pair in self._read_ids if pair[0] == context.label}
        if (other := self._tasks.get(task.source_id)) is not None:
            if float(np.linalg.norm(task.start[:3] - other.start[:3])) > _START_FAR_M:
                raise BadField("start_pose.start_position", "is not that of the episode's other instance")
            if task.object_key != other.object_key:
                raise BadField("goal_object_name", "is not that of the episode's other instance")
            task.nav_id, task.has_route_row = other.nav_id, False
            task.goal = other.goal if task.goal is None else task.goal
            task.known |= {name: other.known[name] for name in _NUMBERS if name in other.known}
            return
        pair = None
        if partition is not None:
            root = folder.parents[3] / TRAJECTORIES
            if (root / partition.path).is_dir():
                pair = _read_trajectory(root, partition, task, context)
            else:
                context.notes[f"no folder in {TRAJECTORIES} for its partition: no route"] += 1
        # Ours bring their name; of others the objects make it, so that any part of a dataset gives the same names.
        name = f"{task.scene}-{digest(task.scene, pair)}" if pair else ""
        if own and re.fullmatch(rf"{re.escape(task.scene)}-[A-Za-z0-9]{{1,64}}", own):
            name = own
        if name in self._nav_ids:
            context.notes["task_id appears twice in the scene: named by partition and episode"] += 1
        if not name or name in self._nav_ids:
            name = f"{task.scene}-{digest(*(partition.path.parts if partition else [context.label]), task.source_id)}"
        self._nav_ids.add(name)
        task.nav_id = name
        self._tasks[task.source_id] = replace(task, route=None)


def _read_trajectory(root: Path, partition: Partition, task: Task, context: Context) -> str | None:
    """Give a task its trajectory; returns the pair of objects where the file names one."""
    relative = partition.path / f"{task.source_id}.json"
    label = f"{TRAJECTORIES}/{relative.as_posix()}"
    try:
        document = Fields(records.small_document(inside(root, relative.as_posix())), label)
    except (OSError, ValueError) as error:
        raise BadField("episode_id", f"{label}: {getattr(error, 'strerror', None) or error}") from None
    version = document.text("schema_version")
    if version != SCHEMA_VERSION:
        raise BadField(document.path("schema_version"), f"{shown(version)}, expected {SCHEMA_VERSION!r}")
    if document.text("map_name") != task.scene:
        raise BadField(document.path("map_name"), f"is not the task's, {task.scene}")
    if document.has("status") and document.text("status") != "planned":
        raise BadField(document.path("status"), f"{shown(document.text('status'))}, expected 'planned'")
    name = document.child("goal").text("Object_name")
    if name != task.object_key:
        raise BadField(document.path("goal.Object_name"), f"{shown(name)} is not the task's goal_object_name")
    pair = document.text("task_id")
    task.route = _route(document, context)
    poses = task.route.poses
    if float(np.linalg.norm(poses[0, :3] - task.start[:3])) > _START_FAR_M:
        context.notes["start_pose is not where its trajectory starts: each is kept as it is"] += 1
    if task.goal is None:
        task.goal = poses[-1, :3]
    if (match := _PAIR.fullmatch(pair)) is None:
        context.notes["task_id names no pair of objects: their numbers are null"] += 1
        return None
    task.known |= dict(zip(_NUMBERS, map(int, match.groups()), strict=True))
    return pair


def _attitude(pose: Fields) -> NDArray[np.float64]:
    """Return the start's quaternion, xyzw: the recorder's data and the evaluator have a name of their own for it."""
    names = [name for name in ("start_quaternion_xyzw", "start_quaternionr") if pose.has(name)]
    quaternions = [pose.quaternion(name) for name in names or ["start_quaternion_xyzw"]]
    if np.abs(quaternions[-1] - quaternions[0]).max() > _EXACT:
        raise BadField(pose.path(names[1]), f"is not {names[0]}")
    return quaternions[0]


def _agree(partition: Partition, scene: str, word: str, trains: bool) -> None:
    """Refuse a task that is not of the folder in which it stands, as the authors' loader does."""
    if scene != partition.scene:
        raise BadField("map_name", f"{shown(scene)} in a folder of {partition.scene}")
    if word != SETTING_WORDS[partition.setting][2]:
        raise BadField("task", f"{shown(word)} in {partition.path.as_posix()}")
    if trains != (partition.subset == "train"):
        raise BadField("used-in-train", f"{int(trains)} in {partition.path.as_posix()}")


def _route(document: Fields, context: Context) -> Route:
    steps = document.items("trajectory")
    words: list[str] = []
    more: set[str] = set()
    for k, step in enumerate(steps):
        where = document.path(f"trajectory[{k}]")
        if not isinstance(step, dict):
            raise BadField(where, f"expected an object, found {shown(step)}")
        word = step.get("action")
        allowed = ["start"] if k == 0 else [*WORDS, "stop"] if k == len(steps) - 1 else list(WORDS)
        if word not in allowed:
            raise BadField(f"{where}.action", f"unknown action {shown(word)}: known here are {', '.join(allowed)}")
        words.append(str(word))
        for name in _STEP:
            if name not in step:
                raise BadField(f"{where}.{name}", "is missing")
        more.update(step.keys() - {"action", *_STEP})
    context.notes.update(f"trajectory[].{records.plain(name)} has no place in the tables" for name in more)
    context.notes.update(
        f"trajectory file: {name.split('.')[-1]} has no place in the tables" for name in document.unread()
    )
    positions, quaternions = ([step[name] for step in steps] for name in _STEP)
    points = records.positions_of(positions, lambda k: document.path(f"trajectory[{k}].{_STEP[0]}"))
    attitudes = records.quaternions_of(quaternions, lambda k: document.path(f"trajectory[{k}].{_STEP[1]}"))
    yaws = context.frame.quaternion_to_world_yaw(attitudes)
    poses = np.column_stack([context.frame.positions_to_world(points), yaws])
    if words[-1] == "stop":
        # The published files leave it out, the recorder appends it: it leads nowhere.
        if np.abs(poses[-1] - poses[-2]).max() > _EXACT:
            raise BadField(document.path(f"trajectory[{len(steps) - 1}]"), "stop is not where the trajectory was")
        words, poses = words[:-1], poses[:-1]
    ours, error = actions_of(words[1:], poses)
    if ours is None:
        context.notes["has moves that are none of ours: action is null, source_action has them"] += 1
    return Route(poses, ours, words, error)
