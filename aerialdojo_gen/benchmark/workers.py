"""Workers of an evaluation: in this process, or in several."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.util import Finalize
from typing import TYPE_CHECKING, Any

from aerialdojo_gen.agents import load_agent
from aerialdojo_gen.agents.goal import Sensors
from aerialdojo_gen.benchmark.flight import Flight
from aerialdojo_gen.benchmark.pace import Pace
from aerialdojo_gen.benchmark.worker import Finished, Unit, Worker
from aerialdojo_gen.common.secrets import Secrets
from aerialdojo_gen.errors import AerialDojoError, UsageError
from aerialdojo_gen.pipeline.executors.local import start_worker
from aerialdojo_gen.store.root import DataRoot

if TYPE_CHECKING:
    from aerialdojo_gen.benchmark.runner import Evaluation


@contextlib.contextmanager
def worker(data: DataRoot, evaluation: Evaluation, pace: Pace | None = None) -> Iterator[Worker]:
    """Make an agent and what it flies in; the agent is closed at the end.

    Raises
    ------
    UsageError
        There is no such agent, or its requests are to be paced and it does not let them.
    """
    agent: Any = load_agent(evaluation.agent, **evaluation.options)
    if pace is not None:
        if not hasattr(agent, "pace"):
            raise UsageError(f"agent {evaluation.agent!r} has no pace to be set: leave --requests-per-minute out")
        agent.pace = pace.wait
    wanted: Any = getattr(agent, "sensors", None)
    sensors = evaluation.sensors or (wanted if isinstance(wanted, Sensors) else Sensors())
    flight = Flight(data, sensors, embodiment=evaluation.embodiment, renderer=evaluation.renderer)
    secrets = Secrets(evaluation.options)
    try:
        yield Worker(agent, flight, data, evaluation.identity(), evaluation.conditions, secrets)
    finally:
        close: Any = getattr(agent, "close", None)
        if close is not None:
            # What it raises now is of no episode: all of them are in the log.
            with contextlib.suppress(Exception):
                close()


def fly_units(
    data: DataRoot,
    evaluation: Evaluation,
    units: Sequence[Unit],
    workers: int,
    tell: Callable[[Finished], None],
    stopped: Callable[[], bool],
) -> Iterator[str]:
    """Fly units, and yield a scene when all of its units are through.

    Parameters
    ----------
    data : DataRoot
    evaluation : Evaluation
    units : sequence of Unit
    workers : int
        Processes; 1 is this one.
    tell : callable
        Called in this process after every episode.
    stopped : callable
        Asked now and then in this process; no episode is begun once it is True. It may raise, to end everything.

    Raises
    ------
    AerialDojoError
        An expected failure, or a worker was killed.
    """
    left = Counter(unit.scene for unit in units)
    flown = _here if workers <= 1 or len(units) <= 1 else _in_processes
    for unit in flown(data, evaluation, units, workers, tell, stopped):
        left[unit.scene] -= 1
        if not left[unit.scene]:
            yield unit.scene


def _here(
    data: DataRoot,
    evaluation: Evaluation,
    units: Sequence[Unit],
    _workers: int,
    tell: Callable[[Finished], None],
    stopped: Callable[[], bool],
) -> Iterator[Unit]:
    with worker(data, evaluation, Pace.of(evaluation.requests_per_minute)) as mine:
        for unit in units:
            mine.fly(unit, tell, stopped)
            yield unit


# What a worker process works with, from its start on.
_ours: dict[str, Any] = {}


def _start(parent: int, data: DataRoot, evaluation: Evaluation, told: Any, stop: Any, pace: Pace | None) -> None:
    start_worker(parent)
    _ours.update(data=data, evaluation=evaluation, told=told, stop=stop, pace=pace)


def _fly(unit: Unit) -> AerialDojoError | None:
    try:
        if "worker" not in _ours:
            # Kept for the process's life: an agent may hold a model, and the flight holds scenes.
            stack = contextlib.ExitStack()
            _ours["worker"] = stack.enter_context(worker(_ours["data"], _ours["evaluation"], _ours["pace"]))
            Finalize(None, stack.close, exitpriority=1)
        with _Teller(_ours["told"]) as teller:
            _ours["worker"].fly(unit, teller.tell, _ours["stop"].is_set)
    except AerialDojoError as error:
        return error
    return None


class _Teller:
    """Tells the parent what was finished, ten times a second at most, and what is left at its end."""

    def __init__(self, told: Any) -> None:
        self._told, self._sum, self._last = told, Finished(), time.monotonic()

    def tell(self, finished: Finished) -> None:
        self._sum += finished
        if time.monotonic() - self._last >= 0.1:
            self._send()

    def _send(self) -> None:
        self._told.put(self._sum)
        self._sum, self._last = Finished(), time.monotonic()

    def __enter__(self) -> _Teller:
        return self

    def __exit__(self, *_: object) -> None:
        self._send()


def _in_processes(
    data: DataRoot,
    evaluation: Evaluation,
    units: Sequence[Unit],
    workers: int,
    tell: Callable[[Finished], None],
    stopped: Callable[[], bool],
) -> Iterator[Unit]:
    context = multiprocessing.get_context("spawn")
    told, stop = context.SimpleQueue(), context.Event()
    executor = ProcessPoolExecutor(
        min(workers, len(units)),
        mp_context=context,
        initializer=_start,
        initargs=(os.getpid(), data, evaluation, told, stop, Pace.of(evaluation.requests_per_minute, context)),
    )

    def hear() -> None:
        while not told.empty():
            tell(told.get())
        if stopped():
            stop.set()

    try:
        # Processes inherit a blocked SIGINT, so that a Ctrl-C while they start is the parent's alone.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            running: dict[Future[AerialDojoError | None], Unit] = {
                executor.submit(_fly, unit): unit for unit in units
            }
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        while running:
            done, _ = wait(running, timeout=0.2, return_when=FIRST_COMPLETED)
            hear()
            for future in done:
                error = future.result()
                if error is not None:
                    raise error
                yield running.pop(future)
        hear()
    except BrokenProcessPool:
        raise AerialDojoError(
            "a worker process was killed (out of memory?): run again, finished episodes are kept; "
            "use fewer --workers if memory ran out"
        ) from None
    except BaseException:
        for process in list((executor._processes or {}).values()):
            with contextlib.suppress(OSError):
                process.terminate()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)
