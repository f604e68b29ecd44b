"""The settings of an evaluation, its limits, its outcome, and the digest of the code that flies it."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.agents.load import BUILT_IN, add_working_directory
from aerialdojo_gen.benchmark.flight import Flight
from aerialdojo_gen.benchmark.tasks import Selection, check_hints
from aerialdojo_gen.benchmark.worker import Finished, RetryPolicy
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.store.files import file_digest
from aerialdojo_gen.store.root import DataRoot


@dataclass(frozen=True)
class Evaluation:
    """The settings of an evaluation: all that the log depends on, except the data."""

    run: str = "default"  # Name of the run
    agent: str = "random"  # Name of the agent, or ``package.module:Class``
    options: Mapping[str, Any] = field(default_factory=dict)
    selection: Selection = field(default_factory=Selection)  # Which tasks
    sensors: Sensors | None = None  # Override the agent's own
    embodiment: Embodiment = field(default_factory=Embodiment)  # The body
    renderer: str = "auto"
    retry_policy: RetryPolicy = field(default_factory=RetryPolicy)  # Retries and tolerance of agent errors
    requests_per_minute: float | None = None  # Of an agent that uses a service, over all workers
    used: Mapping[str, Any] | None = None  # The options that the agent reports, for the log
    hints: tuple[str, ...] = ()
    withheld: bool = False  # Fly also where the release has no routes: for a submission, scored elsewhere

    def __post_init__(self) -> None:
        """Check the names of hints, and put them in order."""
        object.__setattr__(self, "hints", check_hints(self.hints))

    @property
    def label(self) -> str:
        """What progress is shown under."""
        return f"{self.agent} ({self.run})"

    def identity(self) -> dict[str, str]:
        """Columns of `episodes` that identify the run, its agent and its hints."""
        options = json.dumps(self._logged(self.options if self.used is None else self.used), sort_keys=True)
        return {"run_id": self.run, "agent": self.agent, "agent_options": options, "told": ",".join(self.hints)}

    def flight_of(self, agent: Any, data: DataRoot) -> Flight:
        """Make the flight of an agent, by its own sensors where these settings have none."""
        wanted = getattr(agent, "sensors", None)
        sensors = self.sensors or (wanted if isinstance(wanted, Sensors) else Sensors())
        return Flight(data, sensors, embodiment=self.embodiment, renderer=self.renderer, hints=self.hints)

    def settings(self) -> dict[str, Any]:
        """Settings that must not change within a run, as JSON without secrets; retries and rate limit may."""
        return {
            "agent": self.agent,
            "options": self._logged(self.options),
            **asdict(self.selection),
            "sensors": asdict(self.sensors) if self.sensors else None,
            "renderer": self.renderer,
            "tell": self.hints,
            "embodiment": self.embodiment.model_dump(),
        }

    def _logged(self, options: Mapping[str, Any]) -> dict[str, Any]:
        return dict(Secrets(self.options).options(options))


@dataclass(frozen=True)
class Outcome:
    """The result of an evaluation."""

    episodes: int  # Selected
    finished: int  # In the tables: flown, and failed for external reasons
    failed: int
    flown: int  # Episodes and actions of this call, including failed ones
    actions: int
    cost_usd: float  # Of all calls for this run
    tokens: int  # Both ways, of all calls for this run
    seconds: float  # Of this call
    stopped: str = ""  # Why it ended early; empty otherwise
    failures: tuple[str, ...] = ()
    finished_now: int = 0  # Of this call, without failed ones
    successes: int | None = 0  # Of the finished; None where goals are withheld

    @property
    def all_failed(self) -> bool:
        """Whether episodes failed and none was finished, in this call or, if it flew none, ever."""
        return self.failed > 0 and not (self.finished_now if self.flown else self.finished)

    def __str__(self) -> str:
        """One line."""
        rate = f", {self.actions / self.seconds:,.0f} actions/s" if self.flown else ""
        cost = f"; {self.cost_usd:.2f} USD" if self.cost_usd else ""
        tokens = f"; {self.tokens:,} tokens" if self.tokens else ""
        failed = f", {self.failed:,} failed" if self.failed else ""
        known = self.finished and self.successes is not None
        success = f", success rate {(self.successes or 0) / self.finished:.1%}" if known else ""
        return (
            f"{self.finished:,} of {self.episodes:,} episodes finished{failed}{success}; "
            f"{self.flown:,} flown now in {self.seconds:.1f} s{rate}{tokens}{cost}"
        )

    def failure_message(self, rerun_command: str = "--rerun-failed") -> str:
        """Describe the failures and how to repeat them; empty if there are none."""
        if not self.failures:
            return self.stopped
        left = self.episodes - self.finished - self.failed
        rest = f" {left:,} not begun: the same command goes on with them." if left else ""
        what = f"{self.failed:,} failed, which count as no episodes: {', '.join(self.failures)}."
        return " ".join(filter(None, (self.stopped, f"{what}{rest} To fly the failed again: {rerun_command}")))


@dataclass(frozen=True)
class Limits:
    """Limits of a run, over all calls for it."""

    cost_usd: float | None = None  # No episode is begun once this is spent
    tokens: int | None = None  # The same, of input and output together
    failures_in_row: int = 5

    def reached(self, total: Finished) -> str:
        """Return the limit that is reached, as its option; empty if none is."""
        if self.cost_usd is not None and total.cost_usd >= self.cost_usd:
            return f"--max-cost {self.cost_usd:g}"
        if self.tokens is not None and total.tokens >= self.tokens:
            return f"--max-tokens {self.tokens}"
        return ""

    def failing(self, total: Finished) -> str:
        """Return the kind of failure that has occurred too often in a row; empty if there is none."""
        last = [failed.kind for failed in total.streak[-self.failures_in_row :]]
        return last[-1] if len(last) == self.failures_in_row and len(set(last)) == 1 else ""


def agent_code_digest(agent: str) -> str:
    """Digest the code that flies an agent; libraries do not count: an update must not end a run that cost money."""
    module = BUILT_IN.get(agent, agent).partition(":")[0]
    parts = dict(code_of("aerialdojo_gen.benchmark.worker").parts)
    if module.split(".")[0] == "aerialdojo_gen":
        parts |= code_of(module).parts
    else:
        add_working_directory()
        with contextlib.suppress(ImportError, ValueError):
            spec = importlib.util.find_spec(module)
            if spec is not None and spec.origin and (path := Path(spec.origin)).is_file():
                parts[module] = file_digest(path)
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
