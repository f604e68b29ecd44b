"""Run a whole pipeline, or stages with what they need upstream, from sources to the release.

Nothing heavy is imported before something runs: the command line imports this for its ``--help`` too.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterable, Sequence
from dataclasses import replace as replaced
from pathlib import Path
from typing import TYPE_CHECKING

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.cli_context import PROGRAM
from aerialdojo_gen.base.errors import AssetError, ConfigError, UsageError
from aerialdojo_gen.base.shipped import home

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.pipeline import Pipeline
    from aerialdojo_gen.pipeline.options import RunOptions
    from aerialdojo_gen.pipeline.progress import Reporter
    from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
    from aerialdojo_gen.pipeline.task import StageSummary
    from aerialdojo_gen.store.root import DataRoot


from dataclasses import dataclass
from typing import TYPE_CHECKING

from aerialdojo_gen.base.text_table import Column, TextTable

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.pipeline import Pipeline
    from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
    from aerialdojo_gen.store.root import DataRoot


log = logging.getLogger(__name__)

DEFAULT_PIPELINE = "aerialdojo-200k.toml"
_NAMED = 3  # Scenes that are to be made, by name in a table


def run_pipeline(
    pipeline: str | Path | Pipeline | None = None,
    data: str | Path | DataRoot = "data",
    *,
    stages: Sequence[str] | None = None,
    scenes: Sequence[str] | None = None,
    workers: int | None = None,
    executor: str = "local",
    address: str | None = None,
    force: Iterable[str] = (),
    replace: bool = False,
    reporter: Reporter | None = None,
) -> list[StageSummary]:
    """Bring the tables of a pipeline up to date; the twin of ``aerialdojo-gen run`` and of the stages' commands.

    Parameters
    ----------
    pipeline : str, Path or Pipeline, optional
        A TOML file, the name of one that comes with the program (``"smoke"``), or what
        `aerialdojo_gen.base.config.pipeline.load_pipeline` read of one; where absent that of the release in the data
        directory, else the paper's.
    data : str, Path or DataRoot
        The data directory.
    stages : sequence of str, optional
        Stages to run, each with what it needs upstream, e.g. ``["plan"]``; the pipeline's own where absent.
    scenes : sequence of str, optional
        Names or globs; the pipeline's own where absent.
    workers : int, optional
        Processes; all cores where absent. With 1 everything runs in this one.
    executor : str
        ``"local"`` or ``"ray"``.
    address : str, optional
        ``HOST:PORT`` of a Ray cluster; one on this machine where absent.
    force : iterable of str
        Stages whose shards are computed even where they are fresh.
    replace : bool
        Whether scenes of the release that another pipeline made may be lost.
    reporter : Reporter, optional
        Shows progress and summaries; nothing is shown where absent.

    Returns
    -------
    list of StageSummary
        One a stage, in their order: rows in and out, reasons, shards computed, seconds.

    Raises
    ------
    AerialDojoError
        An expected failure, in one line that names the thing and the mend; finished shards stay.
    """
    from aerialdojo_gen.pipeline.options import RunOptions
    from aerialdojo_gen.pipeline.registry import upstream
    from aerialdojo_gen.pipeline.runner import stages_named

    config, roots = open_pipeline(pipeline, data)
    if stages is None:
        chosen = stages_named(config.stages)
    else:
        needed = {stage.name for asked in stages_named(stages) for stage in upstream(asked.name)}
        chosen = stages_named([*needed])
    given = cli_context.current_context()
    given = replaced(given, pipeline=str(pipeline) if isinstance(pipeline, (str, Path)) else given.pipeline)
    given = replaced(given, data=str(data) if isinstance(data, (str, Path)) and str(data) != "data" else given.data)
    with cli_context.use_context(given):
        options = RunOptions(workers, executor, address, frozenset(force), replace)
        return run_stages(chosen, config, roots, scenes, options=options, reporter=reporter)


def pipeline_file(given: str | Path | None = None) -> Path:
    """Find a pipeline's file: as a path, else by its name among those that come with the program."""
    shipped = home() / "pipelines"
    path = Path(given) if given else shipped / DEFAULT_PIPELINE
    if path.is_file():
        return path
    if path.parent == Path() and (named := shipped / f"{path.name.removesuffix('.toml')}.toml").is_file():
        return named
    known = sorted(file.stem for file in shipped.glob("*.toml"))
    beside = sorted(file.name for file in path.parent.glob("*.toml")) if path.parent.is_dir() else []
    there = f"; there are {', '.join(beside)} in {path.parent}" if beside and path.parent != Path() else ""
    raise ConfigError(f"no pipeline file {path}{there}; by name, as in {PROGRAM} run smoke: {', '.join(known)}")


def release_pipeline(data: DataRoot, folder: str = "release", *, reads: bool = False) -> Path | None:
    """Find the file of a release's pipeline, shipped or beside the data directory; None if there is no release."""
    from aerialdojo_gen.base.safe_parse import read_toml
    from aerialdojo_gen.dataset.provenance import pipeline_names
    from aerialdojo_gen.store.root import LocalRoot

    names = pipeline_names(data, folder)
    if len(names) > 1:
        raise UsageError(
            f"the release in {data} was made by pipelines {' and '.join(names)}: choose by --pipeline NAME"
        )
    for name in names:
        shipped = home() / "pipelines" / f"{name}.toml"
        if shipped.is_file():
            return shipped
        for file in sorted(data.path.parent.glob("*.toml")) if isinstance(data, LocalRoot) else ():
            with contextlib.suppress(ConfigError, OSError):
                if read_toml(file, ConfigError, finite=False).get("name") == name:
                    return file
        if not reads:
            raise UsageError(f"the release in {data} was made by pipeline {name!r}: give its file, --pipeline FILE")
    return None


def open_pipeline(
    pipeline: str | Path | Pipeline | None, data: str | Path | DataRoot, *, reads: bool = False
) -> tuple[Pipeline, ProjectPaths]:
    """Read the pipeline file (None: the release's, else the paper's) and find the folders; `reads`: write nothing."""
    from aerialdojo_gen.base.config.pipeline import Pipeline, load_pipeline
    from aerialdojo_gen.pipeline.stage import ProjectPaths
    from aerialdojo_gen.store.root import open_root

    data = open_root(data)
    if pipeline is None:
        pipeline = release_pipeline(data, reads=reads)
    if not isinstance(pipeline, Pipeline):
        pipeline = load_pipeline(pipeline_file(pipeline))
    roots = ProjectPaths(
        data=data,
        scene_assets=(assets := pipeline.scene_assets or home() / "scene_assets"),
        recipes=pipeline.recipes or assets / "scenes",
        annotations=pipeline.annotations or home() / "annotations",
    )
    for key, folder in (("scene_assets", roots.scene_assets), ("recipes", roots.recipes)):
        if not folder.is_dir():
            raise ConfigError(f"no folder {folder}: set {key} in the pipeline file")
    return pipeline, roots


def run_stages(
    stages: Sequence[Stage],
    config: Pipeline,
    roots: ProjectPaths,
    scenes: Sequence[str] | None = None,
    *,
    options: RunOptions | None = None,
    reporter: Reporter | None = None,
) -> list[StageSummary]:
    """Run exactly these stages over the chosen scenes; after `split`, bring card and croissant.json up to date."""
    # A scene without annotations is left out, with a warning that names the mend; the others are finished.
    from aerialdojo_gen.dataset.provenance import check_replaced
    from aerialdojo_gen.pipeline import runner
    from aerialdojo_gen.pipeline.options import RunOptions
    from aerialdojo_gen.pipeline.progress import Reporter

    options, reporter = options or RunOptions(), reporter or Reporter(quiet=True)
    names = runner.chosen_scenes(config, roots, scenes)
    releases = any(stage.name == "split" for stage in stages)
    left_out = runner.scenes_missing_input(stages, names, roots)
    for line in left_out.values():
        log.warning("left out: %s", line)
    ready = [name for name in names if name not in left_out]

    def prepare() -> None:
        if releases and not options.replace:
            check_replaced(roots.data, config, names, whole=not scenes)

    def finish() -> None:
        if releases:
            _finish_release(config, roots.data, names, ready, not scenes, reporter)

    summaries = runner.run(
        stages, ready, config, roots, options=options, reporter=reporter, prepare=prepare, finish=finish,
    )  # fmt: skip
    exact = config.split.paper_counts or config.annotate_import.paper_counts
    owed = [line for name, line in left_out.items() if exact or name in (scenes or config.scenes)]
    if owed:
        raise AssetError("\n".join([*owed, "the other scenes are finished"]))
    return summaries


def _finish_release(
    config: Pipeline, data: DataRoot, scenes: list[str], released: list[str], whole: bool, reporter: Reporter
) -> None:
    """Bring what stands beside the tables of a release up to date with them."""
    from aerialdojo_gen.dataset.contents import CARD, CROISSANT, existing_files, prune_release
    from aerialdojo_gen.dataset.protocol import SAMPLE, write_sample
    from aerialdojo_gen.dataset.provenance import RECORD, record_makers
    from aerialdojo_gen.store.cache import cache_text, is_cached, memo_key

    if whole:
        # The whole pipeline was asked for: the release holds its scenes and no others.
        for gone in prune_release(data, scenes):
            reporter.line(f"release: {gone} is no scene of this pipeline, removed")
    record_makers(data, config, released)

    def as_it_is() -> str:
        return memo_key(data, [*existing_files(data), RECORD, SAMPLE, CARD, CROISSANT], "documents")

    if not is_cached(as_it_is()):
        from aerialdojo_gen.dataset.card import write_card
        from aerialdojo_gen.dataset.croissant import write_croissant

        write_sample(data)
        write_croissant(data)
        write_card(data)
        cache_text(as_it_is())
    reporter.line(f"release: {data.at('release')}")


def default_workers() -> int:
    """Count the cores that this process may use."""
    from aerialdojo_gen.pipeline.executors.local import own_cores

    return own_cores()


@dataclass(frozen=True)
class StageStatus:
    """A stage's scenes by the state of their tables."""

    stage: str  # Name of the stage
    fresh: tuple[str, ...] = ()  # Scenes whose tables a run would keep, if their inputs stay as they are
    stale: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()  # Scenes without a table of this stage


def pipeline_status(
    pipeline: str | Path | Pipeline | None = None,
    data: str | Path | DataRoot = "data",
    *,
    scenes: Sequence[str] | None = None,
) -> list[StageStatus]:
    """Say which scenes of each stage are fresh, stale or missing; the twin of ``aerialdojo-gen status``.

    A stage after a stale one may become stale by it: each is compared with its inputs as they are now.
    """
    from aerialdojo_gen.dataset.build import open_pipeline
    from aerialdojo_gen.pipeline.runner import chosen_scenes, stages_named

    config, roots = open_pipeline(pipeline, data)
    names = chosen_scenes(config, roots, scenes)
    return [_status(stage, names, config, roots) for stage in stages_named(config.stages)]


def _status(stage: Stage, scenes: Sequence[str], pipeline: Pipeline, roots: ProjectPaths) -> StageStatus:
    from aerialdojo_gen.pipeline.freshness import is_fresh
    from aerialdojo_gen.store import shards as store

    missing = [s for s in scenes if not any(store.shards(roots.data, table, s) for table in stage.writes)]
    made = [scene for scene in scenes if scene not in missing]
    section = pipeline.section(stage.name)
    # A run uses one of these choices for all scenes; the best is counted.
    choices = stage.choices(section) or [stage.resolve_config(section, lambda _: None)]
    fresh = max(([s for s in made if is_fresh(stage, choice, s, pipeline, roots)] for choice in choices), key=len)
    return StageStatus(stage.name, tuple(fresh), tuple(s for s in made if s not in fresh), tuple(missing))


def status_table(found: Sequence[StageStatus]) -> TextTable:
    """Make the table that `status` prints."""
    columns = [Column("fresh"), Column("stale"), Column("missing"), Column("to be made", words=True)]
    rows = []
    for one in found:
        due = one.stale + one.missing
        named = ", ".join(due[:_NAMED]) + (f" and {len(due) - _NAMED} more" if len(due) > _NAMED else "")
        rows.append((one.stage, [*(str(len(part)) for part in (one.fresh, one.stale, one.missing)), named]))
    return TextTable("stage", columns, rows)
