"""Which trajectories are learned from: the release's tables in memory, some MB for all routes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.base.rng import rank
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.tasks import Selection, check_paraphrase, select, texts_of_tasks
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.learning.words import goal_text
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import APPROACH, STOP

_SIDES = ("train", "test")
_GOAL = ("goal_x_m", "goal_y_m", "goal_z_m")
_START = ("start_x_m", "start_y_m", "start_z_m", "start_yaw_rad")
_GOAL_WORDS = ("target_name", "landmark", "direction")
_BY_MODALITY = ("description", "reference_image_id", "image_distance_m")


@dataclass(frozen=True, eq=False)
class Index:
    """The trajectories of a selection, sorted by scene and navigation task."""

    sources: list[tuple[DataRoot, str]]  # Of every trajectory, its data directory and its scene
    nav_id: list[str]
    routes: list[NDArray[np.int8]]  # Of every trajectory, its actions: 0 to 15, the last of each a Stop
    start: NDArray[np.float64]  # (n, 4) float64; start poses: x, y, z in metres and yaw in radians, world frame
    goal: NDArray[np.float64]  # (n, 3) float64; goal anchors, metres, world frame
    budget: NDArray[np.int32]  # (n,) int32; most actions, Stop included
    goal_columns: dict[str, list[Any]]  # What each goal says, by column of `tasks`

    def __len__(self) -> int:
        return len(self.nav_id)

    @cached_property
    def roots(self) -> dict[str, DataRoot]:
        """The scenes, sorted, and the data directory that each is in."""
        return dict(sorted((scene, root) for root, scene in set(self.sources)))

    @property
    def scenes(self) -> tuple[str, ...]:
        """The scenes, sorted."""
        return tuple(self.roots)

    @cached_property
    def scene(self) -> NDArray[np.int32]:
        """Of every trajectory, an index of `scenes`, (n,) int32."""
        number = {name: i for i, name in enumerate(self.roots)}
        return np.array([number[name] for _, name in self.sources], np.int32)

    @cached_property
    def actions(self) -> NDArray[np.int8]:
        """Actions of all trajectories one after the other, (m,) int8."""
        return np.concatenate([*self.routes, np.empty(0, np.int8)])

    @cached_property
    def first(self) -> NDArray[np.int64]:
        """Where each trajectory's actions begin, (n + 1,) int64."""
        return np.cumsum([0, *map(len, self.routes)], dtype=np.int64)

    @cached_property
    def steps(self) -> NDArray[np.int64]:
        """Actions of every trajectory, Stop included, (n,) int64."""
        return np.diff(self.first)

    def poses_of(self, k: int) -> NDArray[np.float64]:
        """Poses before every action of trajectory k, (steps, 4) float64, as the environment flies them."""
        return replay(self.start[k], self.routes[k][:-1])

    @property
    def goal_texts(self) -> list[str]:
        """Say each trajectory's goal in words."""
        words = (self.goal_columns[name] for name in (*_GOAL_WORDS, "description"))
        return [goal_text(*one) for one in zip(*words, strict=True)]

    @cached_property
    def digest(self) -> str:
        """SHA-256, hexadecimal, of all that a sample's labels come from."""
        sha256 = hashlib.sha256("\n".join(self.nav_id).encode())
        for array in (self.actions, self.first, self.start, self.goal, self.budget):
            sha256.update(np.ascontiguousarray(array).tobytes())
        for name, texts in sorted(self.goal_columns.items()):
            sha256.update(f"{name}\0{texts}".encode())
        return sha256.hexdigest()

    def take(self, rows: NDArray[np.int64]) -> Index:
        """Keep some trajectories, in their order."""

        def chosen(values: list[Any]) -> list[Any]:
            return [values[k] for k in rows]

        return Index(
            chosen(self.sources), chosen(self.nav_id), chosen(self.routes), self.start[rows], self.goal[rows],
            self.budget[rows], {name: chosen(texts) for name, texts in self.goal_columns.items()},
        )  # fmt: skip


def read_index(
    roots: DataRoot | Sequence[DataRoot], selection: Selection, target_split: str | None = None,
    runs: Sequence[str] = (), paraphrase: str = "task",
) -> Index:  # fmt: skip
    """Read the references of a selection, or the successful flights of runs; paraphrases are drawn by its seed.

    Several data directories have different scenes; of each come the tasks that fit, if any.
    """
    if target_split is not None:
        check_known("no side of the split by objects", [target_split], _SIDES)
    check_paraphrase(paraphrase)
    parts: list[Index] = []
    refused: list[UsageError] = []
    root_of: dict[str, DataRoot] = {}
    for root in [roots] if isinstance(roots, DataRoot) else roots:
        try:
            parts.append(_of_root(root, selection, target_split, runs, paraphrase))
        except UsageError as error:
            refused.append(error)
            continue
        for scene in parts[-1].scenes:
            if scene in root_of:
                raise UsageError(f"scene {scene} is in {root_of[scene]} and in {root}: name one of them")
            root_of[scene] = root
    if not parts:
        raise refused[0] if refused else UsageError("name at least one data directory")
    whole = _joined(parts)
    return whole.take(np.argsort(whole.scene, kind="stable"))


def _of_root(
    root: DataRoot, selection: Selection, target_split: str | None, runs: Sequence[str], paraphrase: str
) -> Index:
    chosen = select(root, selection)
    if paraphrase == "random":
        chosen = _paraphrased(root, chosen, selection.seed)
    flown = _flown(root, runs)
    if runs:
        chosen = chosen.filter(pc.is_in(chosen["nav_id"], pa.array(flown, pa.string())))
        if not chosen.num_rows:
            raise UsageError(f"no task of the selection has a successful flight in {', '.join(runs)}")
    index = _joined([
        _scene(root, scene, chosen.filter(pc.equal(chosen["scene"], scene)), target_split, flown)
        for scene in sorted(pc.unique(chosen["scene"]).to_pylist())
    ])  # fmt: skip
    if not len(index):
        raise UsageError(f"no task of the selection has the target split {target_split!r}")
    return index


def _paraphrased(root: DataRoot, rows: pa.Table, seed: int) -> pa.Table:
    texts: list[str | None] = []
    for row in rows.select(["scene", "subset", "nav_id", "description"]).to_pylist():
        paraphrases = texts_of_tasks(root, row["scene"], row["subset"])[row["nav_id"]]
        one = paraphrases[rank(seed, "paraphrase", row["nav_id"]) % len(paraphrases)]
        texts.append(None if row["description"] is None else one)
    return rows.set_column(rows.column_names.index("description"), "description", pa.array(texts, pa.string()))


def _flown(root: DataRoot, runs: Sequence[str]) -> dict[str, NDArray[np.int8]]:
    """Read the actions of the runs' successful flights, of each navigation task the shortest."""
    shortest: dict[str, NDArray[np.int8]] = {}
    for run in runs:
        rows = read_run(root, run, columns=["task_id", "nav_id", "success"])
        own = {row["task_id"]: row["nav_id"] for row in rows.to_pylist() if row["success"]}
        steps = read_run(root, run, "steps", ["task_id", "step", "action", "refused"])
        # What was refused, or named no action, moved nothing: the flight is the same without it.
        moved = pc.and_(pc.invert(steps["refused"]), pc.is_valid(steps["action"]))
        steps = steps.filter(pc.and_(moved, pc.is_in(steps["task_id"], pa.array(own, pa.string()))))
        steps = steps.sort_by([("task_id", "ascending"), ("step", "ascending")])
        flights = steps.group_by("task_id", use_threads=False).aggregate([("action", "list")])
        for task_id, actions in zip(*(flights[name].to_pylist() for name in ("task_id", "action_list")), strict=True):
            nav_id = own[task_id]
            if nav_id not in shortest or len(actions) < len(shortest[nav_id]):
                shortest[nav_id] = np.array(actions, np.int8)
    return shortest


def _scene(
    root: DataRoot, scene: str, rows: pa.Table, target_split: str | None, flown: dict[str, NDArray[np.int8]]
) -> Index:
    if target_split is not None:
        allowed = pa.array(_of_target_split(root, scene, target_split), pa.string())
        rows = rows.filter(pc.is_in(rows["nav_id"], allowed))
    tasks: dict[str, dict[str, Any]] = {}
    for row in rows.to_pylist():
        task = tasks.setdefault(row["nav_id"], row)
        for name in _BY_MODALITY:
            task[name] = row[name] if task[name] is None else task[name]
    routes: dict[str, tuple[NDArray[np.int8], list[float]]] = {}
    for side in sorted({str(row["subset"]) for row in tasks.values()}):
        routes |= _routes(root, scene, side, tasks)
    ids = sorted(tasks)
    for nav_id in ids:
        if nav_id not in routes:
            raise StoreError(f"task {nav_id} has no route in {root}/release: run {command('split', scene=scene)}")
    return Index(
        [(root, scene)] * len(ids),
        ids,
        [flown.get(nav_id, routes[nav_id][0]) for nav_id in ids],
        np.array([[tasks[i][c] for c in _START] for i in ids], np.float64).reshape(-1, 4),
        np.array([routes[i][1] for i in ids], np.float64).reshape(-1, 3),
        np.array([tasks[i]["action_budget"] for i in ids], np.int32),
        {name: [tasks[i][name] for i in ids] for name in (*_GOAL_WORDS, *_BY_MODALITY)},
    )


def _routes(
    root: DataRoot, scene: str, side: str, tasks: dict[str, dict[str, Any]]
) -> dict[str, tuple[NDArray[np.int8], list[float]]]:
    columns = ("nav_id", "action", "agent_action", *_GOAL)
    table = store.read_stored(root, f"routes/{side}", scene, columns)
    table = table.filter(pc.is_in(table["nav_id"], pa.array(list(tasks), pa.string())))
    own = table["agent_action"].to_pylist() if "agent_action" in table.column_names else [None] * table.num_rows
    routes = {}
    for k, nav_id in enumerate(table["nav_id"].to_pylist()):
        # A release of an older version has the reference's actions alone: an agent has no Approach.
        row = own[k] if own[k] is not None else [a for a in table["action"][k].as_py() if a != APPROACH]
        actions = np.array(row, np.int8)
        if not len(actions) or actions[-1] != STOP or (actions[:-1] == STOP).any() or actions.max() >= APPROACH:
            raise StoreError(
                f"the actions of route {nav_id} do not end in their one Stop: run {command('validate', scene=scene)}"
            )
        routes[nav_id] = (actions, [table[name][k].as_py() for name in _GOAL])
    return routes


def _of_target_split(root: DataRoot, scene: str, side: str) -> list[str]:
    nav_ids: list[str] = []
    for subset in _SIDES:
        table = store.read_stored(root, f"tasks/{subset}", scene, ("nav_id", "target_split"))
        if "target_split" not in table.column_names or table["target_split"].null_count:
            raise UsageError(
                f"the release in {root} has no split by objects for {scene}: it was made by an older version"
            )
        nav_ids += table.filter(pc.equal(table["target_split"], side))["nav_id"].to_pylist()
    return nav_ids


def _joined(parts: Sequence[Index]) -> Index:
    return Index(
        [source for p in parts for source in p.sources],
        [nav_id for p in parts for nav_id in p.nav_id],
        [route for p in parts for route in p.routes],
        np.concatenate([p.start for p in parts]),
        np.concatenate([p.goal for p in parts]),
        np.concatenate([p.budget for p in parts]),
        {name: [text for p in parts for text in p.goal_columns[name]] for name in parts[0].goal_columns},
    )
