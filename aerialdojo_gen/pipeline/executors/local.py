"""Tasks in processes of this machine, or in this one.

A worker process and its parent talk by a pipe alone. Semaphores would need a ``/dev/shm`` that can be written, and a
parent that was killed would leave them behind.
"""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection, wait
from multiprocessing.reduction import ForkingPickler
from typing import Any

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.pipeline.executors.base import Executor, ParentChannel, R, T, TaskQueue, guarded
from aerialdojo_gen.pipeline.executors.link import InProcessChannel, RateLimiter, end

# How often the parent looks whether workers are to stop, seconds.
_LOOK_EVERY_S = 0.2
# How long a worker that was terminated may take to end before it is killed, seconds.
_END_WITHIN_S = 5.0
# spawn: FCL, PyBullet and numba hold state that does not survive a fork.
_CONTEXT = multiprocessing.get_context("spawn")


def own_cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class LocalExecutor(Executor):
    """Does work in `workers` processes; in this one where that is 1."""

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers or own_cores()
        self._lanes: dict[int, _Lane] = {}

    @property
    def workers(self) -> int:
        """Processes."""
        return self._workers

    def close(self) -> None:
        """End the processes when they have done what they are at."""
        for lane in self._lanes.values():
            lane.pipe.close()
        try:
            for lane in self._lanes.values():
                lane.process.join()
        except KeyboardInterrupt:
            self.cancel()
            raise
        self._lanes.clear()
        end()

    def cancel(self) -> None:
        """End the processes now; one that does not end by itself (stopped, or waiting for a disk) is killed."""
        lanes = [*self._lanes.values()]
        self._lanes.clear()
        for lane in lanes:
            lane.process.terminate()
            lane.pipe.close()
        try:
            until = time.monotonic() + _END_WITHIN_S
            for lane in lanes:
                lane.process.join(max(0.0, until - time.monotonic()))
        finally:
            for lane in lanes:
                lane.process.kill()
            for lane in lanes:
                lane.process.join(_END_WITHIN_S)
        end()

    def run(
        self, work: Callable[..., R], waiting: TaskQueue[T], *, talk: ParentChannel | None = None, memory_mb: int = 0
    ) -> Iterator[R | AerialDojoError]:
        """Do work on tasks and yield what it returns, or the expected error, in the order of finishing."""
        if self._workers <= 1 or waiting.alone:
            here = InProcessChannel(talk.hear, talk.stopped) if talk else None
            for task in waiting.one_by_one():
                outcome = guarded(work, task, here)
                waiting.on_done(task, outcome)
                yield outcome
            return
        turns, running, stopping = RateLimiter(), dict[int, T](), set[int]()
        try:
            while True:
                # One task a process keeps a Ctrl-C from waiting for what has not begun.
                for number, task in waiting.give([n for n in range(self._workers) if n not in running]):
                    running[number] = task
                    stopping.discard(number)
                    self._lane(number).send((work, task, talk is not None))
                pipes = {self._lanes[number].pipe: number for number in running}
                ready = wait([*pipes], _LOOK_EVERY_S if talk else None)
                if talk and talk.stopped():
                    for number in running.keys() - stopping:
                        stopping.add(number)
                        self._lanes[number].send(_STOP)
                for number in (pipes[pipe] for pipe in ready if isinstance(pipe, Connection)):
                    match self._lanes[number].receive():
                        case "told", message:
                            if talk:
                                talk.hear(message)
                        case "turn", interval_s:
                            self._lanes[number].send(turns.take(interval_s, time.monotonic()))
                        case "raised", error, origin:
                            raise error from RuntimeError(f"in a worker process\n{origin}")
                        case "done", outcome:
                            waiting.on_done(running.pop(number), outcome)
                            yield outcome
                if not running and not waiting:
                    return
        except _LostError:
            labels = "; ".join(task.label for task in running.values())
            raise AerialDojoError(
                f"a worker process was killed at {labels} (out of memory?): "
                "run again, what was finished is kept; use fewer --workers if memory ran out"
            ) from None
        finally:
            if running:
                # What they still send is of no run that follows.
                self.cancel()

    def _lane(self, number: int) -> _Lane:
        """Return a worker process, started by its first task."""
        if number not in self._lanes:
            self._lanes[number] = _Lane()
        return self._lanes[number]


class _LostError(Exception):
    """A worker process is gone."""


class _Lane:
    """A worker process that does one task at a time, and this end of its pipe."""

    def __init__(self) -> None:
        self.pipe, theirs = _CONTEXT.Pipe()
        self.process = _CONTEXT.Process(target=_serve, args=(os.getpid(), theirs))
        # It inherits a blocked SIGINT, so that a Ctrl-C while it starts is the parent's alone.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()

    def send(self, message: object) -> None:
        try:
            self.pipe.send(message)
        except ConnectionError:
            raise _LostError from None

    def receive(self) -> Any:
        try:
            return self.pipe.recv()
        except (EOFError, ConnectionError):
            raise _LostError from None


# Sent to a worker that is to begin nothing more.
_STOP = "stop"


class _PipeLink:
    """The link of a worker process."""

    every_s = 0.1

    def __init__(self, pipe: Connection[Any, Any]) -> None:
        self._pipe, self._stopped = pipe, False

    def tell(self, message: object) -> None:
        self._pipe.send(("told", message))

    def stopped(self) -> bool:
        # The parent sends nothing else while nobody waits for a turn.
        if not self._stopped and self._pipe.poll():
            self._stopped = self._pipe.recv() == _STOP
        return self._stopped

    def turn(self, interval_s: float) -> float:
        self._pipe.send(("turn", interval_s))
        while (answer := self._pipe.recv()) == _STOP:
            self._stopped = True
        return float(answer)


def _serve(parent: int, pipe: Connection[Any, Any]) -> None:
    """Do tasks until the parent closes the pipe or is gone."""
    # Ctrl-C goes to the whole process group: the parent alone answers it, and ends the workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A worker must not outlive a parent that was killed with SIGKILL.
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        # It may have been killed before the line above, while this process was starting.
        if os.getppid() != parent:
            os._exit(1)
    try:
        with contextlib.suppress(EOFError, ConnectionError):
            while True:
                message = pipe.recv()
                if message != _STOP:
                    pipe.send_bytes(_answer(pipe, *message))
    finally:
        end()


def _answer(pipe: Connection[Any, Any], work: Callable[..., Any], task: Any, linked: bool) -> memoryview:
    """Do work on a task; gives the message that tells how it ended."""
    try:
        return ForkingPickler.dumps(("done", guarded(work, task, _PipeLink(pipe) if linked else None)))
    except BaseException as error:
        text = traceback.format_exc()
        try:
            message = ForkingPickler.dumps(("raised", error, text))
            ForkingPickler.loads(message)
        except Exception:
            return ForkingPickler.dumps(("raised", RuntimeError(f"{type(error).__name__}: {error}"), text))
        return message
