"""`anchor-sample`: viewpoints at 1 m from each object that see it (paper: anchors)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from aerialdojo_gen.pipeline.stage import Job, Output, Stage

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import AnchorSampleConfig


def run(job: Job, config: AnchorSampleConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.anchor_sample.run`."""
    from aerialdojo_gen.pipeline.stages.work import anchor_sample

    return anchor_sample.run(job, config)


def resolve_config(config: AnchorSampleConfig, _say: Callable[[str], None]) -> AnchorSampleConfig:
    """Put the digest of the CLIP model's files in the place of their names, where they are asked."""
    if config.clip is None or not config.weights.clip:
        return config
    from aerialdojo_gen.pipeline.scoring.clip import digest

    return config.model_copy(update={"clip": config.clip.model_copy(update={"sha256": digest(config.clip)})})


def idle(config: AnchorSampleConfig) -> tuple[str, ...]:
    """Name the scorers that are not asked."""
    return tuple(
        f"aerialdojo_gen.pipeline.scoring.{name}" for name in ("clip", "vlm") if not getattr(config.weights, name)
    )


STAGE = Stage(
    "anchor-sample",
    "Find viewpoints 1 m from each object that see it.",
    reads=("scenes", "objects", "chosen_anchors"),
    writes=("anchors", "viewpoints"),
    run=run,
    resolve_config=resolve_config,
    idle=idle,
    seconds=(1.0, 0.1),
)
