"""Counts of a stage's run, and its summary line."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class StageSummary:
    """Counts of a stage's run."""

    stage: str  # Name of the stage
    rows_in: int  # Over all shards, fresh ones included
    rows_out: int
    counts: Counter[str] = field(default_factory=Counter)  # Reasons and outcomes, over all shards
    shards: int = 0  # All, and computed in this run
    computed: int = 0
    seconds: float = 0.0  # Over all processes, the search for fresh shards included

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


@dataclass
class StageTotals:
    """Results of a stage's shards so far."""

    summaries: list[dict[str, Any]] = field(default_factory=list)  # Of shards, as in their footers
    tasks: int = 0
    computed: int = 0
    seconds: float = 0.0

    def summary(self, stage: str) -> StageSummary:
        """Sum up."""
        counts: Counter[str] = Counter()
        for summary in self.summaries:
            counts.update(summary["counts"])
        rows_in, rows_out = (sum(summary[name] for summary in self.summaries) for name in ("rows_in", "rows_out"))
        return StageSummary(stage, rows_in, rows_out, counts, len(self.summaries), self.computed, self.seconds)
