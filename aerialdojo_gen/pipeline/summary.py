"""What a stage did, in figures and in a line."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass(frozen=True)
class StageSummary:
    """What a stage did."""

    stage: str  # Name of the stage
    rows_in: int  # Over all its shards, also those that were already there
    rows_out: int
    counts: Counter[str] = field(default_factory=Counter)  # Reasons and outcomes, over all its shards
    shards: int = 0  # Shards in all; shards that were computed now
    computed: int = 0
    seconds: float = 0.0  # Time that its shards took, in all processes together, and looking which of them are fresh

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
