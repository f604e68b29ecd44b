"""Where tasks are computed: in processes of this machine, or on a Ray cluster."""

from aerialdojo_gen.pipeline.executors.base import (
    EXECUTORS,
    Executor,
    ParentChannel,
    SharedPaths,
    make_executor,
    on_disk,
)

__all__ = ["EXECUTORS", "Executor", "ParentChannel", "SharedPaths", "make_executor", "on_disk"]
