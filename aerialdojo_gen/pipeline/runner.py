"""Run stages.

A shard is computed if and only if its fingerprint is out of date. So a killed run resumes where it stopped, and the
tables do not depend on the number of workers, their order, or kills.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.errors import AerialDojoError, AssetError, BudgetSpent, UsageError
from aerialdojo_gen.base.names import choose_scenes, unknown
from aerialdojo_gen.pipeline.code_digest import stage_code
from aerialdojo_gen.pipeline.executors.base import Executor, SharedPaths, make_executor, on_disk
from aerialdojo_gen.pipeline.freshness import ShardFinder
from aerialdojo_gen.pipeline.interrupt import Interrupts
from aerialdojo_gen.pipeline.options import RunLimits, RunOptions
from aerialdojo_gen.pipeline.progress import Reporter, duration
from aerialdojo_gen.pipeline.registry import BY_NAME, STAGES, upstream
from aerialdojo_gen.pipeline.scheduler import RuntimeEstimate, SceneScheduler
from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
from aerialdojo_gen.pipeline.task import Computed, StageSummary, compute
from aerialdojo_gen.store import shards as store

_PACKAGE = Path(__file__).resolve().parents[1]


def run(
    stages: Sequence[Stage],
    scenes: Sequence[str],
    pipeline: Pipeline,
    roots: ProjectPaths,
    *,
    options: RunOptions | None = None,
    reporter: Reporter | None = None,
    prepare: Callable[[], None] | None = None,
    finish: Callable[[], None] | None = None,
) -> list[StageSummary]:
    """Run stages in order on scenes that lack no input from their author (`scenes_missing_input`)."""
    options, reporter = options or RunOptions(workers=1), reporter or Reporter(quiet=True)
    started = time.monotonic()
    summaries: list[StageSummary] = []
    for stage in stages:
        # Digest all code now, as loaded: edits during the run make the shards stale next time.
        stage_code(stage.name)
    sources = (roots.scene_assets, roots.recipes, roots.annotations)
    folders = SharedPaths(on_disk(roots.data), sources, on_disk(roots.data), reporter.line)
    executor_of_run = make_executor(options.executor, options.workers, options.address, folders)
    with roots.data.lock(), Interrupts() as interrupts, executor_of_run as pool:
        if prepare:
            prepare()
        estimate = RuntimeEstimate(stages, scenes, roots)
        for group in group_stages(stages, alone=options.limits is not None):
            # Other processes may have written.
            roots.data.refresh()
            limits = options.limits if options.limits and group[-1] is stages[-1] else RunLimits()
            finder = ShardFinder(pipeline, roots, scenes, reporter, options.force, limits)
            scheduler = SceneScheduler(group, finder, estimate)
            busy = [stage.name for stage in group if any(estimate.left(stage.name, scene) for scene in scenes)]
            if scheduler and (cold := uncompiled(busy)):
                reporter.line(f"compiling {', '.join(cold)} to machine code, once: up to two minutes of CPU time")
            summaries += _run_group(scheduler, pool, reporter, interrupts, stages[-1].name)
            interrupts.check()
        if finish:
            roots.data.refresh()
            finish()
            interrupts.check()
    if len(stages) > 1:
        reporter.line(_totals_line(summaries, time.monotonic() - started))
    return summaries


def uncompiled(stages: Sequence[str]) -> list[str]:
    """Name the stages of which fewer than half of the Numba modules are compiled."""
    from aerialdojo_gen.base.kernel_cache import kernel_folder

    def compiled(stage: str) -> list[bool]:
        files = (_PACKAGE.parent.joinpath(*part.split(".")).with_suffix(".py") for part in stage_code(stage).parts)
        kernels = [file for file in files if file.is_file() and b"base.kernels import njit" in file.read_bytes()]
        return [any(kernel_folder(file).glob("*.nbi")) for file in kernels]

    return [stage for stage in stages if 2 * sum(found := compiled(stage)) < len(found)]


def _totals_line(summaries: Sequence[StageSummary], seconds: float) -> str:
    """Summarise a run in a line."""
    idle = sum(not summary.computed for summary in summaries)
    if idle == len(summaries):
        return f"nothing to do: all {idle} stages are up to date ({duration(seconds)})"
    idle_note = f"; {idle} of {len(summaries)} stages had nothing to do" if idle else ""
    return f"{sum(s.computed for s in summaries):,} shards computed in {duration(seconds)}{idle_note}"


def group_stages(stages: Sequence[Stage], *, alone: bool = False) -> list[list[Stage]]:
    """Group stages between barriers: within a group scenes advance independently."""
    groups: list[list[Stage]] = []
    for stage in stages:
        if not groups or stage.barrier or (alone and stage is stages[-1]):
            groups.append([])
        groups[-1].append(stage)
    return groups


def _run_group(
    scheduler: SceneScheduler, pool: Executor, reporter: Reporter, interrupts: Interrupts, requested: str
) -> list[StageSummary]:
    """Run a group of stages, and report the summaries."""
    summaries: list[StageSummary] = []

    def report() -> None:
        for summary in scheduler.summaries():
            # The requested stage always has a line, upstream stages only if they computed something.
            if summary.computed or reporter.verbose or summary.stage == requested:
                reporter.line(str(summary))
            summaries.append(summary)

    report()
    with (
        reporter.bar(scheduler.only_stage, len(scheduler))
        if scheduler.only_stage
        else reporter.overall(scheduler.overview) as bar
    ):
        scheduler.on_start = bar.refresh
        for outcome in pool.run(compute, scheduler):
            interrupts.check()
            report()
            if isinstance(outcome, Computed):
                bar.advance(frames=outcome.summary["counts"].get("frames", 0))
            elif not isinstance(outcome, BudgetSpent):
                bar.advance()
    if scheduler.errors:
        raise _combine(scheduler.errors)
    return summaries


def scenes_missing_input(stages: Sequence[Stage], scenes: Sequence[str], roots: ProjectPaths) -> dict[str, str]:
    """Return the scenes that lack an input from their author, e.g. annotations, each with the reason."""
    before = {each.name: each for stage in stages for each in upstream(stage.name)}
    inputs = {table for stage in stages for table in stage.reads} - {t for stage in stages for t in stage.writes}

    def missing(scene: str) -> str:
        why = next(filter(None, (stage.missing_input(roots, scene) for stage in stages)), "")
        earlier = next(filter(None, (stage.missing_input(roots, scene) for stage in before.values())), "")
        # Tables from an earlier run, or from an imported release, suffice.
        complete = why or not earlier or all(store.shards(roots.data, table, scene) for table in inputs)
        return why if complete else earlier

    why = {scene: missing(scene) for scene in scenes}
    left_out = {scene: line for scene, line in why.items() if line}
    if left_out and len(left_out) == len(why):
        raise _combine([AssetError(line) for line in left_out.values()])
    return left_out


def _combine(errors: Sequence[AerialDojoError]) -> AerialDojoError:
    """Combine errors into one of the first one's type that lists all messages."""
    messages = list(dict.fromkeys(str(error) for error in errors))
    return type(errors[0])("\n".join(messages))


def known_scenes(recipes: Path) -> list[str]:
    """List the scenes that have a recipe, by name."""
    return sorted(path.stem for path in recipes.glob("*.toml"))


def chosen_scenes(pipeline: Pipeline, roots: ProjectPaths, patterns: Sequence[str] | None = None) -> list[str]:
    """Resolve names and globs to scenes with a recipe; default: the pipeline's scenes."""
    return choose_scenes(patterns or pipeline.scenes, known_scenes(roots.recipes))


def stages_named(names: Sequence[str] | None) -> list[Stage]:
    """Return the stages of these names in pipeline order; all of them for None."""
    for name in names or ():
        if name not in BY_NAME:
            raise UsageError(unknown("no stage", name, BY_NAME))
    return [stage for stage in STAGES if names is None or stage.name in names]
