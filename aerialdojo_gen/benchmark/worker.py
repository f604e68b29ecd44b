"""A worker of an evaluation: one agent, one flight, episode after episode."""

from __future__ import annotations

import operator
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.errors import AerialDojoError, RenderError
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents import Agent, AgentUnavailable, InvalidAnswer, Usage
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS, Goal, Observation
from aerialdojo_gen.benchmark.agents.load import add_traceback, error_location
from aerialdojo_gen.benchmark.agents.simple import OracleAgent, SubmittedAgent
from aerialdojo_gen.benchmark.episodes import Journal
from aerialdojo_gen.benchmark.flight import Flight
from aerialdojo_gen.benchmark.tasks import Task, read_tasks, reference_actions
from aerialdojo_gen.rendering.backend import close_renderers
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import STEPS

_TOLERATED = "--tolerate logs such episodes as failures and goes on, --traceback shows the agent's traceback"


class AgentError(AerialDojoError):
    """An agent raised or returned something invalid: a defect of the agent."""


class GuardedAgent:
    """Calls an agent and checks what it returns."""

    def __init__(self, agent: Agent, name: str, secrets: Secrets, tolerate: bool = False) -> None:
        self._agent, self._name, self._secrets, self._tolerate = agent, name, secrets, tolerate
        self._answer: Any = getattr(agent, "answer", lambda: None)
        self._used: Any = getattr(agent, "usage", lambda: None)
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
        text = self._call("answer", self._answer)
        # Files cannot hold lone surrogates.
        return self._secrets.text(text.encode("utf-8", "replace").decode("utf-8")) if isinstance(text, str) else None

    def usage(self) -> Usage:
        """Return what was used since the last `reset`; nothing is known of an agent that does not say it."""
        used = self._call("usage", self._used)
        if used is None or isinstance(used, Usage):
            return used or _UNKNOWN
        raise self._wrong(f"returned {_short(used)} from usage, where Usage or None is expected")

    def _call(self, what: str, method: Callable[..., Any], *args: Any) -> Any:
        try:
            return method(*args)
        except AerialDojoError:
            raise
        except (Exception, SystemExit) as error:
            # SystemExit too: an agent must not end the run without a message.
            raise add_traceback(self._wrong(f"{error_location(error)} (in {what}); {_TOLERATED}"), error) from error

    def _wrong(self, what: str) -> AgentError:
        line = " ".join(f"agent {self._name} failed at task {self.task}: {what}".split())
        return AgentError(self._secrets.text(line.encode("utf-8", "replace").decode("utf-8"))[:600])


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except Exception:
        text = "something"
    return f"{text[:60]} ({type(value).__name__})"


_UNKNOWN = Usage(requests=None)


def _add_usage(a: Usage, b: Usage) -> Usage:
    """Add the usage of two attempts; unknown counts stay unknown."""
    known = {f.name: [v for v in (getattr(a, f.name), getattr(b, f.name)) if v is not None] for f in fields(Usage)}
    longest_s = max(known.pop("longest_request_s"), default=None)
    sums: dict[str, Any] = {name: sum(values) if values else None for name, values in known.items()}
    return Usage(**sums, longest_request_s=longest_s)


_LONGEST_PAUSE_S = 600.0
_COLUMNS = [name for name in STEPS.schema.names if name not in ("run_id", "task_id", "scene", "step")]


@dataclass(frozen=True)
class WorkUnit:
    """Episodes of one scene that a worker flies."""

    scene: str
    rows: pa.Table  # Rows of `aerialdojo_gen.benchmark.tasks.select`
    journal: Path  # File for finished episodes

    @property
    def label(self) -> str:
        """Name it in messages."""
        return f"evaluate {self.scene}"


class Failed(NamedTuple):
    """Why an episode failed, for reasons outside the agent's choices."""

    kind: str
    reason: str


@dataclass(frozen=True)
class Finished:
    """Counts of finished episodes, for progress and budget."""

    episodes: int = 0  # Including failed ones
    actions: int = 0
    cost_usd: float = 0.0  # 0 if unknown, as tokens are
    tokens: int = 0
    flown: int = 0  # Episodes that did not fail
    streak: tuple[Failed, ...] = ()  # Failures since the last episode that did not fail

    def __add__(self, other: Finished) -> Finished:
        """Add later episodes."""
        sums = {f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)}
        return Finished(**sums | ({"streak": other.streak} if other.flown else {}))


@dataclass(frozen=True)
class RetryPolicy:
    """How a worker handles failures."""

    attempts: int = 5  # Attempts before an episode is logged as failed
    pause_s: float = 1.0  # Before the second attempt; doubled each time unless the service names a time
    tolerate: bool = False  # Log an episode with an agent error as failed, instead of ending the run


class Worker:
    """Flies units with one agent."""

    def __init__(
        self, agent: Agent, flight: Flight, data: DataRoot, identity: dict[str, str], retry_policy: RetryPolicy,
        secrets: Secrets,
    ) -> None:  # fmt: skip
        self._agent, self._flight, self._data = agent, flight, data
        self._identity, self._retry_policy, self._secrets = identity, retry_policy, secrets
        self._guarded = GuardedAgent(agent, identity["agent"], secrets, retry_policy.tolerate)

    def fly(self, unit: WorkUnit, on_finished: Callable[[Finished], None], stopped: Callable[[], bool]) -> None:
        """Fly a unit's episodes, and write each to the journal."""
        actions: dict[str, list[int]] = {}
        # By its exact class: no other agent can get the reference.
        if type(self._agent) is OracleAgent:
            subsets = unit.rows["subset"].unique().to_pylist()
            actions = reference_actions(self._data, unit.scene, subsets, self._agent.column)
        with Journal(unit.journal) as journal:
            left = unit.rows.filter(pc.invert(pc.is_in(unit.rows["task_id"], pa.array(journal.done, pa.string()))))
            # The runner has refused a release without routes where it is not for a submission.
            for task in read_tasks(self._data, left, withheld=True):
                if stopped():
                    return
                if isinstance(self._agent, OracleAgent):
                    self._agent.follow(actions[task.row["nav_id"]])
                elif type(self._agent) is SubmittedAgent:
                    self._agent.follow(task.row["task_id"])
                done = self._finish(task, stopped)
                if done is None:
                    return
                journal.add(done[0])
                on_finished(done[1])

    def _finish(self, task: Task, stopped: Callable[[], bool]) -> tuple[dict[str, Any], Finished] | None:
        """Fly one episode, with retries after external failures; None if the run is stopped meanwhile."""
        used = _UNKNOWN
        record, failed, attempt, again = None, Failed("", ""), 0, True
        while record is None and again and attempt < self._retry_policy.attempts:
            attempt += 1
            try:
                record = self._episode(task)
            except AgentUnavailable as error:
                used = _add_usage(used, self._guarded.usage())
                failed, again = Failed(error.kind, self._line(error)), error.again
                left = again and attempt < self._retry_policy.attempts
                if left and not self._pause(attempt, error.retry_after_s, stopped):
                    return None
            except AgentError as error:
                if not self._retry_policy.tolerate:
                    raise
                failed, again = Failed("agent error", self._line(error)), False
        if record is not None:
            used = _add_usage(used, self._guarded.usage())
        columns = {name: getattr(used, name) for name in ("input_tokens", "output_tokens", "cost_usd")}
        columns["n_requests"] = used.requests
        tokens = (used.input_tokens or 0) + (used.output_tokens or 0)
        spent = Finished(1, cost_usd=used.cost_usd or 0.0, tokens=tokens)
        if record is None:
            row = self._key(task) | {"attempts": attempt} | failed._asdict() | columns
            return {"task_id": task.row["task_id"], "failure": row}, replace(spent, streak=(failed,))
        record["episode"] |= columns
        times = {"request_s": used.request_s, "longest_request_s": used.longest_request_s}
        record["timing"] |= {"attempts": attempt} | times
        return record, replace(spent, actions=record["episode"]["n_actions"], flown=1)

    def _pause(self, attempt: int, requested_s: float | None, stopped: Callable[[], bool]) -> bool:
        """Wait before the next attempt; False if the run is stopped meanwhile."""
        seconds = requested_s if requested_s is not None else self._retry_policy.pause_s * 2 ** (attempt - 1)
        until = time.monotonic() + min(max(seconds, 0.0), _LONGEST_PAUSE_S)
        while (left := until - time.monotonic()) > 0.0:
            if stopped():
                return False
            time.sleep(min(left, 0.2))
        return True

    def _line(self, error: Exception) -> str:
        text = str(error).encode("utf-8", "replace").decode("utf-8")
        return self._secrets.text(" ".join(text.split()))[:300]

    def _key(self, task: Task) -> dict[str, Any]:
        return {"run_id": self._identity["run_id"], "task_id": task.row["task_id"], "scene": task.row["scene"]}

    def _episode(self, task: Task) -> dict[str, Any]:
        started = time.perf_counter()
        thinking = 0.0
        episode = self._flight.begin(task)
        guarded = self._guarded
        before = time.perf_counter()
        guarded.reset(task.row["task_id"], self._flight.goal)
        thinking += time.perf_counter() - before
        columns: dict[str, list[Any]] = {name: [] for name in _COLUMNS}
        while episode.termination is None:
            observation = self._observe()
            before = time.perf_counter()
            action = guarded.act(observation)
            answer = guarded.answer()
            thinking += time.perf_counter() - before
            episode.step(action)
            values = (action, episode.refused, *episode.position, episode.yaw_rad, episode.distance_m, answer)
            for name, value in zip(_COLUMNS, values, strict=True):
                columns[name].append(value)
        seconds = {"wall_s": time.perf_counter() - started, "agent_s": thinking}
        timing = self._key(task) | seconds
        return {"task_id": task.row["task_id"], "episode": self._row(task), "steps": columns, "timing": timing}

    def _observe(self) -> Observation:
        try:
            return self._flight.observe()
        except Exception as error:
            # A lost context stays lost: the next attempt opens another.
            close_renderers()
            reason = str(error) if isinstance(error, RenderError) else error_location(error)
            raise AgentUnavailable(f"the renderer failed: {reason}", kind="renderer") from error

    def _row(self, task: Task) -> dict[str, Any]:
        row, episode = task.row, self._flight.episode
        radius_m = self._flight.success_radius_m
        view = self._flight.view()
        near = view is not None and view.viewpoint_distance_m <= radius_m and view.target_in_sight
        copied = ("task_id", "nav_id", "scene", "family", "scene_type", "partition", "subset", "split", "setting",
                "modality", "action_budget", "start_x_m", "start_y_m", "start_z_m", "start_yaw_rad")  # fmt: skip
        measured = ("stop_called", "termination", "min_distance_m", "min_horizontal_distance_m", "path_length_m",
                "n_actions", "n_refused", "n_invalid")  # fmt: skip
        return {
            **self._identity,
            **{name: row[name] for name in copied},
            **{name: getattr(episode, name) for name in measured},
            "success": episode.success(radius_m),
            "oracle_success": episode.min_distance_m <= radius_m,
            "collision": episode.termination == "collision",
            "final_distance_m": episode.distance_m,
            "final_horizontal_distance_m": episode.horizontal_distance_m,
            "reference_length_m": task.length_m,
            "euclidean_m": task.euclidean_m,
            "success_view": None if view is None else episode.termination == "stop" and near,
            "viewpoint_distance_m": None if view is None else view.viewpoint_distance_m,
            "target_in_sight": None if view is None else view.target_in_sight,
        }
