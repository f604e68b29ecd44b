"""Which of a pipeline's tables are fresh, stale or missing; nothing is computed or written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from aerialdojo_gen.base.text_table import Column, TextTable

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.pipeline import Pipeline
    from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
    from aerialdojo_gen.store.root import DataRoot


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
    rows = [
        (
            one.stage,
            [str(len(one.fresh)), str(len(one.stale)), str(len(one.missing)), _named(one.stale + one.missing)],
        )
        for one in found
    ]
    return TextTable("stage", columns, rows)


def _named(scenes: Sequence[str], most: int = 3) -> str:
    more = f" and {len(scenes) - most} more" if len(scenes) > most else ""
    return ", ".join(scenes[:most]) + more
