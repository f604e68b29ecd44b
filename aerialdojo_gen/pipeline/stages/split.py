"""`split`: the release, `tasks` that an agent may know and `routes` that only the evaluator may."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from aerialdojo_gen.pipeline.stage import Job, Output, Stage

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import SplitConfig
    from aerialdojo_gen.store.root import DataRoot


def run(job: Job, config: SplitConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.split.run`."""
    from aerialdojo_gen.pipeline.stages.work import split

    return split.run(job, config)


def check(data: DataRoot, scenes: Sequence[str], config: SplitConfig) -> None:
    """Raise a PoolError where the paper's numbers are wanted and there are too few candidates for them."""
    if config.paper_counts:
        from aerialdojo_gen.pipeline.stages.work.candidate_pool import require_pools

        require_pools(data, scenes)


STAGE = Stage(
    "split",
    "Write the release: tasks, routes, objects, train and test.",
    reads=("scenes", "landmarks", "objects", "anchors", "viewpoints", "references", "pairs", "plans", "verdicts"),
    writes=(
        "tasks/train", "tasks/test", "routes/train", "routes/test",
        "release/scenes", "release/landmarks", "release/objects", "release/anchors", "release/viewpoints",
    ),
    run=run,
    check=check,
    seconds=(0.2, 0.005),
    barrier=True,
)  # fmt: skip
