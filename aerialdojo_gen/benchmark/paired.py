"""Two runs on the same tasks: the difference of their scores, and whether it may be chance."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.text_table import Column, TextTable
from aerialdojo_gen.benchmark.intervals import Paired, paired
from aerialdojo_gen.benchmark.metrics import MEASURES, METRICS, Profile, knows_views
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import NONE, profile_head, text


def paired_tables(runs: Sequence[Run], profiles: Sequence[Profile]) -> list[TextTable]:
    """Compare the second run with the first, on the tasks that both have flown, a table a profile."""
    if len(runs) != 2:
        named = ", ".join(run.name for run in runs)
        raise UsageError(f"--paired compares two runs, not {len(runs)} ({named}): name two")
    first, second = _same_tasks(*runs)
    return [_table(first, second, profile) for profile in profiles]


def _same_tasks(first: Run, second: Run) -> tuple[Run, Run]:
    """Cut two runs down to the tasks that both have flown, in one order."""
    tasks = [np.array(run.table["task_id"].to_pylist(), dtype=np.str_) for run in (first, second)]
    both = np.intersect1d(tasks[0], tasks[1])
    if not len(both):
        raise UsageError(f"{first.name} and {second.name} have no task in common: fly both on the same ones")
    cut = []
    for run, ids in zip((first, second), tasks, strict=True):
        order = np.argsort(ids)
        cut.append(run.where(order[np.searchsorted(ids[order], both)]))
    return cut[0], cut[1]


def _table(first: Run, second: Run, profile: Profile) -> TextTable:
    result = paired(first.episodes, second.episodes, profile)
    known = any(knows_views(run.episodes, profile) for run in (first, second))
    rows = [(MEASURES[m].head, _cells(result, k, m)) for k, m in enumerate(METRICS) if known or m != "sr_view"]
    notes = [
        f"{result.tasks:,} tasks of {result.scenes} scenes, flown by both. The interval draws scenes anew within "
        "their family; p is that of a permutation test which exchanges the two agents scene by scene, two-sided.",
        f"Solved by {first.label} alone: {result.only_first:,}; by {second.label} alone: {result.only_second:,} "
        f"(McNemar's exact p {_p(result.p_mcnemar)}, which takes episodes for independent).",
    ]
    gap = f"{second.label} − {first.label}"
    columns = [
        Column(first.label),
        Column(second.label),
        *(Column(h, gap) for h in ("difference", "95 % interval", "p")),
    ]
    title = f"{second.label} against {first.label}, {profile_head(profile)}"
    return TextTable("measure", columns, rows, title, notes)


def _cells(result: Paired, k: int, metric: str) -> tuple[str, ...]:
    low, high = float(result.low[k]), float(result.high[k])
    return (
        text(metric, float(result.first[k])),
        text(metric, float(result.second[k])),
        text(metric, float(result.difference[k]), signed=True),
        NONE if math.isnan(low) else f"[{text(metric, low, signed=True)}, {text(metric, high, signed=True)}]",
        _p(float(result.p[k])),
    )


def _p(p: float) -> str:
    if math.isnan(p):
        return NONE
    return "< 0.001" if p < 0.001 else f"{p:.3f}"
