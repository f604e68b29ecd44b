"""Run stages: find the stale shards, compute them in processes, commit each one whole.

A shard with the right fingerprint is never computed again, one with a wrong one always is; so a killed run goes on
where it stopped, and the tables do not depend on the number of workers, their order, or the kills.
"""

from __future__ import annotations

import difflib
import fcntl
import fnmatch
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from aerialdojo_gen.config.pipeline import Pipeline
from aerialdojo_gen.errors import AerialDojoError, BudgetSpent, StoreError, UsageError
from aerialdojo_gen.pipeline.code_digest import stage_code
from aerialdojo_gen.pipeline.executors import Executor, Folders, make_executor, on_disk
from aerialdojo_gen.pipeline.freshness import Limits, shards_of
from aerialdojo_gen.pipeline.interrupt import Interrupts
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.pipeline.registry import STAGES
from aerialdojo_gen.pipeline.stage import Roots, Stage
from aerialdojo_gen.pipeline.task import compute
from aerialdojo_gen.store.atomic import disk_error
from aerialdojo_gen.store.staging import sweep, sweep_unstaged


@dataclass(frozen=True)
class StageSummary:
    """What a stage did.

    Attributes
    ----------
    stage : str
        Name of the stage.
    rows_in, rows_out : int
        Over all its shards, also those that were already there.
    counts : Counter
        Reasons and outcomes, over all its shards.
    shards, computed : int
        Shards in all; shards that were computed now.
    seconds : float
        Wall time.
    """

    stage: str
    rows_in: int
    rows_out: int
    counts: Counter[str] = field(default_factory=Counter)
    shards: int = 0
    computed: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        """One line: rows in, rows out, why the others were rejected, seconds."""
        counts = ", ".join(
            f"{name} {n:,}" for name, n in sorted(self.counts.items(), key=lambda c: (-c[1], c[0])) if n
        )
        fresh = "nothing to do" if not self.computed else f"{self.computed} of {self.shards} shards computed"
        return (
            f"{self.stage}: {self.rows_in:,} rows in, {self.rows_out:,} out"
            f"{f' ({counts})' if counts else ''}; {fresh}; {self.seconds:.1f} s"
        )


@contextmanager
def data_lock(data: Path) -> Iterator[None]:
    """Hold the data directory: one run writes to it at a time; a killed run's lock is gone with it.

    What killed runs left half-made in it is removed.
    """
    try:
        data.mkdir(parents=True, exist_ok=True)
        file = (data / ".lock").open("a+")
    except OSError as error:
        raise disk_error(error, data / ".lock") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StoreError(f"another run is writing to {data}: wait for it, or use another --data") from None
        except OSError as error:
            raise disk_error(error, data / ".lock") from None
        _sweep_once(file, data)
        sweep(data)
        try:
            yield
        finally:
            # What workers were at when an error or Ctrl-C ended them.
            sweep(data)


def _sweep_once(lock: TextIO, data: Path) -> None:
    """Remove what killed runs of earlier versions left, once in a data directory's life."""
    lock.seek(0)
    if not lock.read():
        sweep_unstaged(data)
        lock.write("staged\n")
        lock.flush()


def run(
    stages: Sequence[Stage],
    scenes: Sequence[str],
    pipeline: Pipeline,
    roots: Roots,
    *,
    workers: int | None = 1,
    executor: str = "local",
    address: str | None = None,
    force: Iterable[str] = (),
    reporter: Reporter | None = None,
    limits: Limits | None = None,
    prepare: Callable[[], None] | None = None,
    finish: Callable[[], None] | None = None,
) -> list[StageSummary]:
    """Run stages in their order on scenes.

    Parameters
    ----------
    stages : sequence of Stage
        In pipeline order; what they read must be there or be written by an earlier one.
    scenes : sequence of str
        Names of the scenes.
    pipeline : Pipeline
        Configuration and seed.
    roots : Roots
        The folders.
    workers : int, optional
        Processes; with 1 everything runs in this one, with None on all cores there are.
    executor, address : str
        As for `aerialdojo_gen.pipeline.executors.make_executor`.
    force : iterable of str
        Names of stages whose shards are computed even where they are fresh.
    reporter : Reporter, optional
        Shows progress and summaries.
    limits : Limits, optional
        How much of the last stage is computed now; all of it where absent.

    prepare, finish : callable, optional
        Called before the first stage and after the last one, while the data directory is held.

    Returns
    -------
    list of StageSummary
        One a stage.

    Raises
    ------
    AerialDojoError
        A shard failed in an expected way; the others of its stage are finished first.
    KeyboardInterrupt
        Workers have ended; finished shards stay.
    """
    reporter = reporter or Reporter(quiet=True)
    forced = set(force)
    summaries = []
    for stage in stages:
        # All of it now: who edits a file while this runs has loaded the old one, and gets all made anew next time.
        stage_code(stage.name)
    carried = (roots.scene_assets, roots.recipes, roots.annotations)
    folders = Folders(on_disk(roots.data), carried, on_disk(roots.data), reporter.line)
    made = make_executor(executor, workers, address, folders)
    with data_lock(roots.data), Interrupts() as interrupts, made as pool:
        if prepare:
            prepare()
        for stage in stages:
            now = limits if limits and stage is stages[-1] else Limits()
            forced_now = stage.name in forced
            summary = _run_stage(stage, scenes, pipeline, roots, pool, forced_now, reporter, interrupts, now)
            interrupts.check()
            reporter.line(str(summary))
            summaries.append(summary)
        if finish:
            finish()
            interrupts.check()
    return summaries


def _run_stage(
    stage: Stage,
    scenes: Sequence[str],
    pipeline: Pipeline,
    roots: Roots,
    pool: Executor,
    force: bool,
    reporter: Reporter,
    interrupts: Interrupts,
    limits: Limits,
) -> StageSummary:
    started = time.monotonic()
    section = pipeline.section(stage.name)
    # What takes time to decide is not decided anew as long as nothing is to be computed.
    choices = [] if force else stage.choices(section)
    lots = (shards_of(stage, c, scenes, pipeline, roots, force, Reporter(quiet=True), limits) for c in choices)
    lot = next((lot for lot in lots if lot.all_fresh), None)
    if lot is None:
        config = stage.settle(section, reporter.line)
        lot = shards_of(stage, config, scenes, pipeline, roots, force, reporter, limits)
        if lot.tasks:
            stage.check(roots.data, scenes, config)
    tasks, fresh, errors = lot.tasks, lot.fresh, lot.errors
    done = []
    with reporter.bar(stage.name, len(tasks)) as bar:
        for outcome in pool.map(compute, tasks, lambda task: task.scene, memory_mb=stage.memory_mb):
            interrupts.check()
            if isinstance(outcome, BudgetSpent):
                continue
            if isinstance(outcome, AerialDojoError):
                errors.append(outcome)
                bar.advance()
            else:
                done.append(outcome)
                bar.advance(frames=outcome["counts"].get("frames", 0))
    if errors:
        raise _together(errors)
    counts: Counter[str] = Counter()
    for summary in (*fresh, *done):
        counts.update(summary["counts"])
    every = (*fresh, *done)
    if len(done) < len(tasks):
        left = f"{len(tasks) - len(done):,} of {len(tasks):,} shards are left"
        reporter.line(f"{stage.name}: the budget is spent, {left}; the same command goes on from here")
    return StageSummary(
        stage.name,
        sum(s["rows_in"] for s in every),
        sum(s["rows_out"] for s in every),
        counts,
        len(every),
        len(done),
        time.monotonic() - started,
    )


def _together(errors: Sequence[AerialDojoError]) -> AerialDojoError:
    """Make one error of several, of the first one's kind, that lists them all."""
    messages = list(dict.fromkeys(str(error) for error in errors))
    return type(errors[0])("\n".join(messages))


def known_scenes(recipes: Path) -> list[str]:
    """List the scenes that have a recipe, by name."""
    return sorted(path.stem for path in recipes.glob("*.toml"))


def choose_scenes(patterns: Sequence[str], known: Sequence[str]) -> list[str]:
    """Resolve names and globs to scenes, in the order of `known`.

    Raises
    ------
    UsageError
        A pattern matches nothing; the message gives the nearest names.
    """
    if not known:
        raise UsageError("there are no scenes: the folder of recipes is empty")
    chosen = set()
    for pattern in patterns:
        matches = fnmatch.filter(known, pattern)
        if not matches:
            folded = {name.lower(): name for name in known}
            near = difflib.get_close_matches(pattern.lower(), list(folded), n=3, cutoff=0.3)
            names = ", ".join(folded[n] for n in near) or ", ".join(known[:5])
            raise UsageError(f"no scene {pattern!r}; nearest: {names}")
        chosen.update(matches)
    return [name for name in known if name in chosen]


def stages_named(names: Sequence[str] | None) -> list[Stage]:
    """Return the stages of these names in pipeline order; all of them for None.

    Raises
    ------
    UsageError
        A name is unknown.
    """
    if names is None:
        return list(STAGES)
    unknown = set(names) - {stage.name for stage in STAGES}
    if unknown:
        known = ", ".join(stage.name for stage in STAGES)
        raise UsageError(f"unknown stage {sorted(unknown)[0]!r}; stages: {known}")
    return [stage for stage in STAGES if stage.name in names]
