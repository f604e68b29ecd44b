"""Run stages: find the stale shards, compute them in processes, commit each one whole.

A shard with the right fingerprint is never computed again, one with a wrong one always is; so a killed run goes on
where it stopped, and the tables do not depend on the number of workers, their order, or the kills.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aerialdojo_gen.common.names import choose_scenes, unknown
from aerialdojo_gen.common.trouble import check_memory
from aerialdojo_gen.config.pipeline import Pipeline
from aerialdojo_gen.errors import AerialDojoError, AssetError, BudgetSpent, UsageError
from aerialdojo_gen.pipeline.code_digest import stage_code
from aerialdojo_gen.pipeline.executors import Executor, Folders, make_executor, on_disk
from aerialdojo_gen.pipeline.freshness import Limits, shards_of
from aerialdojo_gen.pipeline.interrupt import Interrupts
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.pipeline.registry import STAGES, upstream
from aerialdojo_gen.pipeline.stage import Roots, Stage
from aerialdojo_gen.pipeline.task import compute
from aerialdojo_gen.store import shards as store


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
    """Run stages in their order on the scenes that are ready for them.

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
    left_out = unready(stages, scenes, roots)
    scenes = [scene for scene in scenes if scene not in left_out]
    made = make_executor(executor, workers, address, folders)
    with roots.data.lock(), Interrupts() as interrupts, made as pool:
        if prepare:
            prepare()
        for stage in stages:
            # What the stage before wrote, in whatever process, is to be found.
            roots.data.refresh()
            now = limits if limits and stage is stages[-1] else Limits()
            forced_now = stage.name in forced
            summary = _run_stage(stage, scenes, pipeline, roots, pool, forced_now, reporter, interrupts, now)
            interrupts.check()
            reporter.line(str(summary))
            summaries.append(summary)
        if finish:
            roots.data.refresh()
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
            check_memory(stage.memory_mb, stage.name)
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


def unready(stages: Sequence[Stage], scenes: Sequence[str], roots: Roots) -> dict[str, str]:
    """Find the scenes that stages leave out, as these or what they build on want something of its author first.

    Parameters
    ----------
    stages : sequence of Stage
        What is to run.
    scenes : sequence of str
        Names of the scenes.
    roots : Roots
        The folders.

    Returns
    -------
    dict of str to str
        Why, by scene, in a line that names the mend.

    Raises
    ------
    AssetError
        None of the scenes would be left.
    """
    before = {each.name: each for stage in stages for each in upstream(stage.name)}
    inputs = {table for stage in stages for table in stage.reads} - {t for stage in stages for t in stage.writes}

    def wanting(scene: str) -> str:
        why = next(filter(None, (stage.wants(roots, scene) for stage in stages)), "")
        earlier = next(filter(None, (stage.wants(roots, scene) for stage in before.values())), "")
        # What stages that do not run now made before, or a release brought along, is enough.
        made = why or not earlier or all(store.shards(roots.data, table, scene) for table in inputs)
        return why if made else earlier

    why = {scene: wanting(scene) for scene in scenes}
    left_out = {scene: line for scene, line in why.items() if line}
    if left_out and len(left_out) == len(why):
        raise _together([AssetError(line) for line in left_out.values()])
    return left_out


def _together(errors: Sequence[AerialDojoError]) -> AerialDojoError:
    """Make one error of several, of the first one's kind, that lists them all."""
    messages = list(dict.fromkeys(str(error) for error in errors))
    return type(errors[0])("\n".join(messages))


def known_scenes(recipes: Path) -> list[str]:
    """List the scenes that have a recipe, by name."""
    return sorted(path.stem for path in recipes.glob("*.toml"))


def chosen_scenes(pipeline: Pipeline, roots: Roots, patterns: Sequence[str] | None = None) -> list[str]:
    """Resolve names and globs to scenes with a recipe; the pipeline's own scenes where there are none.

    Raises
    ------
    UsageError
        A pattern matches nothing; the message gives the nearest names.
    """
    return choose_scenes(patterns or pipeline.scenes, known_scenes(roots.recipes))


def stages_named(names: Sequence[str] | None) -> list[Stage]:
    """Return the stages of these names in pipeline order; all of them for None.

    Raises
    ------
    UsageError
        A name is unknown.
    """
    if names is None:
        return list(STAGES)
    known = [stage.name for stage in STAGES]
    for name in names:
        if name not in known:
            raise UsageError(unknown("no stage", name, known))
    return [stage for stage in STAGES if stage.name in names]
