"""Runs of an evaluation, read for tables, figures and the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.benchmark.episodes import has_table, read_run, runs
from aerialdojo_gen.benchmark.metrics import Bools, Episodes, Floats, episodes_of
from aerialdojo_gen.benchmark.path_clearance_to_goal import STEP_COLUMNS, swept_distances
from aerialdojo_gen.store.root import DataRoot, Where, open_root
from aerialdojo_gen.store.schemas import TERMINATIONS

# What is no contender: the one that knows the way, and those that look at nothing.
UPPER_BOUND, FLOORS = "upper bound", "floors"
GROUP_OF = {"oracle": UPPER_BOUND, "stop": FLOORS, "constant": FLOORS, "random": FLOORS}


@dataclass(frozen=True, eq=False)
class Run:
    """A run and its episodes."""

    name: str  # The run's id
    label: str  # What tables call it: its agent, with the run's id where two runs have one agent
    agent: str  # The agent, and its options as JSON
    options: str
    table: pa.Table  # The log, all columns
    episodes: Episodes  # What the metrics take from it
    failed: int = 0  # Episodes that are not in it, given up for reasons outside the agent
    log: DataRoot | None = None  # The root that `evaluate` wrote to, where its steps are
    group: str = ""  # Heading that tables set it under; empty for an agent like any other
    told: str = ""  # What the agent was told beside the goal; empty for nothing

    def where(self, mask: Bools | NDArray[np.int64]) -> Run:
        """Return the run with the episodes that a mask selects, or with those at some indices in their order."""
        chosen = np.flatnonzero(mask) if mask.dtype == np.bool_ else mask
        return replace(self, table=self.table.take(pa.array(chosen)), episodes=self.episodes.where(chosen))

    @cached_property
    def swept_distance_m(self) -> Floats | None:
        """Smallest distance to the goal anywhere on the way, (n,) float64, metres; None where no steps are logged."""
        if self.log is None or not has_table(self.log, self.name, "steps"):
            return None
        return swept_distances(self.table, read_run(self.log, self.name, "steps", STEP_COLUMNS))


def load_runs(data: Where, names: Sequence[str] = ()) -> list[Run]:
    """Read runs."""
    root = open_root(data)
    tables = {name: read_run(root, name) for name in (names or runs(root))}
    if not names:
        tables = {name: table for name, table in tables.items() if table.num_rows}
    if not tables:
        raise StoreError(f"no runs in {root}: run {command('evaluate')}")
    for name, table in tables.items():
        if not table.num_rows:
            failed = read_run(root, name, "failures").num_rows
            said = f", and {failed:,} that failed: fly them again with" if failed else ": run"
            again = command("evaluate", run=name, rerun_failed=bool(failed))
            raise StoreError(f"run {name!r} has no finished episode{said} {again}")
    agents = [table["agent"][0].as_py() for table in tables.values()]
    told = [table["told"][0].as_py() or "" for table in tables.values()]
    # Who was told more is another contender.
    called = [f"{agent} + {more}" if more else agent for agent, more in zip(agents, told, strict=True)]
    return [
        Run(
            name,
            call if called.count(call) == 1 else f"{call} ({name})",
            agent,
            table["agent_options"][0].as_py(),
            table,
            episodes_of(table),
            read_run(root, name, "failures").num_rows,
            root,
            told=more,
        )
        for (name, table), agent, more, call in zip(tables.items(), agents, told, called, strict=True)
    ]


@dataclass(frozen=True)
class Conduct:
    """How a run's episodes went, whatever they earned."""

    episodes: int  # How many
    ended: dict[str, float]  # Share of the episodes by how they ended: stop, collision, budget
    actions: float  # Mean number of actions
    refused: int  # Moves out of the flight volume; answers that named no action
    invalid: int
    requests: int | None  # Of an outside service, all episodes together; None where it does not say
    input_tokens: int | None
    output_tokens: int | None
    cost_usd: float | None  # None where prices are not known


def episode_outcomes(run: Run) -> Conduct:
    """Count how a run's episodes went."""
    n = len(run.episodes)
    ends = run.table["termination"].to_pylist()

    def total(name: str) -> int | None:
        # A sum with a hole in it is not known.
        return None if run.table[name].null_count else int(pc.sum(run.table[name]).as_py() or 0)

    costs = run.table["cost_usd"]
    return Conduct(
        n,
        {how: ends.count(how) / n for how in TERMINATIONS},
        float(run.episodes.n_actions.mean()),
        total("n_refused") or 0,
        total("n_invalid") or 0,
        total("n_requests"),
        total("input_tokens"),
        total("output_tokens"),
        None if costs.null_count else math.fsum(costs.to_pylist()),
    )
