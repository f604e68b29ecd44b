"""The interface of an agent, and what it may raise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from aerialdojo_gen.benchmark.goal import Goal, Observation
from aerialdojo_gen.errors import AerialDojoError


class AgentUnavailable(AerialDojoError):  # noqa: N818 (it says what is the matter)
    """Something that the agent needs is not there now: a time-out, 429, 5xx, a lost connection.

    Never the agent's failure: the runner begins the episode again after a pause, and logs it apart if that does not
    help. The message must hold no key.

    Parameters
    ----------
    message : str
        One line.
    retry_after_s : float, optional
        How long to wait, where the service said so, seconds.
    """

    def __init__(self, message: str, retry_after_s: float | None = None) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class InvalidAnswer(AerialDojoError):  # noqa: N818
    """The agent answered, and the answer names no action: it is counted and spends one, and nothing moves."""


@dataclass(frozen=True)
class Usage:
    """What an agent has used since its last `reset`.

    Attributes
    ----------
    requests : int
        Calls of an outside service, repeated ones too.
    input_tokens, output_tokens : int or None
        Where the service says.
    cost_usd : float or None
        Where prices are known.
    """

    requests: int = 0
    input_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None


@runtime_checkable
class Agent(Protocol):
    """What chooses actions.

    Besides, an agent may have (and `AgentBase` gives):

    - ``sensors``, a `aerialdojo_gen.benchmark.goal.Sensors`: what it wants to see; all four views where absent.
    - ``close()``: called once, at the end of the run.
    - ``usage() -> Usage or None``: what it has used since `reset`.
    - ``answer() -> str or None``: the words behind the last action, kept in `steps`.

    A run has one instance a worker. Episodes come in any order, so that what an agent does must depend on nothing but
    its options, the goal and the observations since `reset`.
    """

    def reset(self, goal: Goal) -> None:
        """Begin an episode."""

    def act(self, observation: Observation) -> int:
        """Choose an action: its id, 0 to 15.

        Raises
        ------
        AgentUnavailable
            An outside service failed: the episode will be begun again.
        InvalidAnswer
            There is an answer, and it names no action.
        """


class AgentBase:
    """What an agent may have, left empty."""

    def close(self) -> None:
        """Free what the agent holds."""

    def usage(self) -> Usage | None:
        """Return what was used since `reset`; None without an outside service."""
        return None

    def answer(self) -> str | None:
        """Return the words behind the last action, if there are any."""
        return None
