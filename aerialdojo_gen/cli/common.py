"""What several commands share: scenes by position and option, JSON, how a pipeline is opened and run.

Nothing heavy is imported before a command runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

import inspect
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.cli import options
from aerialdojo_gen.dataset.build import open_pipeline, run_stages
from aerialdojo_gen.pipeline.registry import BY_NAME

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.pipeline import Pipeline
    from aerialdojo_gen.benchmark.tasks import Selection
    from aerialdojo_gen.pipeline.options import RunLimits, RunOptions
    from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
    from aerialdojo_gen.scenes.model import Scene


def print_json(value: object) -> None:
    """Print JSON for ``--json``: without bytes, null for values that are not finite."""
    print(json_text(value))


def json_text(value: object) -> str:
    """Convert to the JSON values that `print_json` prints."""
    return json.dumps(_plain(value), ensure_ascii=False, indent=1, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items() if not isinstance(inner, bytes)}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def merge_scenes(scenes: list[str] | None, scene: list[str] | None) -> list[str] | None:
    """Join scenes that are given by position with those of ``--scene``; None where there is neither."""
    return [*(scenes or ()), *(scene or ())] or None


def selection(
    scenes: list[str] | None, split: Sequence[str] | None, setting: list[str] | None, modality: list[str] | None,
    protocol: str | None, limit: int | None, seed: int,
) -> Selection:  # fmt: skip
    """Make the selection of tasks that the options of `evaluate`, `fly` and `score` name."""
    from aerialdojo_gen.benchmark.tasks import Selection

    splits, settings, modalities, chosen = (tuple(names or ()) for names in (split, setting, modality, scenes))
    return Selection(splits, settings, modalities, chosen, limit, seed, protocol or "")


@contextmanager
def interruptible(left: str) -> Iterator[None]:
    """Say what Ctrl-C leaves, and end with 130: Typer turns it into a silent exit."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"interrupted: {left}", file=sys.stderr)
        raise SystemExit(130) from None


@dataclass(frozen=True)
class StageOptions:
    """The options that the command of every stage has."""

    scenes: options.Scenes = None
    data: options.Data = "data"
    scene: options.Scene = None
    pipeline: options.PipelineFile = None
    workers: options.Workers = None
    force: options.Force = False
    quiet: options.Quiet = False
    verbose: options.Verbose = False
    executor: options.ExecutorName = "local"
    address: options.Address = None

    @property
    def chosen(self) -> list[str] | None:
        """The scenes that are named, by position or by option."""
        return merge_scenes(self.scenes, self.scene)

    def run_until(
        self, stage: str, *, scenes: list[str] | None = None, replace: bool = False, limits: RunLimits | None = None,
        **overrides: object,
    ) -> None:  # fmt: skip
        """Bring a stage's tables up to date, running what it needs upstream, with other values of its section."""
        from aerialdojo_gen.base.config.pipeline import with_overrides
        from aerialdojo_gen.pipeline.options import RunOptions
        from aerialdojo_gen.pipeline.registry import upstream

        config, roots = open_pipeline(self.pipeline, self.data)
        config = with_overrides(config, stage, **overrides)
        forced = frozenset({stage} if self.force else ())
        how = RunOptions(self.workers, self.executor, self.address, forced, replace, limits)
        run_chosen(list(upstream(stage)), config, roots, scenes or self.chosen, how, self.quiet, self.verbose)


def stage_command(app: typer.Typer, stage: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a function as a stage's command, which gets `StageOptions` and options of its own."""

    def register(function: Callable[..., None]) -> Callable[..., None]:
        common = [*inspect.signature(StageOptions, eval_str=True).parameters.values()]
        own = [*inspect.signature(function, eval_str=True).parameters.values()][1:]

        def command(**given: Any) -> None:
            values = {one.name: given.pop(one.name) for one in own}
            function(StageOptions(**given), **values)

        # What Typer reads the options from.
        vars(command)["__signature__"] = inspect.Signature([*common[:-2], *own, *common[-2:]])
        app.command(stage, help=BY_NAME[stage].help)(command)
        return function

    return register


def run_chosen(
    stages: list[Stage],
    config: Pipeline,
    roots: ProjectPaths,
    scene: list[str] | None,
    options: RunOptions,
    quiet: bool,
    verbose: bool = False,
) -> None:
    """Run stages with progress (`aerialdojo_gen.dataset.build.run_stages`), and say what an error or Ctrl-C left."""
    from aerialdojo_gen.pipeline.progress import Reporter

    kept = "finished shards are kept, " + (
        "and --force computes them again" if options.force else "the same command continues from where it stopped"
    )
    reporter = Reporter(quiet=quiet, verbose=verbose)
    try:
        with interruptible(kept):
            run_stages(stages, config, roots, scene, options=options, reporter=reporter)
    except Exception as error:
        # A wrong option or pipeline file ended it before anything was computed.
        if not isinstance(error, UsageError):
            error.add_note(kept)
        raise


def print_next(scene: str | None, pipeline: Path, project: Path) -> None:
    """Say which commands make tasks in added scenes; `scene` is one whose annotations are drafted first."""
    if scene is not None:
        print(f"next: {cli_context.command('annotate-draft', scene, pipeline=pipeline)}")
    print(f"then: {cli_context.command('run', pipeline, data=project / 'data')}")


def print_scene(scene: Scene, notes: Sequence[str]) -> None:
    """Say what a scene that was added holds, and what was done to it."""
    size = scene.bounds[1] - scene.bounds[0]
    print(
        f"{scene.name}: {len(scene.instances):,} instances, {scene.n_triangles:,} triangles, "
        f"{size[0]:.0f} x {size[1]:.0f} m, ceiling {scene.ceiling_m:.0f} m"
    )
    for line in notes:
        print(f"  {line}")


def key_values(given: list[str]) -> dict[str, str]:
    """Read ``--option key=value``."""
    options = {}
    for item in given:
        key, equals, options[key] = item.partition("=")
        if not equals or not key.isidentifier():
            raise UsageError(f"--option {Secrets().text(item)[:60]!r}: write key=value")
    return options
