"""`plan`: a certified reference trajectory for every candidate, or the reason why there is none (paper: routes)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aerialdojo_gen.pipeline.stage import Job, Output, Stage

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import PlanConfig
    from aerialdojo_gen.store.root import DataRoot


def run(job: Job, config: PlanConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.plan.run`."""
    from aerialdojo_gen.pipeline.stages.work import plan

    return plan.run(job, config)


def parts(data: DataRoot, scene: str, config: PlanConfig) -> int:
    """Count the shards of a scene: `targets_per_part` targets each, or one where all are chosen from together."""
    from aerialdojo_gen.base.paper_figures import inventory
    from aerialdojo_gen.store import shards

    if config.search == "released" and scene in inventory():
        return 1
    return -(-shards.count_rows(data, "objects", scene) // config.targets_per_part)


STAGE = Stage(
    "plan",
    "Plan a collision-free reference trajectory for every candidate.",
    reads=("scenes", "objects", "anchors", "pairs"),
    writes=("plans",),
    run=run,
    parts=parts,
    memory_mb=1500,
    seconds=(1.0, 0.4),
)
