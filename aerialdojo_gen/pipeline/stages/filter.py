"""`filter`: which candidates become tasks, and a stable reason for every other one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aerialdojo_gen.pipeline.stage import Job, Output, Stage

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import FilterConfig


def run(job: Job, config: FilterConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.filter.run`."""
    from aerialdojo_gen.pipeline.stages.work import filter

    return filter.run(job, config)


STAGE = Stage(
    "filter",
    "Keep the candidates that make tasks, with a reason for every rejection.",
    reads=("scenes", "objects", "pairs", "plans"),
    writes=("verdicts",),
    run=run,
    seconds=(0.1, 0.005),
)
