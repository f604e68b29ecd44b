"""Runs of an evaluation, read for tables, figures and the report; baselines flown on the same tasks are added."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import Malformed, StoreError, UsageError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.benchmark.episodes import has_table, read_run
from aerialdojo_gen.benchmark.episodes import runs as run_names
from aerialdojo_gen.benchmark.metrics import Bools, Episodes, Floats, episodes_of
from aerialdojo_gen.dataset.protocol import Sample
from aerialdojo_gen.store.root import DataRoot, Where, open_root

STEP_COLUMNS = ("task_id", "step", "x_m", "y_m", "z_m", "distance_m")


def path_clearances(episodes: pa.Table, steps: pa.Table) -> Floats:
    """Smallest distance to the goal over flown segments, (n,) metres: each and its end distances fix a triangle."""
    nearest = np.array(episodes["min_distance_m"].to_numpy(), dtype=np.float64)
    owner = pc.index_in(steps["task_id"], value_set=episodes["task_id"].combine_chunks())
    flown = steps.filter(pc.is_valid(owner))
    if not flown.num_rows:
        return nearest
    index = pc.drop_null(owner).to_numpy()
    order = np.lexsort((flown["step"].to_numpy(), index))
    index = index[order]
    place = np.stack([flown[f"{a}_m"].to_numpy()[order] for a in "xyz"], axis=1)
    distance = flown["distance_m"].to_numpy()[order]
    first = np.concatenate([[True], index[1:] != index[:-1]])
    begun = index[first]
    from_place, from_distance = np.roll(place, 1, axis=0), np.roll(distance, 1)
    from_place[first] = np.stack([episodes[f"start_{a}_m"].to_numpy()[begun] for a in "xyz"], axis=1)
    from_distance[first] = episodes["euclidean_m"].to_numpy()[begun]
    np.minimum.at(nearest, index, _nearest_on_segment(place - from_place, from_distance, distance))
    return nearest


def _nearest_on_segment(way: Floats, begin_m: Floats, end_m: Floats) -> Floats:
    """Return the distance from a point to segments, of which the ways and the distances at both ends are known."""
    length = np.linalg.norm(way, axis=1)
    # How far along the segment the foot of the perpendicular is, by the law of cosines.
    doubled = begin_m**2 + length**2 - end_m**2
    along = np.divide(doubled, 2.0 * length, out=np.zeros_like(length), where=length > 0.0)
    height = np.sqrt(np.maximum(begin_m**2 - along**2, 0.0))
    return np.where((along > 0.0) & (along < length), height, np.minimum(begin_m, end_m))


# Agents that are not compared: the oracle, and the baselines that ignore observations.
UPPER_BOUND, BASELINES = "upper bound", "baselines"
GROUP_OF = {"oracle": UPPER_BOUND, "stop": BASELINES, "constant": BASELINES, "random": BASELINES}

# The partition of episodes in OOD scenes whose training tasks the agent was trained on.
ADAPTED = "OOD adapted"


@dataclass(frozen=True, eq=False)
class Run:
    """A run and its episodes."""

    name: str  # The run's id
    label: str  # Its agent, with the run's id where two runs share it
    agent: str  # The agent, and its options as JSON
    options: str
    table: pa.Table  # The log, all columns
    failed: int = 0  # Episodes that failed for external reasons, not in the table
    log: DataRoot | None = None  # The root that `evaluate` wrote to, where its steps are
    group: str = ""  # Heading of its section in tables; empty for none
    hints: str = ""  # Hints given to the agent; empty for none

    def where(self, mask: Bools | NDArray[np.int64]) -> Run:
        """Return the run with the episodes that a mask selects, or with those at some indices in their order."""
        chosen = np.flatnonzero(mask) if mask.dtype == np.bool_ else mask
        return replace(self, table=self.table.take(pa.array(chosen)))

    @cached_property
    def episodes(self) -> Episodes:
        """The columns that metrics use; StoreError where the log contradicts itself or has no goals."""
        return episodes_of(self.table)

    @cached_property
    def path_clearance_to_goal_m(self) -> Floats | None:
        """Smallest distance to the goal anywhere on the way, (n,) float64, metres; None where no steps are logged."""
        if self.log is None or not has_table(self.log, self.name, "steps"):
            return None
        return path_clearances(self.table, read_run(self.log, self.name, "steps", STEP_COLUMNS))


def load_runs(data: Where, names: Sequence[str] = (), sample: Sample | None = None) -> list[Run]:
    """Read runs; with a sample, only their episodes of its tasks."""
    root = open_root(data)

    def read(name: str, table: str = "episodes") -> pa.Table:
        rows = read_run(root, name, table)
        return rows if sample is None else rows.filter(pc.is_in(rows["task_id"], pa.array(sample.ids(), pa.string())))

    loaded, of = [], "" if sample is None else " of the paper's sample"
    for name in dict.fromkeys(names or run_names(root)):
        table = read(name)
        if not table.num_rows and not names:
            continue
        failed = read(name, "failures").num_rows
        if not table.num_rows:
            said = f", and {failed:,} that failed: fly them again with" if failed else ": run"
            rerun_command = command("evaluate", run=name, protocol=sample and "paper", rerun_failed=bool(failed))
            raise StoreError(f"run {name!r} has no finished episode{of}{said} {rerun_command}")
        agent, options, hints = (table[column][0].as_py() for column in ("agent", "agent_options", "told"))
        # With hints it is another contender.
        label = f"{agent} + {hints}" if hints else agent
        loaded.append(Run(name, label, agent, options, mark_adapted(table, options), failed, root, hints=hints or ""))
    if not loaded:
        what = "no runs" if sample is None else f"no episodes{of}"
        raise StoreError(f"{what} in {root}: run {command('evaluate', protocol=sample and 'paper')}")
    labels = Counter(run.label for run in loaded)
    return [replace(run, label=f"{run.label} ({run.name})") if labels[run.label] > 1 else run for run in loaded]


def mark_adapted(table: pa.Table, options: str) -> pa.Table:
    """Mark the OOD scenes that the agent was trained on, by `trained_on` of its logged options, in `partition`."""
    try:
        given = loads_json(options)
    except Malformed:
        return table
    scenes = given.get("trained_on") if isinstance(given, dict) else None
    if not isinstance(scenes, list):
        return table
    trained = pc.is_in(table["scene"], pa.array([scene for scene in scenes if isinstance(scene, str)], pa.string()))
    marked = pc.if_else(pc.and_(pc.equal(table["partition"], "OOD"), trained), ADAPTED, table["partition"])
    return table.set_column(table.column_names.index("partition"), "partition", marked)


_BASELINE_AGENTS = tuple(agent for agent, group in GROUP_OF.items() if group == BASELINES)


def with_baselines(log: DataRoot, runs: Sequence[Run]) -> list[Run]:
    """Add baseline runs that flew the same tasks and are not among the runs."""
    wanted = pa.array({task for run in runs for task in run.table["task_id"].to_pylist()}, pa.string())
    added: dict[str, Run] = {}
    for name in run_names(log):
        try:
            agents = read_run(log, name, columns=["agent"])["agent"]
        except StoreError:
            # Not requested: a damaged run is skipped.
            continue
        agent = agents[0].as_py() if len(agents) else ""
        if agent in {*_BASELINE_AGENTS} - {run.agent for run in runs} - {*added}:
            (run,) = load_runs(log, [name])
            mask = pc.is_in(run.table["task_id"], wanted).to_numpy()
            if mask.sum() == len(wanted):
                added[agent] = run.where(mask)
    return [*runs, *(added[agent] for agent in _BASELINE_AGENTS if agent in added)]


def group_runs(runs: Sequence[Run], groups: Mapping[str, Sequence[str]] | None = None) -> list[Run]:
    """Group and order runs: the user's groups, the others, the upper bound, the baselines."""
    chosen = dict(groups or {})
    for heading, names in chosen.items():
        for name in names:
            if name not in {n for run in runs for n in (run.name, run.agent)}:
                raise UsageError(f"group {heading!r}: {unknown('no run', name, [run.name for run in runs])}")

    others = "other agents" if chosen else "agents"
    order = [*chosen, others, UPPER_BOUND, BASELINES]

    def group(run: Run) -> str:
        named = (heading for heading, names in chosen.items() if run.name in names or run.agent in names)
        return next(named, GROUP_OF.get(run.agent, others))

    grouped = [replace(run, group=group(run)) for run in runs]
    # A single group needs no heading.
    if len({run.group for run in grouped}) == 1:
        return [replace(run, group="") for run in grouped]
    return sorted(grouped, key=lambda run: order.index(run.group))
