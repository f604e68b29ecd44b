"""An agent that does what stands in a submission: `score` flies it, to see whether the file tells the truth."""

from __future__ import annotations

from pathlib import Path

from aerialdojo_gen.base.safe_parse import read_json
from aerialdojo_gen.benchmark.agents.base import AgentBase, InvalidAnswer
from aerialdojo_gen.benchmark.agents.goal import BLIND, Goal, Observation
from aerialdojo_gen.store.schemas import STOP

# One character an action: hexadecimal digits, and this one for an answer that named no action.
NO_ACTION = "-"
SYMBOLS = f"0123456789abcdef{NO_ACTION}"


class SubmittedAgent(AgentBase):
    """Replays submitted actions; the runner says which task comes next, and says so to no other agent.

    Parameters
    ----------
    file : str
        JSON: the actions of every task, a character of `SYMBOLS` each, by task id.
    """

    sensors = BLIND

    def __init__(self, file: str) -> None:
        self._by_task: dict[str, str] = read_json(Path(file))
        self._actions = ""

    def follow(self, task_id: str) -> None:
        """Take the actions of the next episode."""
        self._actions = self._by_task[task_id]

    def reset(self, goal: Goal) -> None:
        """Begin an episode."""

    def act(self, observation: Observation) -> int:
        """Do what was submitted for this step; Stop where the list has ended and the episode has not."""
        if observation.step >= len(self._actions):
            return STOP
        if self._actions[observation.step] == NO_ACTION:
            raise InvalidAnswer("submitted as an answer that names no action")
        return SYMBOLS.index(self._actions[observation.step])
