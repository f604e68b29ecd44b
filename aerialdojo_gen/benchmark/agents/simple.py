"""Agents without observations: a replayed reference or submission, random actions, the same flight, Stop at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.safe_parse import read_json
from aerialdojo_gen.benchmark.agents.base import AgentBase, InvalidAnswer
from aerialdojo_gen.benchmark.agents.goal import BLIND, N_ACTIONS, Goal, Observation
from aerialdojo_gen.store.schemas import ACTION_NAMES, APPROACH, STOP

# A short flight ahead ends about as near to as many goals as any blind flight does. Of the ID scenes' pairs of Base
# length, obstacles left out, 1.04 % have their goal within 3 m of its end and 3.59 % within 5 m; of all places that
# could be flown to, the best have 1.23 and 3.75 %.
BEST_CONSTANT = ("MoveForward5", "MoveForward3", "Stop")


class _ListAgent(AgentBase):
    """Does the actions of a list, and stops where it ends."""

    sensors = BLIND
    _actions: Sequence[int] = ()

    def reset(self, goal: Goal) -> None:
        """Begin an episode."""

    def act(self, observation: Observation) -> int:
        """Do what the list has at this step."""
        return self._actions[observation.step] if observation.step < len(self._actions) else STOP


class OracleAgent(_ListAgent):
    """Replays a list of `routes`, ``action`` or ``agent_action``, which the runner gives to it alone."""

    def __init__(self, actions: str = "action") -> None:
        if actions not in ("action", "agent_action"):
            raise ValueError(f"routes have the lists action and agent_action, not {actions!r}")
        self.column = actions

    def follow(self, actions: Sequence[int]) -> None:
        """Take the reference's actions for the next episode; Approach is left out, for no agent can choose it."""
        self._actions = [action for action in actions if action != APPROACH]


class RandomAgent(_ListAgent):
    """Draws among the 16 actions by `seed` and the goal's words; Stop as often as each, or by `stop_probability`."""

    def __init__(self, seed: int = 0, stop_probability: float | None = None) -> None:
        p = 1.0 / N_ACTIONS if stop_probability is None else float(stop_probability)
        if not 0.0 <= p <= 1.0:
            raise ValueError(f"stop_probability is between 0 and 1, not {p}")
        self._seed = int(seed)
        self._p = np.full(N_ACTIONS, (1.0 - p) / (N_ACTIONS - 1))
        self._p[STOP] = p

    def reset(self, goal: Goal) -> None:
        """Begin an episode."""
        budget = goal.rules.action_budget
        words = (goal.modality, goal.target_name, goal.landmark, goal.direction, goal.description or "", budget)
        draws = rng.generator(self._seed, "random-agent", *words)
        self._actions = draws.choice(N_ACTIONS, size=budget, p=self._p).tolist()


class StopAgent(_ListAgent):
    """Stops where it stands: how many tasks are solved by doing nothing."""


class ConstantAgent(_ListAgent):
    """Flies the same few actions, names or numbers, in every episode: how much is solved without looking."""

    def __init__(self, actions: str | Sequence[str | int] = BEST_CONSTANT) -> None:
        given = actions.split(",") if isinstance(actions, str) else [str(action) for action in actions]
        known = {name.lower(): k for k, name in enumerate(ACTION_NAMES[:N_ACTIONS])}
        known |= {str(k): k for k in range(N_ACTIONS)}
        for action in given:
            if action.strip().lower() not in known:
                raise ValueError(f"no action {action.strip()!r}: there are {', '.join(ACTION_NAMES[:N_ACTIONS])}")
        self._actions = [known[action.strip().lower()] for action in given]


# A submission has one character an action: hexadecimal digits, and this one for an answer that named no action.
NO_ACTION = "-"
SYMBOLS = f"0123456789abcdef{NO_ACTION}"


class SubmittedAgent(_ListAgent):
    """Replays the submitted actions of a JSON file, by task id; the runner gives it, and no other agent, the id."""

    def __init__(self, file: str) -> None:
        self._by_task: dict[str, str] = read_json(Path(file))

    def follow(self, task_id: str) -> None:
        """Take the actions of the next episode."""
        self._actions = [SYMBOLS.index(symbol) for symbol in self._by_task[task_id]]

    def act(self, observation: Observation) -> int:
        """Do what was submitted for this step; Stop where the list has ended and the episode has not."""
        action = super().act(observation)
        if SYMBOLS[action] == NO_ACTION:
            raise InvalidAnswer("submitted as an answer that names no action")
        return action
