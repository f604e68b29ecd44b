"""A person as an agent: the evaluator's loop runs in one thread, and waits there for what the page sends."""

from __future__ import annotations

import re
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import AerialDojoError, RenderError, UsageError
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents import AgentBase
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Sensors
from aerialdojo_gen.benchmark.evaluation import Evaluation
from aerialdojo_gen.benchmark.runner import RunLog
from aerialdojo_gen.benchmark.worker import Finished, RetryPolicy, Worker
from aerialdojo_gen.rendering.gl import release_context
from aerialdojo_gen.store.root import Where, open_root

_NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,39}")
# How long a request waits for the picture after its action; the page asks again.
_PATIENCE_S = 20.0


def agent_name(name: str) -> str:
    """Return the agent of a person's run; UsageError for a name that is no slug."""
    if not _NAME.fullmatch(name):
        raise UsageError(f"--name {name[:60]!r}: use small letters, digits and - (40 at most), such as pilot-1")
    return f"human:{name}"


class _ClosingError(AerialDojoError):
    """The command ends: the flight under way is not logged."""


class StaleError(AerialDojoError):
    """A request is for a state that the session has left, e.g. a key pressed twice."""


class Session(AgentBase):
    """A person's run: the agent that asks the person, the loop that flies it, and the state that the page shows."""

    def __init__(self, data: Where, evaluation: Evaluation, out: Where | None = None) -> None:
        self._data, log = open_root(data), open_root(data if out is None else out)
        self._evaluation = evaluation
        self._run = RunLog(self._data, log, evaluation)
        self.sensors = evaluation.sensors or Sensors()
        self._flight = evaluation.flight_of(self, self._data)
        self._goal: Goal | None = None
        self._observation: Observation | None = None
        self._next_scene = ""
        self.error: Exception | None = None
        self._changed = threading.Condition()
        self._choice: str | int | None = None
        self._closing = False
        self._state: dict[str, Any] = {
            "version": 0, "phase": "busy", "agent": evaluation.agent, "run": evaluation.run, "log": str(log),
        }  # fmt: skip

    def state(self) -> dict[str, Any]:
        """Return what the page shows."""
        with self._changed:
            return dict(self._state)

    def submit(self, version: int, choice: str | int) -> dict[str, Any]:
        """Hand the loop the person's choice, and return the state after it; StaleError if that is not asked for."""
        with self._changed:
            phase = self._state["phase"]
            fits = phase == "flying" if isinstance(choice, int) else (phase, choice) in _BUTTONS
            if version != self._state["version"] or not fits:
                raise StaleError("the page was behind: nothing was done")
            self._choice = choice
            self._set(version=version + 1, phase="busy")
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._state["phase"] != "busy" or self._closing, _PATIENCE_S)
            return dict(self._state)

    def picture(self, view: str) -> NDArray[np.uint8]:
        """Return what a camera shows, (H, W, 3) uint8, or the goal's picture; UsageError if there is none."""
        shown = {} if self._observation is None else self._observation.rgb
        image = self._goal.image if self._goal is not None and view == "goal" else shown.get(view)
        if image is None:
            raise UsageError(f"there is no picture {view[:20]!r}")
        return image

    def depth_m(self, view: str) -> NDArray[np.float32]:
        """Return a camera's depth, (H, W) float32 metres, 0 where nothing is in range; UsageError without one."""
        if self._observation is None or view not in self._observation.depth_m:
            raise UsageError(f"there is no depth of {view[:20]!r}")
        return self._observation.depth_m[view]

    def counts(self) -> tuple[int, int]:
        """Return the numbers of tasks flown and of successes, in the tables."""
        finished, _, successes = self._run.counts()
        return finished, successes

    def reset(self, goal: Goal) -> None:
        """Begin a flight, called by the evaluator's worker."""
        self._goal = goal

    def act(self, observation: Observation) -> int:
        """Show an observation and return the person's action, called by the evaluator's worker."""
        assert self._goal is not None
        self._observation = observation
        if not observation.step:
            self._flight.prefetch_scene(self._next_scene)
            self._set(last=None, result=None, goal=_goal_state(self._goal))
        chosen = int(self._wait("flying", step=observation.step, remaining_actions=observation.remaining_actions,
                                refused=observation.refused))  # fmt: skip
        self._set(last=chosen)
        return chosen

    @contextmanager
    def running(self, restart: bool = False) -> Iterator[None]:
        """Hold the run, and fly in a thread of its own until the block ends: a renderer belongs to its thread."""
        with self._run.folder.lock():
            if restart:
                self._run.drop()
            self._run.check_settings()
            self._run.flush_journals()
            thread = threading.Thread(target=self._loop, name="flight")
            thread.start()
            try:
                yield
            finally:
                with self._changed:
                    self._closing = True
                    self._changed.notify_all()
                thread.join()

    def _loop(self) -> None:
        try:
            self._fly_all()
        except _ClosingError:
            pass
        except Exception as error:
            self.error = error
            defect = "an unexpected error: end the command, and the terminal shows it"
            self._show("failed", error=str(error) if isinstance(error, AerialDojoError) else defect)
        finally:
            self._flight.close()
            release_context()

    def _fly_all(self) -> None:
        # A task that the renderer failed at is offered again, unlike one that was flown.
        left = pa.concat_tables([self._run.todo(False), self._run.todo(True)])
        left = left.take(_spread(left, self._evaluation.selection.seed))
        # One attempt: a second one would begin in the middle of the person's flight.
        worker = Worker(self, self._flight, self._data, self._evaluation.identity(), RetryPolicy(1), Secrets())
        scenes = [*left["scene"].to_pylist(), ""]
        self._count()
        if left.num_rows:
            self._wait("consent")
        for k in range(left.num_rows):
            if k:
                self._wait("ended")
            self._next_scene = scenes[k + 1] or scenes[k]
            done: list[Finished] = []
            (unit,) = self._run.units(left.slice(k, 1), 1)
            worker.fly(unit, done.append, lambda: False)
            self._run.flush_journals(unit.scene)
            for failed in done[0].streak:
                raise RenderError(f"{failed.reason}; the same command offers this task again")
            episode = self._flight.episode
            success = episode.success(self._flight.success_radius_m)
            ended = {"termination": episode.termination, "success": success, "n_actions": episode.n_actions}
            self._set(result=ended | {"distance_m": round(episode.distance_m, 2)})
            self._count()
        self._show("done")

    def _count(self) -> None:
        finished, successes = self.counts()
        self._set(selected=self._run.rows.num_rows, flown=finished, successes=successes)

    def _set(self, **fields: Any) -> None:
        with self._changed:
            self._state |= fields

    def _show(self, phase: str, **fields: Any) -> None:
        with self._changed:
            self._set(version=self._state["version"] + 1, phase=phase, **fields)
            self._changed.notify_all()

    def _wait(self, phase: str, **fields: Any) -> str | int:
        with self._changed:
            self._choice = None
            self._show(phase, **fields)
            self._changed.wait_for(lambda: self._choice is not None or self._closing)
            if self._choice is None:
                raise _ClosingError("the command has ended")
            return self._choice


# What may be chosen where, beside the actions of a flight.
_BUTTONS = {("consent", "agree"), ("ended", "next")}


def _spread(tasks: pa.Table, seed: int) -> pa.Array:
    """Order tasks so that whenever the person ends, all scenes have as many flights: one of each, then a second."""
    scenes, task_ids = tasks["scene"].to_pylist(), tasks["task_id"].to_pylist()
    turns, keys = Counter[str](), []
    for i in sorted(range(len(task_ids)), key=lambda i: rng.rank(seed, "fly", task_ids[i])):
        keys.append((turns[scenes[i]], rng.rank(seed, "fly", scenes[i]), i))
        turns[scenes[i]] += 1
    return pa.array([i for _, _, i in sorted(keys)], pa.int64())


def _goal_state(goal: Goal) -> dict[str, Any]:
    rules, names = goal.rules, ("target_name", "landmark", "direction", "description")
    return {
        **{name: getattr(goal, name) for name in names},
        "has_image": goal.image is not None,
        "image_distance_m": goal.image_distance_m,
        "heading": goal.heading and asdict(goal.heading),
        "action_budget": rules.action_budget,
        "success_radius_m": rules.success_radius_m,
        "max_depth_m": rules.sensors.max_depth_m,
    }
