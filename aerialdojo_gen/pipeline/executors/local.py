"""Tasks in processes of this machine, or in this one."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.util import Finalize
from typing import Any

from aerialdojo_gen.errors import AerialDojoError
from aerialdojo_gen.pipeline.executors.base import Executor, R, T, Talk, Waiting, guarded
from aerialdojo_gen.pipeline.executors.link import Here, Turns, end

# How often the parent looks at what its workers tell, seconds.
_HEAR_EVERY_S = 0.2


def own_cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class LocalExecutor(Executor):
    """Does work in `workers` processes; in this one where that is 1.

    Parameters
    ----------
    workers : int, optional
        All cores where absent.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers or own_cores()
        # A pool of one process each, so that this side chooses who does what.
        self._lanes: list[ProcessPoolExecutor] = []
        self._line = _Line()

    @property
    def workers(self) -> int:
        """Processes."""
        return self._workers

    def close(self) -> None:
        """End the processes when they have done what they are at."""
        for lane in self._lanes:
            lane.shutdown(wait=True, cancel_futures=True)
        self._lanes.clear()
        end()

    def cancel(self) -> None:
        """End the processes now, and wait until they are gone."""
        for lane in self._lanes:
            for process in list((lane._processes or {}).values()):
                with contextlib.suppress(OSError):
                    process.terminate()
        self.close()

    def run(
        self, work: Callable[..., R], waiting: Waiting[T], *, talk: Talk | None = None, memory_mb: int = 0
    ) -> Iterator[R | AerialDojoError]:
        """Do work on tasks and yield what it returns, or the expected error, in the order of finishing."""
        if self._workers <= 1 or waiting.alone:
            here = Here(talk.hear, talk.stopped) if talk else None
            for task in waiting.one_by_one():
                outcome = guarded(work, task, here)
                waiting.finished(task, outcome)
                yield outcome
            return
        self._start()
        self._line.clear()
        running: dict[Future[R | AerialDojoError], tuple[int, T]] = {}
        idle = list(range(len(self._lanes)))
        try:
            while True:
                # One task a process keeps a Ctrl-C from waiting for what has not begun.
                # The first submit starts the process; it inherits a blocked SIGINT, so that a Ctrl-C while it
                # starts is the parent's alone.
                signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
                try:
                    for lane, task in waiting.give(tuple(idle)):
                        idle.remove(lane)
                        running[self._lanes[lane].submit(_do, work, task, talk is not None)] = (lane, task)
                finally:
                    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
                finished, _ = wait(running, _HEAR_EVERY_S if talk else None, FIRST_COMPLETED)
                if talk:
                    self._line.hear(talk)
                for future in finished:
                    outcome = future.result()
                    lane, task = running.pop(future)
                    idle.append(lane)
                    waiting.finished(task, outcome)
                    yield outcome
                if not running and not waiting:
                    return
        except BrokenProcessPool:
            labels = "; ".join(task.label for _, task in running.values())
            raise AerialDojoError(
                f"a worker process was killed at {labels} (out of memory?): "
                "run again, what was finished is kept; use fewer --workers if memory ran out"
            ) from None

    def _start(self) -> None:
        if self._lanes:
            return
        self._line.open()
        self._lanes = [
            ProcessPoolExecutor(1, mp_context=_CONTEXT, initializer=_begin, initargs=(os.getpid(), self._line))
            for _ in range(self._workers)
        ]


# spawn: FCL, PyBullet and numba hold state that does not survive a fork.
_CONTEXT = multiprocessing.get_context("spawn")


class _Line:
    """The links of all workers of a pool; it is inherited, not sent."""

    _told: Any
    _stop: Any
    _next: Any
    every_s = 0.1

    def open(self) -> None:
        self._told, self._stop = _CONTEXT.SimpleQueue(), _CONTEXT.Event()
        # Of the monotonic clock, which all processes of a machine share.
        self._next = _CONTEXT.Value("d", 0.0)

    def clear(self) -> None:
        self._stop.clear()

    def hear(self, talk: Talk) -> None:
        """Pass on what was told, and what the parent wants."""
        while not self._told.empty():
            talk.hear(self._told.get())
        if talk.stopped():
            self._stop.set()

    def tell(self, message: object) -> None:
        self._told.put(message)

    def stopped(self) -> bool:
        return bool(self._stop.is_set())

    def turn(self, interval_s: float) -> float:
        with self._next.get_lock():
            turns, now = Turns(self._next.value), time.monotonic()
            wait_s = turns.take(interval_s, now)
            self._next.value = turns.next
        return wait_s


# A worker process's link, from its start on.
_own: list[_Line] = []


def _begin(parent: int, line: _Line) -> None:
    # Ctrl-C goes to the whole process group: the parent alone answers it, and ends the workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A worker must not outlive a parent that was killed with SIGKILL.
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        # It may have been killed before the line above, while this process was starting.
        if os.getppid() != parent:
            os._exit(1)
    _own.append(line)
    Finalize(None, end, exitpriority=1)


def _do(work: Callable[..., R], task: Any, linked: bool) -> R | AerialDojoError:
    return guarded(work, task, _own[0] if linked else None)
