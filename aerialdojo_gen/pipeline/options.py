"""How stages are run: where, and how much of them."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class RunLimits:
    """How much of the last stage to compute now, and whether to verify files; repeating the command does the rest."""

    share: tuple[int, int] = (0, 1)  # Number of this run's share, and of shares
    deadline: float | None = None  # Seconds since the epoch after which no task starts
    verify: bool = False  # Compare the files' digests, not only their sizes


@dataclass(frozen=True)
class RunOptions:
    """How to run stages; the options that all their commands have."""

    workers: int | None = None  # Processes; all cores if None; with 1 everything runs in this one
    executor: str = "local"
    address: str | None = None  # HOST:PORT of a Ray cluster
    force: frozenset[str] = field(default_factory=frozenset)  # Stages whose fresh shards are computed again
    replace: bool = False  # Whether scenes of the release that another pipeline made may be lost
    limits: RunLimits | None = None
