"""The stages, in their order."""

from __future__ import annotations

from collections.abc import Iterator

from aerialdojo_gen.pipeline.stage import Stage
from aerialdojo_gen.pipeline.stages import (
    anchor_sample,
    annotate_import,
    build_scenes,
    filter,
    pair_objects,
    plan,
    reference_images,
    render,
    split,
)

STAGES: tuple[Stage, ...] = (
    build_scenes.STAGE,
    annotate_import.STAGE,
    anchor_sample.STAGE,
    reference_images.STAGE,
    pair_objects.STAGE,
    plan.STAGE,
    filter.STAGE,
    split.STAGE,
    render.STAGE,
)

BY_NAME = {stage.name: stage for stage in STAGES}


def upstream(name: str) -> Iterator[Stage]:
    """Yield the stages that `name` needs, in order, and then the stage itself."""
    needed = {name}
    tables: set[str] = set()
    for stage in reversed(STAGES):
        if stage.name in needed or tables & set(stage.writes):
            needed.add(stage.name)
            tables |= set(stage.reads)
    yield from (stage for stage in STAGES if stage.name in needed)
