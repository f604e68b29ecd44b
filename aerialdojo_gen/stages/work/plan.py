"""`plan`: a certified reference trajectory for every candidate, or the reason why there is none (paper: routes)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.common.advice import command
from aerialdojo_gen.config.sections import PlanConfig
from aerialdojo_gen.errors import StoreError
from aerialdojo_gen.geometry.angles import wrap_one_rad
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.planning.difficulty import Difficulty, agent_actions, difficulty_of
from aerialdojo_gen.planning.planner import Planner, Route
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.schemas import OUTCOMES, PLANS

Floats = NDArray[np.float64]


def targets_of_part(object_ids: list[int], part: int, config: PlanConfig) -> list[int]:
    """Return the targets of one shard: a slice of the scene's objects in the order of their ids."""
    first = part * config.targets_per_part
    return sorted(object_ids)[first : first + config.targets_per_part]


def run(job: Job, config: PlanConfig) -> Output:
    """Plan all candidates of a slice of the scene's targets.

    Parameters
    ----------
    job : Job
        The scene and the slice; reads `objects`, `anchors`, `pairs` and the scene's mesh.
    config : PlanConfig
        The stage's section.

    Returns
    -------
    Output
        `plans`, a row a candidate whatever became of it, sorted by pair_id; counts by outcome.

    Raises
    ------
    StoreError
        A pair names an anchor that does not exist: the two tables do not belong together.
    """
    targets = targets_of_part(job.read("objects")["object_id"].to_pylist(), job.part, config)
    pairs = job.read("pairs")
    pairs = pairs.filter(pc.is_in(pairs["target_object_id"], pa.array(targets, pa.int32())))
    poses, selected = _anchor_poses(job)
    planned: list[tuple[str, Route]] = []
    planner = None
    if pairs.num_rows:
        planner = _planner(job.scene_model(), config, job.embodiment.radius_m)
        for target, candidates in _by_target(pairs):
            try:
                goal = poses[selected[target]]
                starts = np.array([_turned(poses[p["start_object_id"], p["start_anchor_id"]]) for p in candidates])
            except KeyError as error:
                raise StoreError(
                    f"{job.scene}: a candidate with target {target} needs anchor {error}, which is not in anchors: "
                    f"run {command('pair-objects', scene=job.scene)}"
                ) from None
            routes = planner.plan_target(goal, starts)
            planned += [(p["pair_id"], r) for p, r in zip(candidates, routes, strict=True)]
    planned.sort(key=lambda row: row[0])
    counts = Counter(route.outcome for _, route in planned)
    return Output(
        {"plans": _table(job.scene, planned, planner)},
        rows_in=pairs.num_rows,
        rows_out=len(planned),
        counts={outcome: counts[outcome] for outcome in OUTCOMES if counts[outcome]},
    )


def _planner(scene: Scene, config: PlanConfig, radius_m: float) -> Planner:
    return context_of(scene).part("planner", lambda: Planner(scene, config, radius_m), config, radius_m)


def _anchor_poses(job: Job) -> tuple[dict[tuple[int, int], Floats], dict[int, tuple[int, int]]]:
    """Poses of all anchors by (object, anchor), and every object's selected anchor."""
    poses: dict[tuple[int, int], Floats] = {}
    selected: dict[int, tuple[int, int]] = {}
    for a in job.read("anchors").to_pylist():
        key = (a["object_id"], a["anchor_id"])
        poses[key] = np.array([a["x_m"], a["y_m"], a["z_m"], a["yaw_rad"]])
        if a["selected"]:
            selected[a["object_id"]] = key
    return poses, selected


def _turned(anchor: Floats) -> Floats:
    """Start pose: the start object's anchor, its yaw turned by 180° (paper: start poses)."""
    return np.array([*anchor[:3], wrap_one_rad(float(anchor[3]) + math.pi)])


def _by_target(pairs: pa.Table) -> Iterator[tuple[int, list[dict[str, Any]]]]:
    groups: dict[int, list[dict[str, Any]]] = {}
    for pair in pairs.sort_by("pair_id").to_pylist():
        groups.setdefault(pair["target_object_id"], []).append(pair)
    yield from sorted(groups.items())


def _told(planner: Planner | None, routes: list[Route], schema: pa.Schema) -> dict[str, pa.Array]:
    """What the table says of the routes there are, null elsewhere: their difficulty, and an agent's actions."""
    solved = [i for i, route in enumerate(routes) if route.outcome == "SOLVED"]
    values: dict[str, Any] = {name: np.empty(0) for name in Difficulty._fields}
    if planner is not None and solved:
        c = planner.config
        lengths = np.array([routes[i].length_m for i in solved])
        poses = [routes[i].poses for i in solved]
        values = difficulty_of(
            poses, lengths, c.max_approach_m, planner.radius_m, planner.grid, planner.world
        )._asdict()
    place = np.full(len(routes), -1)
    place[solved] = np.arange(len(solved))
    rows = pa.array(place, pa.int32(), mask=place < 0)
    told = {name: pa.array(v, schema.field(name).type).take(rows) for name, v in values.items()}
    flown = [agent_actions(routes[i].actions) for i in solved]
    ends = np.cumsum([0, *map(len, flown)], dtype=np.int32)
    kind = schema.field("agent_action").type
    flat = pa.array(np.concatenate([np.empty(0, np.int8), *flown]), kind.value_type)
    told["agent_action"] = pa.ListArray.from_arrays(pa.array(ends), flat, type=kind).take(rows)
    return told


def _table(scene: str, planned: list[tuple[str, Route]], planner: Planner | None) -> pa.Table:
    """Put routes into a table; the lists go over as flat arrays, for millions of poses as objects take too long."""
    routes = [route for _, route in planned]
    ends = np.cumsum([0, *(len(r.poses) for r in routes)], dtype=np.int32)
    poses = np.concatenate([np.empty((0, 4)), *(r.poses for r in routes)])
    actions = np.concatenate([np.empty(0, np.int8), *(r.actions for r in routes)])
    flat = {**dict(zip(("x_m", "y_m", "z_m", "yaw_rad"), poses.T, strict=True)), "action": actions}
    columns = {
        "scene": [scene] * len(planned),
        "pair_id": [pair_id for pair_id, _ in planned],
        "outcome": [r.outcome for r in routes],
        "length_m": [r.length_m for r in routes],
        "n_actions": [r.n_actions for r in routes],
        "expansions": [r.expansions for r in routes],
        "min_clearance_m": [r.min_clearance_m for r in routes],
        **_told(planner, routes, PLANS.schema),
    }
    arrays = []
    for field in PLANS.schema:
        if field.name in flat:
            values = pa.array(np.ascontiguousarray(flat[field.name]), field.type.value_type)
            arrays.append(pa.ListArray.from_arrays(pa.array(ends), values, type=field.type))
        else:
            arrays.append(pa.array(columns[field.name], field.type))
    return pa.Table.from_arrays(arrays, schema=PLANS.schema)
