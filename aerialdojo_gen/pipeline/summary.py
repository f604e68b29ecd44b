"""Counts of a stage's run, and its summary line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


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
