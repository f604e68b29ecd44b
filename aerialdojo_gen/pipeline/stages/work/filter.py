"""`filter`: keep candidates, or reject them with a reason."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.config.sections import FilterConfig
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.pipeline.stages.work.rules import KEPT, judge, settings_of
from aerialdojo_gen.rendering.casters import all_in_sight
from aerialdojo_gen.store.schemas import APPROACH, SETTINGS, VERDICTS


def _stops(plans: pa.Table) -> NDArray[np.float64]:
    """End positions of routes without the Approach, which agents do not have, (n, 3) float64."""
    starts = np.cumsum([0, *pc.list_value_length(plans["action"]).to_pylist()])
    actions = pc.list_flatten(plans["action"]).to_numpy()
    last = starts[1:] - 1
    last -= (np.diff(starts) > 1) & (actions[np.maximum(last - 1, 0)] == APPROACH)
    return np.column_stack([pc.list_flatten(plans[f"{axis}_m"]).to_numpy()[last] for axis in "xyz"])


def _hidden_at_stop(job: Job, plans: pa.Table, targets: pa.Table) -> NDArray[np.bool_]:
    """Which routes, without their Approach, end where nothing of the target is in sight."""
    if not plans.num_rows:
        return np.zeros(0, dtype=np.bool_)
    objects = job.read("objects").select(["object_id", "mesh_node"])
    index = pc.index_in(targets["target_object_id"], value_set=objects["object_id"].combine_chunks())
    nodes = objects["mesh_node"].take(index).to_pylist()
    return ~all_in_sight(job.scene_model(), nodes, _stops(plans))


def run(job: Job, config: FilterConfig) -> Output:
    """Judge a scene's candidates by `judge`, then by what the agent sees at the end (``"target_hidden"``)."""
    pairs = job.read("pairs")
    flown = ["x_m", "y_m", "z_m", "action"]
    plans = (
        job.read("plans")
        .select(["pair_id", "outcome", "length_m", "n_actions", "plan_detour", *flown])
        .sort_by("pair_id")
    )
    if not plans.column("pair_id").combine_chunks().equals(pairs.column("pair_id").combine_chunks()):
        raise StoreError(
            f"plans of {job.scene} are not those of its pairs: run {command('plan', scene=job.scene, force=True)}"
        )
    outcome = np.asarray(plans.column("outcome").to_pylist(), dtype="U24")
    euclidean = pairs.column("euclidean_m").to_numpy()
    length = plans.column("length_m").to_numpy()
    n_actions = plans.column("n_actions").to_numpy()
    detour, visible = (
        table.column(name).to_numpy(zero_copy_only=False).astype(np.float64)
        for table, name in ((plans, "plan_detour"), (pairs, "target_visible_at_start"))
    )
    reason, setting = judge(outcome, euclidean, length, n_actions, config, detour, visible)
    fit = np.flatnonzero(reason == KEPT)
    reason[fit[_hidden_at_stop(job, plans.take(fit), pairs.take(fit))]] = "target_hidden"
    budgets = {name: rule.action_budget for name, rule in zip(SETTINGS, settings_of(config), strict=True)}
    n = len(outcome)
    table = pa.table(
        {
            "scene": pa.repeat(job.scene, n),
            "pair_id": pairs.column("pair_id"),
            "keep": reason == KEPT,
            "reason": pa.array(reason.tolist(), pa.string()),
            "setting": pa.array([s or None for s in setting.tolist()], pa.string()),
            "action_budget": pa.array([budgets.get(s) for s in setting.tolist()], pa.int32()),
        },
        schema=VERDICTS.schema,
    )
    counts = Counter(reason.tolist())
    kept = counts.pop(KEPT, 0)
    counts.update(Counter(f"{s} kept" for s, r in zip(setting.tolist(), reason.tolist(), strict=True) if r == KEPT))
    return Output({"verdicts": table}, rows_in=n, rows_out=kept, counts=dict(counts))
