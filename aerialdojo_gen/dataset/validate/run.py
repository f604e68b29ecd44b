"""Run all checks over a release, scene by scene, in one or several processes."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.base.names import choose_scenes
from aerialdojo_gen.dataset.contents import part_name, scenes_in_release
from aerialdojo_gen.dataset.validate.counts import SceneCounts, count_scene, scene_counts, whole_counts
from aerialdojo_gen.dataset.validate.parts import Release, foreign_files, read_tables, release_of
from aerialdojo_gen.dataset.validate.registry import CHECKS, TABLES, Outcome, ordered, run_checks
from aerialdojo_gen.dataset.validate.report import Report
from aerialdojo_gen.dataset.validate.rows import SceneData
from aerialdojo_gen.pipeline.executors.base import SharedPaths, make_executor, on_disk
from aerialdojo_gen.pipeline.interrupt import Interrupts
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store.root import Where

# Assumed memory per process, megabytes.
MEMORY_MB = 1700
# Every module of this folder registers its checks.
for _module in pkgutil.iter_modules([str(Path(__file__).parent)]):
    importlib.import_module(f"{__package__}.{_module.name}")
SCENE_CHECKS = ordered(CHECKS)


@dataclass(frozen=True)
class ValidationOptions:
    """What to check."""

    release: Release | Where  # The data root, or the release's own folder
    scenes: tuple[str, ...] = ()  # Names or globs; empty for all
    meshes: Path | None = None
    use_meshes: bool = True  # False skips checks that need a mesh
    sample: int | None = None  # Routes a scene that FCL checks; None for all
    pictures: int | None = None  # Reference images a scene that are rendered again; None for all
    pipeline: Pipeline = field(default_factory=Pipeline)  # Defines the rules that the release is checked against


@dataclass(frozen=True)
class _Work:
    options: ValidationOptions
    scene: str

    @property
    def label(self) -> str:
        return f"validate {self.scene}"

    def moved(self, place: Callable[[Path], Path]) -> _Work:
        """Return the same work for a machine where the props lie elsewhere."""
        pipeline = self.options.pipeline
        if pipeline.scene_assets is None:
            return self
        pipeline = pipeline.model_copy(update={"scene_assets": place(pipeline.scene_assets)})
        return replace(self, options=replace(self.options, pipeline=pipeline))


def validate(
    options: ValidationOptions,
    *,
    workers: int | None = 1,
    executor: str = "local",
    address: str | None = None,
    reporter: Reporter | None = None,
) -> Report:
    """Check a release."""
    reporter = reporter or Reporter(quiet=True)
    release = release_of(options.release)
    options = replace(options, release=release)
    every = scenes_in_release(release.root, folder=release.folder)
    chosen = choose_scenes(options.scenes, every)
    by_scene: dict[str, tuple[list[Outcome], SceneCounts]] = {}
    shared = on_disk(release.root, *([options.meshes] if options.meshes else []))
    assets = options.pipeline.scene_assets
    executor_of_run = make_executor(
        executor, workers, address, SharedPaths(shared, (assets,) if assets else (), (), reporter.line)
    )
    work = [_Work(options, scene) for scene in _large_first(release, chosen)]
    with Interrupts() as interrupts, executor_of_run as pool, reporter.bar("validate", len(chosen)) as bar:
        for done in pool.map(_check, work, memory_mb=MEMORY_MB):
            interrupts.check()
            if isinstance(done, AerialDojoError):
                raise done
            by_scene[done[1].scene] = done
            bar.advance()
    outcomes = [foreign_files(release, every)]
    outcomes += [outcome for scene in chosen for outcome in by_scene[scene][0]]
    totals = [by_scene[scene][1] for scene in chosen]
    outcomes += whole_counts(release, totals, options.pipeline, len(chosen) == len(every))
    return Report(tuple(chosen), tuple(outcomes))


def _check(work: _Work) -> tuple[list[Outcome], SceneCounts]:
    options, scene = work.options, work.scene
    release = release_of(options.release)
    found, outcomes = read_tables(release, scene)
    data = SceneData(scene, release, options.pipeline, found, options.meshes, options.use_meshes, options.sample,
                     options.pictures)  # fmt: skip
    counts = count_scene(data, len(found) == len(TABLES))
    outcomes += run_checks(data, SCENE_CHECKS)
    outcomes.append(scene_counts(data, counts))
    return outcomes, counts


def _large_first(release: Release, scenes: Sequence[str]) -> list[str]:
    """Order scenes by size, the largest first, to balance the processes."""

    def size(scene: str) -> int:
        names = [part_name(key, scene, release.folder) for key in ("routes/train", "routes/test")]
        return sum(release.root.size(name) for name in names if release.root.exists(name))

    return sorted(scenes, key=lambda scene: (-size(scene), scene))
