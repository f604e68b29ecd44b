"""`pair-objects`: candidate tasks, every start anchor with every other object's selected anchor (paper: pairs)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aerialdojo_gen.pipeline.stage import Job, Output, Stage

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import PairObjectsConfig


def run(job: Job, config: PairObjectsConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.pair_objects.run`."""
    from aerialdojo_gen.pipeline.stages.work import pair_objects

    return pair_objects.run(job, config)


STAGE = Stage(
    "pair-objects",
    "Pair start anchors with targets: the candidate tasks.",
    reads=("scenes", "objects", "anchors"),
    writes=("pairs",),
    run=run,
    seconds=(0.1, 0.005),
)
