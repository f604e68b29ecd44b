"""`reference-images`: the picture of every object from its selected anchor, for image goals."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aerialdojo_gen.pipeline.stage import Job, Output, Stage
from aerialdojo_gen.rendering.resolve_config import idle_renderers, renderer_choices, settle_renderer

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import ReferenceImagesConfig


def run(job: Job, config: ReferenceImagesConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.reference_images.run`."""
    from aerialdojo_gen.pipeline.stages.work import reference_images

    return reference_images.run(job, config)


STAGE = Stage(
    "reference-images",
    "Render each object's picture from its selected anchor.",
    reads=("scenes", "objects", "anchors"),
    writes=("references",),
    run=run,
    resolve_config=settle_renderer,
    choices=renderer_choices,
    idle=idle_renderers,
    seconds=(1.0, 0.1),
)
