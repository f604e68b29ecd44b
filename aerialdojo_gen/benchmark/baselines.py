"""Runs in the order and the groups that tables show them in, with the floors that any agent has to beat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.episodes import runs as run_names
from aerialdojo_gen.benchmark.runs import FLOORS, GROUP_OF, UPPER_BOUND, Run, load_runs
from aerialdojo_gen.store.root import DataRoot

_FLOOR_AGENTS = tuple(agent for agent, group in GROUP_OF.items() if group == FLOORS)


def with_floors(log: DataRoot, runs: Sequence[Run]) -> list[Run]:
    """Add the floors that were flown on the same tasks and are not among the runs."""
    there = {run.agent for run in runs}
    wanted = {task for run in runs for task in run.table["task_id"].to_pylist()}
    added: dict[str, Run] = {}
    for name in run_names(log):
        if name in {run.name for run in runs}:
            continue
        (run,) = load_runs(log, [name]) if _is_floor(log, name) else (None,)
        if run is None or run.agent in there or run.agent in added:
            continue
        mask = np.array([task in wanted for task in run.table["task_id"].to_pylist()], dtype=np.bool_)
        if mask.sum() == len(wanted):
            added[run.agent] = run.where(mask)
    return [*runs, *(added[agent] for agent in _FLOOR_AGENTS if agent in added)]


def _is_floor(log: DataRoot, name: str) -> bool:
    try:
        agents = read_run(log, name, columns=["agent"])["agent"]
    except StoreError:
        # Nobody asked for this run: it may be as broken as it likes.
        return False
    return len(agents) > 0 and agents[0].as_py() in _FLOOR_AGENTS


def arranged(runs: Sequence[Run], groups: Mapping[str, Sequence[str]] | None = None) -> list[Run]:
    """Put runs in order by their groups: the user's own, the others, then the upper bound and the floors."""
    chosen = dict(groups or {})
    for heading, names in chosen.items():
        for name in names:
            if name not in {n for run in runs for n in (run.name, run.agent)}:
                raise UsageError(f"group {heading!r}: {unknown('no run', name, [run.name for run in runs])}")

    others = "other agents" if chosen else "agents"
    order = [*chosen, others, UPPER_BOUND, FLOORS]
    grouped = [
        replace(
            run,
            group=next(
                (head for head, names in chosen.items() if run.name in names or run.agent in names),
                GROUP_OF.get(run.agent, others),
            ),
        )
        for run in runs
    ]
    # One group needs no heading.
    if len({run.group for run in grouped}) == 1:
        return [replace(run, group="") for run in grouped]
    return sorted(grouped, key=lambda run: order.index(run.group))
