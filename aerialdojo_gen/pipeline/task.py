"""A shard to compute: what that takes, and how its tables are committed; executors call `compute`."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.cli_context import CliContext, given, use_context
from aerialdojo_gen.base.config.sections import Section
from aerialdojo_gen.base.environment_errors import environment_error
from aerialdojo_gen.base.errors import AerialDojoError, BudgetSpent
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.pipeline.stage import Job
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.footers import ShardFile


@dataclass(frozen=True)
class Task:
    """A shard to compute."""

    job: Job  # What it is
    config: Section  # Its stage's section
    fingerprint: str  # To be stored with it
    given: CliContext = field(default_factory=given, compare=False)

    @property
    def label(self) -> str:
        """The shard in words, for messages."""
        part = f" part {self.job.part} of {self.job.parts}" if self.job.parts > 1 else ""
        return f"{self.job.stage} {self.job.scene}{part}"

    @property
    def scene(self) -> str:
        """The shard's scene, which a process keeps to."""
        return self.job.scene

    def moved(self, place: Callable[[Path], Path]) -> Task:
        """Return the same task for a machine where the folders of the sources lie elsewhere."""
        roots = self.job.roots
        here = replace(
            roots,
            scene_assets=place(roots.scene_assets),
            recipes=place(roots.recipes),
            annotations=place(roots.annotations),
        )
        return replace(self, job=replace(self.job, roots=here))


@dataclass(frozen=True)
class Computed:
    """What is told of a shard that was computed."""

    summary: dict[str, Any]  # ``rows_in``, ``rows_out``, ``counts``, as its footer has it
    seconds: float  # Wall time that it took its process


def compute(task: Task) -> Computed:
    """Compute one shard and commit its tables."""
    job = task.job
    if job.deadline is not None and time.time() >= job.deadline:
        raise BudgetSpent(f"the budget was spent before {task.label}")
    started = time.monotonic()
    stage = BY_NAME[job.stage]
    try:
        with use_context(task.given):
            output = stage.run(job, task.config)
    except AerialDojoError:
        raise
    except Exception as error:
        if why := environment_error(error):
            # Without the shard: it is no fault of its own, and all of them say the same.
            raise AerialDojoError(why) from error
        raise RuntimeError(f"{task.label} failed: {type(error).__name__}: {error}") from error
    if set(output.tables) != set(stage.writes):
        raise RuntimeError(f"{task.label} returned tables {sorted(output.tables)}, not {sorted(stage.writes)}")
    summary = {"rows_in": output.rows_in, "rows_out": output.rows_out, "counts": dict(sorted(output.counts.items()))}
    files = {name: _described(job, name) for name in sorted(job.files)}
    for name, table in output.tables.items():
        store.write_shard(
            job.roots.data,
            name,
            job.scene,
            job.part,
            table,
            fingerprint=task.fingerprint,
            parts=job.parts,
            summary=summary,
            files=files,
        )
    return Computed(summary, time.monotonic() - started)


def _described(job: Job, name: str) -> ShardFile:
    data = job.roots.data
    return ShardFile(data.size(name), data.digest(name) if name in job.digested else "")
