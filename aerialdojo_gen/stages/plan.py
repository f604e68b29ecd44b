"""`plan`: a certified reference trajectory for every candidate, or the reason why there is none (paper: routes)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen import store
from aerialdojo_gen.config import PlanConfig
from aerialdojo_gen.errors import StoreError
from aerialdojo_gen.planning.planner import Planner, Route
from aerialdojo_gen.planning.primitives import wrap_rad
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.schemas import OUTCOMES, PLANS
from aerialdojo_gen.stage import Job, Output

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
    rows: list[dict[str, Any]] = []
    if pairs.num_rows:
        planner = _planner(job.scene_model(), config, job.embodiment.radius_m)
        for target, candidates in _by_target(pairs):
            try:
                goal = poses[selected[target]]
                starts = np.array([_turned(poses[p["start_object_id"], p["start_anchor_id"]]) for p in candidates])
            except KeyError as error:
                raise StoreError(
                    f"{job.scene}: a candidate with target {target} needs anchor {error}, which is not in anchors: "
                    "run pair-objects again"
                ) from None
            routes = planner.plan_target(goal, starts)
            rows += [_row(job.scene, p["pair_id"], r) for p, r in zip(candidates, routes, strict=True)]
    rows.sort(key=lambda row: row["pair_id"])
    counts = Counter(row["outcome"] for row in rows)
    return Output(
        {"plans": store.from_rows(PLANS, rows)},
        rows_in=pairs.num_rows,
        rows_out=len(rows),
        counts={outcome: counts[outcome] for outcome in OUTCOMES if counts[outcome]},
    )


@lru_cache(maxsize=1)
def _planner(scene: Scene, config: PlanConfig, radius_m: float) -> Planner:
    return Planner(scene, config, radius_m)


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
    return np.array([*anchor[:3], wrap_rad(anchor[3] + math.pi)])


def _by_target(pairs: pa.Table) -> Iterator[tuple[int, list[dict[str, Any]]]]:
    groups: dict[int, list[dict[str, Any]]] = {}
    for pair in pairs.sort_by("pair_id").to_pylist():
        groups.setdefault(pair["target_object_id"], []).append(pair)
    yield from sorted(groups.items())


def _row(scene: str, pair_id: str, route: Route) -> dict[str, Any]:
    return {
        "scene": scene,
        "pair_id": pair_id,
        "outcome": route.outcome,
        "length_m": route.length_m,
        "n_actions": route.n_actions,
        "expansions": route.expansions,
        "min_clearance_m": route.min_clearance_m,
        "x_m": route.poses[:, 0].tolist(),
        "y_m": route.poses[:, 1].tolist(),
        "z_m": route.poses[:, 2].tolist(),
        "yaw_rad": route.poses[:, 3].tolist(),
        "action": route.actions.tolist(),
    }
