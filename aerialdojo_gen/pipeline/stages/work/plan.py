"""`plan`: a certified reference trajectory for every candidate, or the reason why there is none (paper: routes)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.geometry.frames import wrap_turned_rad
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.pipeline.stages.work.candidate_policy import CandidatePolicy, Candidates, policy_of
from aerialdojo_gen.planning.difficulty import Difficulty, agent_actions, difficulty_of, free_lengths_m
from aerialdojo_gen.planning.planner import Planner, Route
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.schemas import OUTCOMES, PLANS

Floats = NDArray[np.float64]
# Megabytes of goals' cost-to-go fields kept between estimation and search, plain and compressed to a tenth; what
# does not fit is expanded again. Plain ones save a fiftieth of the mall's time and cost 0.2 GB.
_FIELDS_MB = 0.0, 250.0
# What the planner is made of, and what `filter` casts rays with.
_NEEDED_PARTS = (
    "collision world", "clearance space", "clearance grid", "planner",
    "triangle caster", "ray caster", "points to see",
)  # fmt: skip


def targets_of_part(object_ids: list[int], part: int, config: PlanConfig) -> list[int]:
    """Return the targets of one shard: a slice of the scene's objects by id."""
    first = part * config.targets_per_part
    return sorted(object_ids)[first : first + config.targets_per_part]


def run(job: Job, config: PlanConfig) -> Output:
    """Plan the candidates of a slice of the scene's targets, or those that the policy selects of the whole scene."""
    policy = policy_of(job.scene, config.quota, job.seed)
    targets = job.read("objects")["object_id"].to_pylist()
    if not policy.compares:
        targets = targets_of_part(targets, job.part, config)
    pairs = job.read("pairs")
    pairs = pairs.filter(pc.is_in(pairs["target_object_id"], pa.array(targets, pa.int32()))).sort_by("pair_id")
    routes: list[Route] = []
    planner = None
    if pairs.num_rows:
        planner = _planner(job.scene_model(), config, job.embodiment.radius_m)
        routes = _search(planner, pairs, *_ends(job, pairs), policy)
    counts = Counter(route.outcome for route in routes)
    return Output(
        {"plans": _table(job.scene, pairs["pair_id"].to_pylist(), routes, planner)},
        rows_in=pairs.num_rows,
        rows_out=len(routes),
        counts={outcome: counts[outcome] for outcome in OUTCOMES if counts[outcome]},
    )


def _by_goal(
    plan: Callable[[Floats, Floats], list[Route]], goals: Floats, starts: Floats, rows: NDArray[np.int64]
) -> list[Route]:
    """Plan rows of (n, 4) goals and starts, goal by goal; results in the order of `rows`."""
    found: list[Route | None] = [None] * len(rows)
    _, which = np.unique(goals[rows], axis=0, return_inverse=True)
    for goal in range(which.max(initial=-1) + 1):
        places = np.flatnonzero(which.ravel() == goal)
        for place, route in zip(places.tolist(), plan(goals[rows[places[0]]], starts[rows[places]]), strict=True):
            found[place] = route
    return [route for route in found if route is not None]


def _search(planner: Planner, pairs: pa.Table, goals: Floats, starts: Floats, policy: CandidatePolicy) -> list[Route]:
    """Search the candidates that the policy selects; the others get the outcome of the estimate, or NOT_NEEDED."""
    n = pairs.num_rows
    estimates: list[Route] = []
    found: list[Route | None] = [None] * n
    predicted = np.full(n, np.inf)
    with planner.keeping_fields(*_FIELDS_MB) if policy.compares else nullcontext():
        if policy.compares:
            estimates = _by_goal(planner.estimate_routes, goals, starts, np.arange(n))
            open_ = np.array([route.outcome == "NOT_NEEDED" for route in estimates])
            predicted = np.where(open_, [route.cost_to_go_m for route in estimates], np.inf)
        free = free_lengths_m(starts, goals[:, :3], planner.config.max_approach_m)
        rows = policy.initial_batch(Candidates.of(pairs, free, predicted))
        while len(rows):
            for row, route in zip(rows.tolist(), _by_goal(planner.plan_target, goals, starts, rows), strict=True):
                found[row] = route
            rows = policy.next_batch(found)
    return [route or estimates[row] for row, route in enumerate(found)]


def _planner(scene: Scene, config: PlanConfig, radius_m: float) -> Planner:
    context = context_of(scene)
    # What the stages before drew with is not needed any more.
    context.release(*_NEEDED_PARTS)
    return context.part("planner", lambda: Planner(scene, config, radius_m), config, radius_m)


def _ends(job: Job, pairs: pa.Table) -> tuple[Floats, Floats]:
    """Goals and start poses, (n, 4) float64 each; a start is its anchor turned by 180° (paper: start poses)."""
    columns = ["object_id", "anchor_id", "x_m", "y_m", "z_m", "yaw_rad", "selected"]
    anchors, pair = job.read("anchors").select(columns).to_pydict(), pairs.to_pydict()
    poses = np.column_stack([anchors[name] for name in columns[2:6]])
    rows = {key: k for k, key in enumerate(zip(anchors["object_id"], anchors["anchor_id"], strict=True))}
    selected = {anchors["object_id"][k]: k for k in np.flatnonzero(anchors["selected"])}
    try:
        goals = poses[[selected[target] for target in pair["target_object_id"]]]
        starts = poses[[rows[key] for key in zip(pair["start_object_id"], pair["start_anchor_id"], strict=True)]]
    except KeyError as error:
        raise StoreError(
            f"{job.scene}: a candidate needs anchor {error}, which is not in anchors: "
            f"run {command('pair-objects', scene=job.scene)}"
        ) from None
    starts[:, 3] = wrap_turned_rad(starts[:, 3] + math.pi)
    return goals, starts


def _difficulty_columns(planner: Planner | None, routes: list[Route]) -> dict[str, pa.Array]:
    """Difficulty columns of solved routes, null elsewhere."""
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
    return {name: pa.array(own, PLANS.schema.field(name).type).take(rows) for name, own in values.items()}


def _table(scene: str, pair_ids: list[str], routes: list[Route], planner: Planner | None) -> pa.Table:
    """Make a table of routes; lists are passed as arrays, since millions of Python objects are slow."""
    columns = {
        "scene": [scene] * len(routes),
        "pair_id": pair_ids,
        "outcome": [r.outcome for r in routes],
        "predicted_length_m": [r.cost_to_go_m if math.isfinite(r.cost_to_go_m) else None for r in routes],
        "length_m": [r.length_m for r in routes],
        "n_actions": [r.n_actions for r in routes],
        "expansions": [r.expansions for r in routes],
        "min_clearance_m": [r.min_clearance_m for r in routes],
        **_difficulty_columns(planner, routes),
        **{name: [r.poses[:, k] for r in routes] for k, name in enumerate(("x_m", "y_m", "z_m", "yaw_rad"))},
        "action": [r.actions for r in routes],
        "agent_action": [agent_actions(r.actions) if r.outcome == "SOLVED" else None for r in routes],
    }
    return pa.table({name: columns[name] for name in PLANS.schema.names}, schema=PLANS.schema)
