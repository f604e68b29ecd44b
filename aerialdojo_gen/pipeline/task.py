"""A shard to compute, and how its tables are committed; executors call `compute`. What a stage's shards came to."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.cli_context import CliContext, current_context, use_context
from aerialdojo_gen.base.config.shared import Section
from aerialdojo_gen.base.environment_errors import environment_error
from aerialdojo_gen.base.errors import AerialDojoError, BudgetSpent
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.pipeline.stage import SOURCE_FOLDERS, Job
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.footers import ShardFile


@dataclass(frozen=True)
class Task:
    """A shard to compute."""

    job: Job
    config: Section  # Its stage's section
    fingerprint: str  # Stored with the shard
    context: CliContext = field(default_factory=current_context, compare=False)

    @property
    def label(self) -> str:
        """The shard's name in messages."""
        part = f" part {self.job.part} of {self.job.parts}" if self.job.parts > 1 else ""
        return f"{self.job.stage} {self.job.scene}{part}"

    @property
    def scene(self) -> str:
        """The shard's scene; a process stays with a scene."""
        return self.job.scene

    def moved(self, place: Callable[[Path], Path]) -> Task:
        """Return the same task for a machine with other source folders."""
        roots = self.job.roots
        moved: dict[str, Any] = {name: place(getattr(roots, name)) for name in SOURCE_FOLDERS}
        return replace(self, job=replace(self.job, roots=replace(roots, **moved)))


@dataclass(frozen=True)
class Computed:
    """Result of a computed shard."""

    summary: dict[str, Any]  # ``rows_in``, ``rows_out``, ``counts``, as in its footer
    seconds: float  # Wall time in its process


def compute(task: Task) -> Computed:
    """Compute one shard and commit its tables."""
    job = task.job
    if job.deadline is not None and time.time() >= job.deadline:
        raise BudgetSpent(f"the budget was spent before {task.label}")
    started = time.monotonic()
    stage = BY_NAME[job.stage]
    try:
        with use_context(task.context):
            output = stage.run(job, task.config)
    except AerialDojoError:
        raise
    except Exception as error:
        if why := environment_error(error):
            # Without the shard's name: the cause is the machine, and all shards report the same.
            raise AerialDojoError(why) from error
        raise RuntimeError(f"{task.label} failed: {type(error).__name__}: {error}") from error
    if set(output.tables) != set(stage.writes):
        raise RuntimeError(f"{task.label} returned tables {sorted(output.tables)}, not {sorted(stage.writes)}")
    summary = {"rows_in": output.rows_in, "rows_out": output.rows_out, "counts": dict(sorted(output.counts.items()))}
    data = job.roots.data
    files = {
        name: ShardFile(data.size(name), data.digest(name) if name in job.digested else "")
        for name in sorted(job.files)
    }
    footer: dict[str, Any] = {"fingerprint": task.fingerprint, "parts": job.parts, "summary": summary, "files": files}
    for name, table in output.tables.items():
        store.write_shard(data, name, job.scene, job.part, table, **footer)
    return Computed(summary, time.monotonic() - started)


@dataclass
class StageSummary:
    """Counts of a stage's run."""

    stage: str  # Name of the stage
    rows_in: int = 0  # Over all shards, fresh ones included
    rows_out: int = 0
    counts: Counter[str] = field(default_factory=Counter)  # Reasons and outcomes, over all shards
    shards: int = 0  # All, and computed in this run
    computed: int = 0
    seconds: float = 0.0  # Over all processes, the search for fresh shards included

    def add(self, shard: Mapping[str, Any]) -> None:
        """Count a shard, by what its footer says."""
        self.rows_in += shard["rows_in"]
        self.rows_out += shard["rows_out"]
        self.counts.update(shard["counts"])
        self.shards += 1

    def __str__(self) -> str:
        """One line: rows in, rows out, why the others were rejected, seconds."""
        counts = ", ".join(
            f"{name} {n:,}" for name, n in sorted(self.counts.items(), key=lambda c: (-c[1], c[0])) if n
        )
        fresh = "nothing to do" if not self.computed else f"{self.computed} of {self.shards} shards computed"
        return (
            f"{self.stage}: {self.rows_in:,} rows in, {self.rows_out:,} out"
            f"{f' ({counts})' if counts else ''}; {fresh}; {self.seconds:.1f} s"
        )
