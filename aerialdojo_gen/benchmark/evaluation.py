"""The settings of an evaluation, its limits, its outcome, and the digest of the code that flies it."""

from __future__ import annotations

import hashlib
import importlib.util
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.config.sections import Embodiment
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.agents.load import BUILT_IN, look_here
from aerialdojo_gen.benchmark.tasks import Selection, check_tell
from aerialdojo_gen.benchmark.worker import Conditions, Failed, Finished
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.store.files import file_digest


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


def flying_code(agent: str) -> str:
    """Digest the code that flies an agent.

    Libraries do not count, as they do for stages: an episode may have cost money, and a library's next patch should
    not end a run of a thousand of them.
    """
    module = BUILT_IN.get(agent, agent).partition(":")[0]
    parts = dict(code_of("aerialdojo_gen.benchmark.worker").parts)
    if module.split(".")[0] == "aerialdojo_gen":
        parts |= code_of(module).parts
    elif (path := _file_of(module)) is not None:
        parts[module] = file_digest(path)
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _file_of(module: str) -> Path | None:
    look_here()
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    return Path(spec.origin) if spec is not None and spec.origin and Path(spec.origin).is_file() else None
