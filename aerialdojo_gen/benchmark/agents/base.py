"""The interface of an agent, what it may raise, and the dead reckoning of those that want to know where they are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURN_RAD, TURNS


class InvalidAnswer(AerialDojoError):  # noqa: N818
    """The agent answered, and the answer names no action: it is counted and spends one, and nothing moves."""


@dataclass(frozen=True)
class Usage:
    """What an agent has used since its last `reset`; None where it is not known."""

    requests: int | None = 0  # Calls of an outside service, repeated ones too
    input_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None
    request_s: float | None = None  # From sending requests to having their answers, seconds
    longest_request_s: float | None = None


@runtime_checkable
class Agent(Protocol):
    """What chooses actions.

    Besides, an agent may have (``close``, ``usage`` and ``answer`` are in `AgentBase`, and do nothing there):

    - ``sensors``, a `Sensors` (module ``goal`` beside this): what it wants to see; all four views where absent.
    - ``close()``: called once, at the end of the run.
    - ``usage() -> Usage or None``: what it has used since `reset`.
    - ``answer() -> str or None``: the words behind the last action, kept in `steps`.
    - ``check() -> str``: called once before a run, on an instance made for it: raises an `AerialDojoError` if
      the agent cannot work (nobody listens, a wrong key), else returns a message for the user.
    - ``settled() -> dict``: options that ``check`` has settled, given to the instances that fly.
    - ``used_options() -> dict``: its options with their defaults, JSON and no secrets, for the log.
    - ``suits(release: str)``: called once before it flies, with the fingerprint of the release's scenes; raises an
      `AerialDojoError` if the agent was made for others.
    - ``pace``: a callable that the runner sets under ``--requests-per-minute``, to be called before each request.

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
            An outside service failed: the episode is begun again, or logged in `failures`.
        ServiceDown, UsageError
            No request will be answered: the run ends.
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


class Odometer:
    """Where a body is that adds up its own actions, in the frame of its start: x ahead, y left, z up, metres."""

    def __init__(self) -> None:
        self.place = np.zeros(3)
        self.headings = 0  # Turned to the left, of `TURN_RAD` each

    @property
    def yaw_rad(self) -> float:
        """The heading, from that of the start."""
        return self.headings * TURN_RAD

    def displacement(self, action: int) -> NDArray[np.float64]:
        """Return by how much an action moves the body here, (3,)."""
        ahead, left, up = DISPLACEMENTS[action]
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.array([cos * ahead - sin * left, sin * ahead + cos * left, up])

    def add(self, action: int, refused: bool = False) -> None:
        """Add an action; one that was refused moved nothing."""
        if not refused:
            self.place = self.place + self.displacement(action)
            self.headings += int(TURNS[action])
