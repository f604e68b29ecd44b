"""`render`: four RGB-D views along trajectories of the release (paper: sensors, recordings)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aerialdojo_gen.pipeline.stage import Job, Output, Stage
from aerialdojo_gen.rendering.resolve_config import idle_renderers, renderer_choices, settle_renderer

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import RenderConfig
    from aerialdojo_gen.store.root import DataRoot


def run(job: Job, config: RenderConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.render.run`."""
    from aerialdojo_gen.pipeline.stages.work import render

    return render.run(job, config)


def parts(data: DataRoot, scene: str, config: RenderConfig) -> int:
    """Count the shards of a scene: `trajectories_per_part` recordings each."""
    from aerialdojo_gen.rendering.sample import n_parts

    return n_parts(data, scene, config)


STAGE = Stage(
    "render",
    "Record four RGB-D views along trajectories of the release.",
    reads=("scenes", "routes/train", "routes/test"),
    writes=("recordings", "frames"),
    run=run,
    parts=parts,
    resolve_config=settle_renderer,
    choices=renderer_choices,
    idle=idle_renderers,
    digests=("recordings", "path", "sha256"),
    seconds=(10.0, 0.0),
    barrier=True,
)
