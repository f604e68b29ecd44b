"""Two runs on the same tasks: the difference of their scores, and whether it may be chance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.text_table import Column, TextTable
from aerialdojo_gen.benchmark.metrics import (
    MEASURES,
    METRICS,
    RESAMPLES,
    Floats,
    Profile,
    bootstrap,
    knows_views,
    outcomes,
    summarize,
)
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import NONE, profile_head, text


def paired_tables(runs: Sequence[Run], profiles: Sequence[Profile]) -> list[TextTable]:
    """Compare the second run with the first, on the tasks that both have flown, a table a profile."""
    if len(runs) != 2:
        named = ", ".join(run.name for run in runs)
        raise UsageError(f"--paired compares two runs, not {len(runs)} ({named}): name two")
    first, second = runs
    tasks = [run.table["task_id"].combine_chunks() for run in runs]
    both = sorted({*tasks[0].to_pylist()} & {*tasks[1].to_pylist()})
    if not both:
        raise UsageError(f"{first.name} and {second.name} have no task in common: fly both on the same ones")
    task_ids = pa.array(both, pa.string())
    cut = [run.where(pc.index_in(task_ids, value_set=ids).to_numpy()) for run, ids in zip(runs, tasks, strict=True)]
    return [_table(cut[0], cut[1], profile) for profile in profiles]


def _table(first: Run, second: Run, profile: Profile) -> TextTable:
    """Compare two logs of the same tasks, row by row."""
    from scipy.stats import binomtest

    summaries = [summarize(run.episodes, profile) for run in (first, second)]
    one, other = (summary.scene_scores() for summary in summaries)
    families = [y - x for x, y in zip(one, other, strict=True)]
    low, high = bootstrap(families)
    # A scene's share of the overall mean: its family's among the families, its own within its family.
    weight = np.concatenate([np.full(len(part), 1.0 / (len(part) * len(families))) for part in families])
    p = _chances(np.concatenate(one), np.concatenate(other), weight)
    x, y = (outcomes(run.episodes, profile).sr for run in (first, second))
    only_first, only_second = int(np.sum(x & ~y)), int(np.sum(y & ~x))
    torn = only_first + only_second
    exact = float(binomtest(only_first, torn).pvalue) if torn else 1.0
    known = any(knows_views(run.episodes, profile) for run in (first, second))
    rows = []
    for k, metric in enumerate(METRICS):
        if not known and metric == "sr_view":
            continue
        a, b = (summary.overall[1 + k] for summary in summaries)
        ends = [text(metric, float(end[k]), signed=True) for end in (low, high)]
        interval = NONE if math.isnan(low[k]) else f"[{', '.join(ends)}]"
        cells = (text(metric, a), text(metric, b), text(metric, b - a, signed=True), interval, _p(float(p[k])))
        rows.append((MEASURES[metric].head, cells))
    notes = [
        f"{len(first.episodes):,} tasks of {len(weight)} scenes, flown by both. The interval draws scenes anew "
        "within their family; p is that of a permutation test which exchanges the two agents scene by scene, "
        "two-sided.",
        f"Solved by {first.label} alone: {only_first:,}; by {second.label} alone: {only_second:,} "
        f"(McNemar's exact p {_p(exact)}, which takes episodes for independent).",
    ]
    gap = f"{second.label} − {first.label}"
    heads = [
        Column(first.label),
        Column(second.label),
        *(Column(h, gap) for h in ("difference", "95 % interval", "p")),
    ]
    title = f"{second.label} against {first.label}, {profile_head(profile)}"
    return TextTable("measure", heads, rows, title, notes)


def _chances(a: Floats, b: Floats, weight: Floats) -> Floats:
    """How often a difference as large arises where two runs are exchanged scene by scene: exact for few exchanges."""
    from scipy.stats import permutation_test

    def weighted(x: Any, y: Any, axis: int) -> Any:
        # Rounded: sums in another order differ in their last digits, and would count as other differences.
        return np.round(np.sum((y - x) * weight, axis=axis), 12)

    p = np.ones(len(METRICS))
    for k in range(len(METRICS)) if len(a) > 1 else ():
        if not (np.isfinite(a[:, k]) & np.isfinite(b[:, k])).all():
            p[k] = math.nan
            continue
        p[k] = permutation_test(
            (a[:, k], b[:, k]), weighted, permutation_type="samples", vectorized=True, n_resamples=RESAMPLES,
            rng=rng.generator(0, "permutation"),
        ).pvalue  # fmt: skip
    return p


def _p(p: float) -> str:
    if math.isnan(p):
        return NONE
    return "< 0.001" if p < 0.001 else f"{p:.3f}"
