"""Worker processes of an evaluation: what each creates once, and how an executor runs work units."""

from __future__ import annotations

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from aerialdojo_gen.base.errors import AerialDojoError, UsageError
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents import load_agent
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.evaluation import Evaluation
from aerialdojo_gen.benchmark.flight import Flight
from aerialdojo_gen.benchmark.worker import Finished, Worker, WorkUnit
from aerialdojo_gen.dataset.contents import release_fingerprint
from aerialdojo_gen.pipeline.executors.base import Executor, ParentChannel, WorkerChannel, at_end
from aerialdojo_gen.store.root import DataRoot

# Assumed memory per process, megabytes, without an agent's model.
MEMORY_MB = 1000


@contextlib.contextmanager
def worker(data: DataRoot, evaluation: Evaluation, link: WorkerChannel) -> Iterator[Worker]:
    """Make a worker with its agent, which is closed at the end."""
    agent: Any = load_agent(evaluation.agent, **evaluation.options)
    if evaluation.requests_per_minute is not None:
        if not hasattr(agent, "pace"):
            raise UsageError(f"agent {evaluation.agent!r} has no attribute pace: leave --requests-per-minute out")
        # Requests of all workers are spaced evenly.
        interval_s = 60.0 / evaluation.requests_per_minute
        agent.pace = lambda: time.sleep(link.turn(interval_s))
    suits: Any = getattr(agent, "suits", None)
    if suits is not None:
        suits(release_fingerprint(data))
    wanted: Any = getattr(agent, "sensors", None)
    sensors = evaluation.sensors or (wanted if isinstance(wanted, Sensors) else Sensors())
    body, renderer, hints = evaluation.embodiment, evaluation.renderer, evaluation.hints
    flight = Flight(data, sensors, embodiment=body, renderer=renderer, hints=hints)
    secrets = Secrets(evaluation.options)
    try:
        yield Worker(agent, flight, data, evaluation.identity(), evaluation.retry_policy, secrets)
    finally:
        close: Any = getattr(agent, "close", None)
        if close is not None:
            # All episodes are in the log: errors here do not matter.
            with contextlib.suppress(Exception):
                close()


def fly_units(
    data: DataRoot, evaluation: Evaluation, units: Sequence[WorkUnit], executor: Executor,
    on_finished: Callable[[Finished], None], stopped: Callable[[], bool],
) -> Iterator[str]:  # fmt: skip
    """Fly units, and yield a scene when all of its units are finished."""
    left = Counter(unit.scene for unit in units)
    fly, channel = partial(_fly, data, evaluation), ParentChannel(on_finished, stopped)
    for outcome in executor.map(fly, units, lambda unit: unit.scene, channel=channel, memory_mb=MEMORY_MB):
        if isinstance(outcome, AerialDojoError):
            raise outcome
        left[outcome] -= 1
        if not left[outcome]:
            yield outcome


# This process's worker, made at its first unit: an agent may hold a model, and the flight holds scenes.
_worker_of_process: dict[str, Worker] = {}


def _fly(data: DataRoot, evaluation: Evaluation, unit: WorkUnit, link: WorkerChannel) -> str:
    if "worker" not in _worker_of_process:
        stack = contextlib.ExitStack()
        at_end(_worker_of_process.clear)
        at_end(stack.close)
        _worker_of_process["worker"] = stack.enter_context(worker(data, evaluation, link))
    unsent, last = Finished(), time.monotonic()

    def add(finished: Finished) -> None:
        nonlocal unsent, last
        unsent += finished
        if time.monotonic() - last >= link.every_s:
            link.send(unsent)
            unsent, last = Finished(), time.monotonic()

    try:
        _worker_of_process["worker"].fly(unit, add, link.stopped)
    finally:
        if unsent.episodes:
            link.send(unsent)
    return unit.scene
