"""Evaluate an agent: select tasks, fly them in worker processes, write the log.

Finished episodes are never flown again: a worker writes each to a journal; the parent moves a scene's journals into
the tables when the scene is finished, when the run ends, or when the next one begins. The tables of a deterministic
agent are the same bytes whatever the number of workers and however often the run was killed.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.errors import AerialDojoError, StoreError, UsageError
from aerialdojo_gen.base.safe_parse import read_json
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark import episodes
from aerialdojo_gen.benchmark.agents import ServiceDown, agent_class, load_agent
from aerialdojo_gen.benchmark.episodes import Journals
from aerialdojo_gen.benchmark.evaluation import Evaluation, Limits, Outcome, agent_code_digest
from aerialdojo_gen.benchmark.flight import no_viewpoints_message, viewpoints_content
from aerialdojo_gen.benchmark.tasks import goals_withheld, select
from aerialdojo_gen.benchmark.worker import Finished, Worker, WorkUnit
from aerialdojo_gen.dataset.contents import release_fingerprint
from aerialdojo_gen.pipeline.executors.base import (
    Executor,
    ParentChannel,
    SharedPaths,
    WorkerChannel,
    at_end,
    make_executor,
    on_disk,
)
from aerialdojo_gen.pipeline.interrupt import Interrupts
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.layout import check_run_name
from aerialdojo_gen.store.root import DataRoot, Where, open_root

__all__ = ["Evaluation", "Outcome", "evaluate"]

_SETTINGS = "run.json"


def evaluate(
    data: Where, evaluation: Evaluation, *, out: Where | None = None, workers: int | None = 1,
    executor: str = "local", address: str | None = None, rerun_failed: bool = False, restart: bool = False,
    limits: Limits | None = None, reporter: Reporter | None = None,
) -> Outcome:  # fmt: skip
    """Fly an agent through the tasks of a selection; `aerialdojo-gen evaluate` in the library."""
    started = time.monotonic()
    limits = limits or Limits()
    root, log = open_root(data), open_root(data if out is None else out)
    reporter = reporter or Reporter(quiet=True)
    run = RunLog(root, log, evaluation)
    paths = SharedPaths(on_disk(root, below="release"), (), (run.journals.folder,), reporter.line)
    made = make_executor(executor, workers, address, paths)
    with run.folder.lock(), Interrupts() as interrupts:
        if restart:
            run.drop()
        run.check_settings()
        run.flush_journals()
        todo = run.todo(rerun_failed)
        if todo.num_rows:
            evaluation = preflight(evaluation, limits, reporter)
            if run.no_viewpoints_message and run.goals_known:
                reporter.line(no_viewpoints_message(run.no_viewpoints_message, len(run.rows["scene"].unique())))
        total = run.spent()
        with reporter.bar(evaluation.label, todo.num_rows, "episodes") as bar:

            def on_finished(finished: Finished) -> None:
                nonlocal total
                total += finished
                bar.advance(finished.episodes)

            def stopped() -> bool:
                interrupts.check()
                run.checkpoint(reporter)
                return bool(limits.reached(total) or limits.failing(total))

            try:
                # The processes have ended when their journals are flushed.
                with ExitStack() as stack:
                    stack.callback(run.flush_journals)
                    pool = stack.enter_context(made)
                    units = run.units(todo, pool.workers if todo.num_rows else 1)
                    for scene in fly_units(root, evaluation, units, pool, on_finished, stopped):
                        run.flush_journals(scene)
            except ServiceDown as error:
                raise ServiceDown(f"{error} Finished episodes are kept: the same command continues") from None
        if (limit := limits.reached(total)) and len(run.todo(False)):
            reporter.line(f"stopped at {limit}: the same command with a higher limit continues")
        finished, failed, successes = run.counts()
    why = ""
    if kind := limits.failing(total):
        why = f"stopped after {limits.failures_in_row} failures in a row of one kind ({kind})."
    return Outcome(
        run.rows.num_rows, finished, failed, total.episodes, total.actions, total.cost_usd, total.tokens,
        time.monotonic() - started, why, run.failures(), total.flown, successes if run.goals_known else None,
    )  # fmt: skip


class RunLog:
    """A run's folder and tables: what is in them, and what is left to fly."""

    def __init__(self, data: DataRoot, out: DataRoot, evaluation: Evaluation) -> None:
        self._out, self._name = out, evaluation.run
        self.folder = out.below(f"runs/{check_run_name(evaluation.run)}")
        self.rows = select(data, evaluation.selection)
        self.journals = Journals(out, evaluation.run)
        self._uncommitted = ""
        self._scenes: list[str] = self.rows["scene"].unique().to_pylist()
        subsets = self.rows["subset"].unique().to_pylist()
        content = {
            f"{table}/{scene}": store.content(data, table, scene)
            for scene in self._scenes
            for table in ("release/scenes", *(f"{kind}/{s}" for kind in ("tasks", "routes") for s in subsets))
            if not (evaluation.withheld and table.startswith("routes/") and goals_withheld(data, scene, table[7:]))
        }
        self.goals_known = len(content) == len(self._scenes) * (1 + 2 * len(subsets))
        seen_from = {scene: viewpoints_content(data, scene) for scene in self._scenes}
        self.no_viewpoints_message = [scene for scene, found in seen_from.items() if not found]
        content |= {f"release/viewpoints/{scene}": found for scene, found in seen_from.items() if found}
        digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
        own = {"data": digest, "code": agent_code_digest(evaluation.agent)}
        self._settings = json.loads(json.dumps(evaluation.settings() | own))
        self._fingerprint = hashlib.sha256(json.dumps(self._settings, sort_keys=True).encode()).hexdigest()

    def check_settings(self) -> None:
        """Write the run's settings; UsageError if it was begun with others."""
        begun = episodes.run_scenes(self._out, self._name) or self.journals
        advice = "give another --run, or --restart"
        # A run without finished episodes may change: an agent's options may have been wrong.
        if begun and self.folder.exists(_SETTINGS):
            before, own = read_json(self.folder.local_copy(_SETTINGS), UsageError), ("data", "code")
            if not isinstance(before, dict):
                raise UsageError(f"{self.folder.at(_SETTINGS)} holds no settings of a run: {advice}")
            for key, value in self._settings.items():
                if before.get(key) != value:
                    what = f"{key} = {before.get(key)!r}, not {value!r}"
                    what = f"other {key}" if key in own else what
                    raise UsageError(f"run {self._name!r} was begun with {what}: {advice}")
        for scene in episodes.run_scenes(self._out, self._name):
            written = store.shards(self._out, "episodes", scene, self._name)[0]
            if store.read_info(self._out, written).fingerprint != self._fingerprint:
                raise UsageError(f"there are episodes of another run {self._name!r} in {self._out}: {advice}")
        with self.folder.commit(_SETTINGS) as temporary:
            temporary.write_text(json.dumps(self._settings, indent=2, sort_keys=True) + "\n", encoding="utf-8")

    def drop(self) -> None:
        """Remove the run."""
        episodes.remove_run(self._out, self._name)
        self.journals.drop()
        self.folder.delete(_SETTINGS)

    def flush_journals(self, scene: str = "*") -> None:
        """Move the journals of a scene, or of all, into the tables."""
        for name, records in self.journals.take(scene):
            if records:
                episodes.add_records(self._out, self._name, name, records, self._fingerprint)

    def checkpoint(self, reporter: Reporter) -> None:
        """Commit finished episodes to an object store from time to time; report an unreachable store once."""
        try:
            self.journals.checkpoint()
            self._uncommitted = ""
        except StoreError as error:
            if not self._uncommitted:
                reporter.line(f"{error}; finished episodes are kept in {self.journals.folder} meanwhile")
            self._uncommitted = str(error)

    def todo(self, rerun_failed: bool) -> pa.Table:
        """Rows still to be flown, or exactly those that failed."""
        ids = self.rows["task_id"]
        if rerun_failed:
            return self.rows.filter(pc.is_in(ids, pa.array(self._ids("failures"), pa.string())))
        done = self._ids("episodes") + self._ids("failures")
        return self.rows.filter(pc.invert(pc.is_in(ids, pa.array(done, pa.string()))))

    def counts(self) -> tuple[int, int, int]:
        """Episodes in the tables: finished, failed, successful."""
        flown = [row["success"] for row in self._read("episodes", "success")]
        return len(flown), len(self._ids("failures")), sum(flown)

    def failures(self) -> tuple[str, ...]:
        """Describe the failures, the most frequent kind first, with the reason of its first."""
        rows = self._read("failures", "kind", "reason")
        first: dict[str, str] = {}
        for row in rows:
            first.setdefault(row["kind"], row["reason"])
        counted = Counter(row["kind"] for row in rows).most_common()
        return tuple(f"{n} × {kind}{'' if i else f' ({first[kind]})'}" for i, (kind, n) in enumerate(counted))

    def spent(self) -> Finished:
        """US dollars and tokens spent so far."""
        columns = ("cost_usd", "input_tokens", "output_tokens")
        rows = self._read("episodes", *columns) + self._read("failures", *columns)
        tokens = sum((row["input_tokens"] or 0) + (row["output_tokens"] or 0) for row in rows)
        return Finished(cost_usd=sum(row["cost_usd"] or 0.0 for row in rows), tokens=tokens)

    def _read(self, table: str, *columns: str) -> list[dict[str, Any]]:
        """Read columns of a table of the run, all scenes that are written."""
        scenes = episodes.run_scenes(self._out, self._name)
        tables = (store.read_scene(self._out, table, scene, columns, self._name) for scene in scenes)
        return [row for rows in tables for row in rows.to_pylist()]

    def _ids(self, table: str) -> list[str]:
        return [row["task_id"] for row in self._read(table, "task_id")]

    def units(self, todo: pa.Table, workers: int) -> list[WorkUnit]:
        """Split the work: by whole scenes where there are many, as opening a scene takes seconds."""
        by_scene = {s: todo.filter(pc.equal(todo["scene"], s)) for s in todo["scene"].unique().to_pylist()}
        share = -(-todo.num_rows // (4 * workers)) if workers > 1 else todo.num_rows
        units = []
        # The largest first, so that the last one is small.
        for scene, rows in sorted(by_scene.items(), key=lambda item: -item[1].num_rows):
            parts = 1 if len(by_scene) >= 4 * workers else -(-rows.num_rows // share)
            size = -(-rows.num_rows // parts)
            for k in range(parts):
                units.append(WorkUnit(scene, rows.slice(k * size, size), self.journals.path(scene, k)))
        return units


def preflight(evaluation: Evaluation, limits: Limits, reporter: Reporter) -> Evaluation:
    """Check an agent's service by one request; agents without `check` are returned as they are."""
    # By its class: an agent without a check may take long to construct.
    if not hasattr(agent_class(evaluation.agent), "check"):
        return evaluation
    agent: Any = load_agent(evaluation.agent, **evaluation.options)
    try:
        if limits.cost_usd is not None and not getattr(agent, "priced", True):
            raise UsageError(
                "--max-cost needs prices: --option input_usd_per_million=… --option output_usd_per_million=…"
            )
        found = agent.check()
        for option, limit in (("--max-cost", limits.cost_usd), ("--max-tokens", limits.tokens)):
            if limit is not None and not getattr(agent, "tells_tokens", True):
                raise UsageError(f"{option} cannot be kept: {found}")
        if found:
            reporter.line(f"{evaluation.agent}: {found}")
        settled: dict[str, Any] = getattr(agent, "settled", dict)()
        used: dict[str, Any] | None = agent.used_options() if hasattr(agent, "used_options") else None
    finally:
        agent.close()
    return replace(evaluation, options={**evaluation.options, **settled}, used=used)


# Assumed memory per process, megabytes, without an agent's model.
MEMORY_MB = 1000


def fly_units(
    data: DataRoot, evaluation: Evaluation, units: Sequence[WorkUnit], executor: Executor,
    on_finished: Callable[[Finished], None], stopped: Callable[[], bool],
) -> Iterator[str]:  # fmt: skip
    """Fly units, and yield a scene when all of its units are finished."""
    left = Counter(unit.scene for unit in units)
    fly, channel = partial(_fly, data, evaluation), ParentChannel(on_finished, stopped)
    for outcome in executor.map(fly, units, lambda unit: unit.scene, channel=channel, memory_mb=MEMORY_MB):
        if isinstance(outcome, AerialDojoError):
            raise outcome
        left[outcome] -= 1
        if not left[outcome]:
            yield outcome


# This process's worker, made at its first unit: an agent may hold a model, and the flight holds scenes.
_worker_of_process: dict[str, Worker] = {}


def _make_worker(data: DataRoot, evaluation: Evaluation, link: WorkerChannel) -> Worker:
    """Make a worker with its agent, which is closed when the process has done its work."""
    agent: Any = load_agent(evaluation.agent, **evaluation.options)
    if evaluation.requests_per_minute is not None:
        if not hasattr(agent, "pace"):
            raise UsageError(f"agent {evaluation.agent!r} has no attribute pace: leave --requests-per-minute out")
        # Requests of all workers are spaced evenly.
        interval_s = 60.0 / evaluation.requests_per_minute
        agent.pace = lambda: time.sleep(link.turn(interval_s))
    if hasattr(agent, "suits"):
        agent.suits(release_fingerprint(data))
    flight = evaluation.flight_of(agent, data)
    at_end(_worker_of_process.clear)
    if hasattr(agent, "close"):
        at_end(agent.close)
    secrets = Secrets(evaluation.options)
    return Worker(agent, flight, data, evaluation.identity(), evaluation.retry_policy, secrets)


def _fly(data: DataRoot, evaluation: Evaluation, unit: WorkUnit, link: WorkerChannel) -> str:
    if "worker" not in _worker_of_process:
        _worker_of_process["worker"] = _make_worker(data, evaluation, link)
    unsent, last = Finished(), time.monotonic()

    def add(finished: Finished) -> None:
        nonlocal unsent, last
        unsent += finished
        if time.monotonic() - last >= link.every_s:
            link.send(unsent)
            unsent, last = Finished(), time.monotonic()

    try:
        _worker_of_process["worker"].fly(unit, add, link.stopped)
    finally:
        if unsent.episodes:
            link.send(unsent)
    return unit.scene
