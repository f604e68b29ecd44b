"""Calls of an agent with checked results: what it may return and raise, and the error for anything else."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents import Agent, InvalidAnswer, Usage
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS, Goal, Observation
from aerialdojo_gen.benchmark.agents.load import error_location, keep_traceback

_TOLERATED = "--tolerate logs such episodes as failures and goes on, --traceback shows the agent's traceback"


class AgentError(AerialDojoError):
    """An agent raised or returned something invalid: a defect of the agent."""


class GuardedAgent:
    """Calls an agent and checks what it returns."""

    def __init__(self, agent: Agent, name: str, secrets: Secrets, tolerate: bool = False) -> None:
        self._agent, self._name, self._secrets, self._tolerate = agent, name, secrets, tolerate
        self._answer: Any = getattr(agent, "answer", None)
        self._used: Any = getattr(agent, "usage", None)
        self.task = ""

    def reset(self, task_id: str, goal: Goal) -> None:
        """Begin an episode."""
        self.task = task_id
        try:
            self._call("reset", self._agent.reset, goal)
        except InvalidAnswer as error:
            raise self._wrong(f"raised InvalidAnswer in reset, where there is nothing to answer: {error}") from error

    def act(self, observation: Observation) -> int | None:
        """Return the agent's action; None for an invalid answer."""
        try:
            answer = self._call("act", self._agent.act, observation)
        except InvalidAnswer:
            return None
        try:
            action = None if isinstance(answer, bool) else operator.index(answer)
        except Exception:
            # The agent's own object may raise anything in __index__.
            action = None
        if action is not None and 0 <= action < N_ACTIONS:
            return action
        if self._tolerate:
            return None
        raise self._wrong(
            f"returned {_short(answer)} from act, where an action is expected: a whole number from 0 (Stop) to "
            f"{N_ACTIONS - 1}; an agent whose answer names none raises InvalidAnswer. --tolerate counts it as that"
        )

    def answer(self) -> str | None:
        """Return the agent's text for the last action, without secrets."""
        if self._answer is None:
            return None
        text = self._call("answer", self._answer)
        # Files cannot hold lone surrogates.
        return self._secrets.text(text.encode("utf-8", "replace").decode("utf-8")) if isinstance(text, str) else None

    def usage(self) -> Usage | None:
        """Return what was used since the last `reset`."""
        used = self._call("usage", self._used) if self._used is not None else None
        if used is None or isinstance(used, Usage):
            return used
        raise self._wrong(f"returned {_short(used)} from usage, where Usage or None is expected")

    def _call(self, what: str, method: Callable[..., Any], *args: Any) -> Any:
        try:
            return method(*args)
        except AerialDojoError:
            raise
        except (Exception, SystemExit) as error:
            # SystemExit too: an agent must not end the run without a message.
            raise keep_traceback(self._wrong(f"{error_location(error)} (in {what}); {_TOLERATED}"), error) from error

    def _wrong(self, what: str) -> AgentError:
        line = " ".join(f"agent {self._name} failed at task {self.task}: {what}".split())
        return AgentError(self._secrets.text(line.encode("utf-8", "replace").decode("utf-8"))[:600])


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except Exception:
        text = "something"
    return f"{text[:60]} ({type(value).__name__})"
