"""What is evaluated, and what became of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from aerialdojo_gen.base.config.sections import Embodiment
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.tasks import Selection, check_tell
from aerialdojo_gen.benchmark.worker import Conditions


@dataclass(frozen=True)
class Evaluation:
    """What is evaluated: all that the log depends on, beside the data."""

    run: str = "default"  # Name of the run
    agent: str = "random"  # Name of the agent, or ``package.module:Class``
    options: Mapping[str, Any] = field(default_factory=dict)
    selection: Selection = field(default_factory=Selection)  # Which tasks
    sensors: Sensors | None = None  # In place of those that the agent asks for
    embodiment: Embodiment = field(default_factory=Embodiment)  # The body
    renderer: str = "auto"
    conditions: Conditions = field(default_factory=Conditions)  # What a worker bears
    requests_per_minute: float | None = None  # Of an agent that asks a service, all workers together
    used: Mapping[str, Any] | None = None  # The options as the agent says that it uses them, for the log
    tell: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what nobody tells."""
        check_tell(self.tell)

    def identity(self) -> dict[str, str]:
        """Columns of `episodes` that name the run, its agent, and what that is told."""
        options = json.dumps(self._logged(self.options if self.used is None else self.used), sort_keys=True)
        told = ",".join(check_tell(self.tell))
        return {"run_id": self.run, "agent": self.agent, "agent_options": options, "told": told}

    def settings(self) -> dict[str, Any]:
        """What must not change within a run, as JSON without secrets; attempts, pauses and the pace may."""
        return {
            "agent": self.agent,
            "options": self._logged(self.options),
            **asdict(self.selection),
            "sensors": asdict(self.sensors) if self.sensors else None,
            "renderer": self.renderer,
            "tell": check_tell(self.tell),
            "embodiment": self.embodiment.model_dump(),
        }

    def _logged(self, options: Mapping[str, Any]) -> dict[str, Any]:
        cleaned: dict[str, Any] = Secrets(self.options).options(options)
        return cleaned


@dataclass(frozen=True)
class Outcome:
    """What became of an evaluation."""

    episodes: int  # That the evaluation has
    finished: int  # In the tables now: flown, and given up because something outside failed
    failed: int
    flown: int  # Episodes and actions of this call, failed ones too
    actions: int
    cost_usd: float  # Of all calls for this run
    tokens: int  # Both ways, of all calls for this run
    seconds: float  # Of this call
    stopped: str = ""  # Why it ended early: too many failures in a row; empty otherwise
    failures: tuple[str, ...] = ()
    finished_now: int = 0  # Of the flown those that did not fail
    successes: int = 0  # Of the finished

    @property
    def fruitless(self) -> bool:
        """Whether episodes failed and none was finished: in this call, or ever where this call flew none."""
        return self.failed > 0 and not (self.finished_now if self.flown else self.finished)

    def __str__(self) -> str:
        """One line."""
        rate = f", {self.actions / self.seconds:,.0f} actions/s" if self.flown else ""
        cost = f"; {self.cost_usd:.2f} USD" if self.cost_usd else ""
        tokens = f"; {self.tokens:,} tokens" if self.tokens else ""
        failed = f", {self.failed:,} failed" if self.failed else ""
        success = f", success rate {self.successes / self.finished:.1%}" if self.finished else ""
        return (
            f"{self.finished:,} of {self.episodes:,} episodes finished{failed}{success}; "
            f"{self.flown:,} flown now in {self.seconds:.1f} s{rate}{tokens}{cost}"
        )

    def last_line(self, again: str = "--rerun-failed") -> str:
        """Say what to know and do about failures; empty where there are none."""
        if not self.failures:
            return self.stopped
        left = self.episodes - self.finished - self.failed
        rest = f" {left:,} not begun: the same command goes on with them." if left else ""
        what = f"{self.failed:,} failed, which count as no episodes: {', '.join(self.failures)}."
        return " ".join(filter(None, (self.stopped, f"{what}{rest} To fly the failed again: {again}")))
