"""Run stages: take each scene through them in one process, as far as scenes need not wait for one another.

A shard with the right fingerprint is never computed again, one with a wrong one always is; so a killed run goes on
where it stopped, and the tables do not depend on the number of workers, their order, or the kills.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.errors import AerialDojoError, AssetError, BudgetSpent, UsageError
from aerialdojo_gen.base.names import choose_scenes, unknown
from aerialdojo_gen.pipeline.chain import SceneScheduler
from aerialdojo_gen.pipeline.code_digest import stage_code
from aerialdojo_gen.pipeline.executors import Executor, SharedPaths, make_executor, on_disk
from aerialdojo_gen.pipeline.expectation import RuntimeEstimate
from aerialdojo_gen.pipeline.freshness import Limits, look_ahead
from aerialdojo_gen.pipeline.interrupt import Interrupts
from aerialdojo_gen.pipeline.progress import Reporter, duration
from aerialdojo_gen.pipeline.registry import STAGES, upstream
from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
from aerialdojo_gen.pipeline.summary import StageSummary
from aerialdojo_gen.pipeline.task import Computed, compute
from aerialdojo_gen.store import shards as store

_PACKAGE = Path(__file__).resolve().parents[1]


def run(
    stages: Sequence[Stage],
    scenes: Sequence[str],
    pipeline: Pipeline,
    roots: ProjectPaths,
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
    """Run stages in their order on the scenes that are ready for them."""
    reporter = reporter or Reporter(quiet=True)
    forced, started = set(force), time.monotonic()
    summaries: list[StageSummary] = []
    for first in stages[:1]:
        if first.name not in forced:
            look_ahead(first, scenes, roots)
    for stage in stages:
        # All of it now: who edits a file while this runs has loaded the old one, and gets all made anew next time.
        stage_code(stage.name)
    carried = (roots.scene_assets, roots.recipes, roots.annotations)
    folders = SharedPaths(on_disk(roots.data), carried, on_disk(roots.data), reporter.line)
    left_out = scenes_missing_input(stages, scenes, roots)
    scenes = [scene for scene in scenes if scene not in left_out]
    made = make_executor(executor, workers, address, folders)
    with roots.data.lock(), Interrupts() as interrupts, made as pool:
        if prepare:
            prepare()
        expectation = RuntimeEstimate(stages, scenes, roots)
        for group in chained(stages, alone=limits is not None):
            # What the stages before wrote, in whatever process, is to be found.
            roots.data.refresh()
            now = limits if limits and group[-1] is stages[-1] else Limits()
            chain = SceneScheduler(group, scenes, pipeline, roots, forced, now, reporter, expectation)
            busy = [stage.name for stage in group if any(expectation.left(stage.name, scene) for scene in scenes)]
            if chain and (cold := uncompiled(busy)):
                reporter.line(f"compiling {', '.join(cold)} to machine code, once: up to two minutes of CPU time")
            summaries += _go_through(chain, pool, reporter, interrupts, stages[-1].name)
            interrupts.check()
        if finish:
            roots.data.refresh()
            finish()
            interrupts.check()
    if len(stages) > 1:
        reporter.line(_altogether(summaries, time.monotonic() - started))
    return summaries


def uncompiled(stages: Sequence[str]) -> list[str]:
    """Name the stages that have machine code for less than half of their modules with kernels."""
    from aerialdojo_gen.base.kernel_cache import kernel_folder

    def compiled(stage: str) -> list[bool]:
        files = (_PACKAGE.parent.joinpath(*part.split(".")).with_suffix(".py") for part in stage_code(stage).parts)
        kernels = [file for file in files if file.is_file() and b"common.kernels import njit" in file.read_bytes()]
        return [any(kernel_folder(file).glob("*.nbi")) for file in kernels]

    return [stage for stage in stages if 2 * sum(found := compiled(stage)) < len(found)]


def _altogether(summaries: Sequence[StageSummary], seconds: float) -> str:
    """Say what stages did together, those that had nothing to do among them."""
    idle = sum(not summary.computed for summary in summaries)
    if idle == len(summaries):
        return f"nothing to do: all {idle} stages are up to date ({duration(seconds)})"
    besides = f"; {idle} of {len(summaries)} stages had nothing to do" if idle else ""
    return f"{sum(s.computed for s in summaries):,} shards computed in {duration(seconds)}{besides}"


def chained(stages: Sequence[Stage], *, alone: bool = False) -> list[list[Stage]]:
    """Group stages that a scene goes through at its own pace; all scenes wait for one another before each group."""
    groups: list[list[Stage]] = []
    for stage in stages:
        if not groups or stage.waits or (alone and stage is stages[-1]):
            groups.append([])
        groups[-1].append(stage)
    return groups


def _go_through(
    chain: SceneScheduler, pool: Executor, reporter: Reporter, interrupts: Interrupts, asked: str
) -> list[StageSummary]:
    """Take scenes through stages, and say what was done."""
    summaries: list[StageSummary] = []

    def say() -> None:
        for summary in chain.summaries():
            # What was asked for has its line in any case, what it builds on where there was something to do.
            if summary.computed or reporter.verbose or summary.stage == asked:
                reporter.line(str(summary))
            summaries.append(summary)

    say()
    with reporter.bar(chain.label, len(chain)) if chain.of_one_stage else reporter.overall(chain.look) as bar:
        chain.watched_by(bar.refresh)
        for outcome in pool.run(compute, chain, memory_mb=chain.memory_mb):
            interrupts.check()
            say()
            if isinstance(outcome, Computed):
                bar.advance(frames=outcome.summary["counts"].get("frames", 0))
            elif not isinstance(outcome, BudgetSpent):
                bar.advance()
    if chain.errors:
        raise _together(chain.errors)
    return summaries


def scenes_missing_input(stages: Sequence[Stage], scenes: Sequence[str], roots: ProjectPaths) -> dict[str, str]:
    """Find the scenes that stages leave out, as these or what they build on want something of its author first."""
    before = {each.name: each for stage in stages for each in upstream(stage.name)}
    inputs = {table for stage in stages for table in stage.reads} - {t for stage in stages for t in stage.writes}

    def wanting(scene: str) -> str:
        why = next(filter(None, (stage.missing_input(roots, scene) for stage in stages)), "")
        earlier = next(filter(None, (stage.missing_input(roots, scene) for stage in before.values())), "")
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


def chosen_scenes(pipeline: Pipeline, roots: ProjectPaths, patterns: Sequence[str] | None = None) -> list[str]:
    """Resolve names and globs to scenes with a recipe; the pipeline's own scenes where there are none."""
    return choose_scenes(patterns or pipeline.scenes, known_scenes(roots.recipes))


def stages_named(names: Sequence[str] | None) -> list[Stage]:
    """Return the stages of these names in pipeline order; all of them for None."""
    if names is None:
        return list(STAGES)
    known = [stage.name for stage in STAGES]
    for name in names:
        if name not in known:
            raise UsageError(unknown("no stage", name, known))
    return [stage for stage in STAGES if stage.name in names]
