"""When a run ends before its tasks do: money, tokens, and failures in a row."""

from __future__ import annotations

from dataclasses import dataclass

from aerialdojo_gen.benchmark.worker import Failed, Finished


@dataclass(frozen=True)
class Limits:
    """What a run may spend and bear, over all calls for it."""

    cost_usd: float | None = None  # Begin no episode once so much is spent
    tokens: int | None = None  # Begin no episode once so many are spent, both ways
    failures_in_row: int = 5


class BudgetTracker:
    """Counts what is finished, and says when it is enough."""

    def __init__(self, limits: Limits, cost_usd: float, tokens: int) -> None:
        self._limits = limits
        self.cost_usd, self.tokens = cost_usd, tokens
        self.episodes = self.actions = self.finished = 0
        self.streak: tuple[Failed, ...] = ()

    def add(self, finished: Finished) -> None:
        """Count what was finished."""
        self.cost_usd += finished.cost_usd
        self.tokens += finished.tokens
        self.episodes += finished.episodes
        self.finished += finished.flown
        self.actions += finished.actions
        self.streak = finished.streak if finished.flown else self.streak + finished.streak

    @property
    def failing(self) -> Failed | None:
        """What has failed too often in a row; None where nothing has."""
        n = self._limits.failures_in_row
        last = self.streak[-n:]
        return last[-1] if len(last) == n and len({failed.kind for failed in last}) == 1 else None

    @property
    def spent(self) -> str:
        """The limit that is reached, as its option; empty where none is."""
        limits = self._limits
        if limits.cost_usd is not None and self.cost_usd >= limits.cost_usd:
            return f"--max-cost {limits.cost_usd:g}"
        if limits.tokens is not None and self.tokens >= limits.tokens:
            return f"--max-tokens {limits.tokens}"
        return ""
