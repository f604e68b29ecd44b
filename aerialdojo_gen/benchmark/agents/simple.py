"""Agents that look at nothing: a replayed reference or submission, random actions, the same flight, Stop at once."""

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
    """Replays the reference trajectory: the upper bound, and the self-test of the data.

    The runner gives it the reference's actions before each episode, and gives them to no other agent.

    Parameters
    ----------
    actions : str
        Which list of `routes` it flies: ``action``, the Approach left out, or ``agent_action``, which has the 16
        actions alone and ends where the target is seen.
    """

    def __init__(self, actions: str = "action") -> None:
        if actions not in ("action", "agent_action"):
            raise ValueError(f"routes have the lists action and agent_action, not {actions!r}")
        self.column = actions

    def follow(self, actions: Sequence[int]) -> None:
        """Take the reference's actions for the next episode; Approach is left out, for no agent can choose it."""
        self._actions = [action for action in actions if action != APPROACH]


class RandomAgent(_ListAgent):
    """Draws among the 16 actions, Stop as likely as any other.

    Parameters
    ----------
    seed : int
        With the goal's words it fixes the draws: the agent is told nothing that tells two episodes of one goal apart.
    stop_probability : float, optional
        Chance of Stop at each step; the other actions share the rest. One in 16 where absent.
    """

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
    """Flies the same few actions in every episode, and stops: how many tasks are solved without looking.

    Parameters
    ----------
    actions : str or sequence of str or int
        Names or numbers of actions, in a string separated by commas. Where they end it stops. The default is the
        best blind flight that is known.
    """

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
    """Replays submitted actions; the runner says which task comes next, and says so to no other agent.

    Parameters
    ----------
    file : str
        JSON: the actions of every task, a character of `SYMBOLS` each, by task id.
    """

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
