"""A worker of an evaluation: one agent, one flight, episode after episode."""

from __future__ import annotations

import operator
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from aerialdojo_gen.benchmark.agents import Agent, AgentUnavailable, InvalidAnswer, Usage
from aerialdojo_gen.benchmark.agents.simple import OracleAgent
from aerialdojo_gen.benchmark.flight import Flight
from aerialdojo_gen.benchmark.goal import N_ACTIONS, Observation
from aerialdojo_gen.benchmark.journal import Journal
from aerialdojo_gen.benchmark.tasks import Task, read_tasks, reference_actions
from aerialdojo_gen.errors import AerialDojoError
from aerialdojo_gen.schemas import STEPS

_LONGEST_PAUSE_S = 600.0
_COLUMNS = [name for name in STEPS.schema.names if name not in ("run_id", "task_id", "scene", "step")]


class AgentError(AerialDojoError):
    """An agent raised what it may not: a defect of the agent's."""


@dataclass(frozen=True)
class Unit:
    """Episodes of one scene that a worker flies.

    Attributes
    ----------
    scene : str
    rows : pyarrow.Table
        Of `aerialdojo_gen.benchmark.tasks.select`.
    journal : Path
        Where finished episodes go.
    """

    scene: str
    rows: pa.Table
    journal: Path


@dataclass(frozen=True)
class Finished:
    """What was finished, for progress and for the bill; sums add up."""

    episodes: int = 0
    actions: int = 0
    cost_usd: float = 0.0

    def __add__(self, other: Finished) -> Finished:
        """Add two counts."""
        return Finished(
            self.episodes + other.episodes, self.actions + other.actions, self.cost_usd + other.cost_usd
        )  # fmt: skip


class Worker:
    """Flies units with one agent.

    Parameters
    ----------
    agent : Agent
    flight : Flight
    data : Path
    identity : dict
        Columns ``run_id``, ``agent`` and ``agent_options`` of `episodes`.
    attempts : int
        How often an episode is begun before it is logged as failed.
    pause_s : float
        Before the second attempt; doubled each time, unless the service says how long to wait.
    """

    def __init__(
        self, agent: Agent, flight: Flight, data: Path, identity: dict[str, str], attempts: int, pause_s: float
    ) -> None:
        self._agent, self._flight, self._data = agent, flight, data
        self._identity, self._attempts, self._pause_s = identity, attempts, pause_s

    def fly(self, unit: Unit, tell: Callable[[Finished], None], stopped: Callable[[], bool]) -> None:
        """Fly a unit's episodes, each into the journal when it is finished.

        Parameters
        ----------
        unit : Unit
        tell : callable
            Called after each episode.
        stopped : callable
            Asked before each; True ends the unit.

        Raises
        ------
        AgentError
            The agent failed in a way of its own.
        """
        actions: dict[str, list[int]] = {}
        # The oracle alone, by its very class: no agent of another name can ask for it.
        if type(self._agent) is OracleAgent:
            actions = reference_actions(self._data, unit.scene, unit.rows["subset"].unique().to_pylist())
        with Journal(unit.journal) as journal:
            for task in read_tasks(self._data, unit.rows):
                if stopped():
                    return
                if isinstance(self._agent, OracleAgent):
                    self._agent.follow(actions[task.row["nav_id"]])
                record, finished = self._finish(task)
                journal.add(record)
                tell(finished)

    def _finish(self, task: Task) -> tuple[dict[str, Any], Finished]:
        """Fly one episode, again where something outside failed."""
        used: Usage | None = None
        for attempt in range(1, self._attempts + 1):
            try:
                record = self._episode(task)
            except AgentUnavailable as error:
                used = _sum(used, self._usage())
                reason = " ".join(str(error).split())[:300]
                if attempt < self._attempts:
                    pause = (
                        error.retry_after_s if error.retry_after_s is not None else self._pause_s * 2 ** (attempt - 1)
                    )
                    time.sleep(min(max(pause, 0.0), _LONGEST_PAUSE_S))
                continue
            used = _sum(used, self._usage())
            record["episode"] |= _bill(used)
            record["timing"]["attempts"] = attempt
            return record, Finished(1, record["episode"]["n_actions"], _cost(used))
        key = {"run_id": self._identity["run_id"], "task_id": task.row["task_id"], "scene": task.row["scene"]}
        failure = key | {"attempts": self._attempts, "reason": reason, "cost_usd": used.cost_usd if used else None}
        return {"task_id": task.row["task_id"], "failure": failure}, Finished(1, 0, _cost(used))

    def _episode(self, task: Task) -> dict[str, Any]:
        started = time.perf_counter()
        thinking = 0.0
        episode = self._flight.begin(task)
        agent = self._agent
        answer_of: Callable[[], str | None] | None = getattr(agent, "answer", None)
        before = time.perf_counter()
        self._ask(task, agent.reset, self._flight.goal)
        thinking += time.perf_counter() - before
        columns: dict[str, list[Any]] = {name: [] for name in _COLUMNS}
        while episode.termination is None:
            observation = self._flight.observe()
            before = time.perf_counter()
            action = self._choose(task, observation)
            answer = answer_of() if answer_of is not None else None
            thinking += time.perf_counter() - before
            episode.step(action)
            values = (action, episode.refused, *episode.position, episode.yaw_rad, episode.distance_m, answer)
            for name, value in zip(_COLUMNS, values, strict=True):
                columns[name].append(value)
        key = {"run_id": self._identity["run_id"], "task_id": task.row["task_id"], "scene": task.row["scene"]}
        seconds = {"wall_s": time.perf_counter() - started, "agent_s": thinking}
        return {
            "task_id": task.row["task_id"],
            "episode": self._row(task),
            "steps": columns,
            "timing": key | seconds,
        }

    def _choose(self, task: Task, observation: Observation) -> int | None:
        try:
            answer = self._ask(task, self._agent.act, observation)
        except InvalidAnswer:
            return None
        if isinstance(answer, bool):
            return None
        try:
            action = operator.index(answer)
        except TypeError:
            return None
        return action if 0 <= action < N_ACTIONS else None

    def _ask(self, task: Task, question: Callable[[Any], Any], about: Any) -> Any:
        try:
            return question(about)
        except AerialDojoError:
            raise
        except Exception as error:
            at = error.__traceback__
            while at is not None and at.tb_next is not None:
                at = at.tb_next
            where = f" at {Path(at.tb_frame.f_code.co_filename).name}:{at.tb_lineno}" if at is not None else ""
            raise AgentError(
                f"agent {self._identity['agent']} failed at task {task.row['task_id']}: "
                f"{type(error).__name__}{where}: {error}"
            ) from error

    def _row(self, task: Task) -> dict[str, Any]:
        row, episode = task.row, self._flight.episode
        radius_m = self._flight.success_radius_m
        told = ("task_id", "nav_id", "scene", "family", "scene_type", "partition", "subset", "split", "setting",
                "modality", "action_budget", "start_x_m", "start_y_m", "start_z_m", "start_yaw_rad")  # fmt: skip
        return {
            **self._identity,
            **{name: row[name] for name in told},
            "success": episode.success(radius_m),
            "oracle_success": episode.min_distance_m <= radius_m,
            "collision": episode.termination == "collision",
            "stop_called": episode.stop_called,
            "termination": episode.termination,
            "final_distance_m": episode.distance_m,
            "min_distance_m": episode.min_distance_m,
            "final_horizontal_distance_m": episode.horizontal_distance_m,
            "min_horizontal_distance_m": episode.min_horizontal_distance_m,
            "path_length_m": episode.path_length_m,
            "reference_length_m": task.length_m,
            "euclidean_m": task.euclidean_m,
            "n_actions": episode.n_actions,
            "n_refused": episode.n_refused,
            "n_invalid": episode.n_invalid,
        }

    def _usage(self) -> Usage | None:
        usage: Callable[[], Usage | None] | None = getattr(self._agent, "usage", None)
        return usage() if usage is not None else None


def _sum(a: Usage | None, b: Usage | None) -> Usage | None:
    """Add what two attempts used; what neither knows stays unknown."""
    if a is None or b is None:
        return a or b
    both = {}
    for name in ("input_tokens", "output_tokens", "cost_usd"):
        known = [v for v in (getattr(a, name), getattr(b, name)) if v is not None]
        both[name] = sum(known) if known else None
    return replace(a, requests=a.requests + b.requests, **both)


def _bill(used: Usage | None) -> dict[str, Any]:
    if used is None:
        return dict.fromkeys(("n_requests", "input_tokens", "output_tokens", "cost_usd"))
    return {
        "n_requests": used.requests,
        "input_tokens": used.input_tokens,
        "output_tokens": used.output_tokens,
        "cost_usd": used.cost_usd,
    }


def _cost(used: Usage | None) -> float:
    return (used.cost_usd or 0.0) if used is not None else 0.0
