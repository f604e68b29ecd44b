"""Tasks in processes of this machine, or in this process.

A worker and its parent communicate by a pipe. Semaphores would need a writable ``/dev/shm``, and a killed parent
would leave them behind.
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

from aerialdojo_gen.base import memory
from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.pipeline.executors.base import Executor, R, T, TaskQueue, end, guarded

# How often the parent checks whether workers must stop, seconds.
_POLL_S = 0.2
# Time from termination to a kill, seconds.
_STOP_TIMEOUT_S = 5.0
# spawn: FCL, PyBullet and numba hold state that does not survive a fork.
_CONTEXT = multiprocessing.get_context("spawn")


def own_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class LocalExecutor(Executor):
    """Runs tasks in `workers` processes; in this process if that is 1."""

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers or own_cores()
        self._lanes: dict[int, _Lane] = {}

    @property
    def workers(self) -> int:
        """Number of processes."""
        return self._workers

    def close(self) -> None:
        """End the processes after their current tasks."""
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
        """Terminate the processes; one that does not end (stopped, or waiting for a disk) is killed."""
        lanes = [*self._lanes.values()]
        self._lanes.clear()
        for lane in lanes:
            lane.process.terminate()
            lane.pipe.close()
        try:
            until = time.monotonic() + _STOP_TIMEOUT_S
            for lane in lanes:
                lane.process.join(max(0.0, until - time.monotonic()))
        finally:
            for lane in lanes:
                lane.process.kill()
            for lane in lanes:
                lane.process.join(_STOP_TIMEOUT_S)
        end()

    def run(self, work: Callable[..., R], waiting: TaskQueue[T]) -> Iterator[R | AerialDojoError]:
        """Run tasks and yield results or expected errors in completion order."""
        channel = waiting.channel
        if self._workers <= 1 or waiting.alone:
            while (task := waiting.take(0)) is not None:
                outcome = guarded(work, task, channel)
                waiting.on_done(task, outcome)
                yield outcome
            return
        running, stopping = dict[int, T](), set[int]()
        try:
            while True:
                # One task per process: a Ctrl-C does not wait for queued tasks.
                for number, task in waiting.give([n for n in range(self._workers) if n not in running]):
                    running[number] = task
                    stopping.discard(number)
                    self._lane(number).send((work, task, channel is not None))
                pipes = {self._lanes[number].pipe: number for number in running}
                ready = wait([*pipes], _POLL_S if channel else None)
                if channel and channel.stopped():
                    for number in running.keys() - stopping:
                        stopping.add(number)
                        self._lanes[number].send(_STOP)
                for number in (pipes[pipe] for pipe in ready if isinstance(pipe, Connection)):
                    match self._lanes[number].receive():
                        case "message", message if channel:
                            channel.send(message)
                        case "turn", interval_s if channel:
                            self._lanes[number].send(channel.turn(interval_s))
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
                # Their remaining messages must not reach a later run.
                self.cancel()

    def _lane(self, number: int) -> _Lane:
        """Return a worker process; it starts with its first task."""
        if number not in self._lanes:
            self._lanes[number] = _Lane()
        return self._lanes[number]


class _LostError(Exception):
    """A worker process is gone."""


class _Lane:
    """A worker process and this end of its pipe."""

    def __init__(self) -> None:
        self.pipe, child_end = _CONTEXT.Pipe()
        self.process = _CONTEXT.Process(target=_serve, args=(os.getpid(), child_end))
        # It inherits a blocked SIGINT: the parent alone handles a Ctrl-C while it starts.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        child_end.close()

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


# Tells a worker to start nothing more.
_STOP = "stop"


class _PipeChannel:
    """The channel of a worker process."""

    every_s = 0.1

    def __init__(self, pipe: Connection[Any, Any]) -> None:
        self._pipe, self._stopped = pipe, False

    def send(self, message: object) -> None:
        self._pipe.send(("message", message))

    def stopped(self) -> bool:
        # The parent sends nothing else unless the worker waits for a turn.
        if not self._stopped and self._pipe.poll():
            self._stopped = self._pipe.recv() == _STOP
        return self._stopped

    def turn(self, interval_s: float) -> float:
        self._pipe.send(("turn", interval_s))
        while (answer := self._pipe.recv()) == _STOP:
            self._stopped = True
        return float(answer)


def _serve(parent: int, pipe: Connection[Any, Any]) -> None:
    """Run tasks until the parent closes the pipe or is gone."""
    memory.set_up()
    # Ctrl-C goes to the whole process group: the parent alone handles it, and ends the workers.
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


def _answer(pipe: Connection[Any, Any], work: Callable[..., Any], task: Any, has_channel: bool) -> memoryview:
    """Run a task; returns the message with its result."""
    try:
        return ForkingPickler.dumps(("done", guarded(work, task, _PipeChannel(pipe) if has_channel else None)))
    except BaseException as error:
        text = traceback.format_exc()
        try:
            message = ForkingPickler.dumps(("raised", error, text))
            ForkingPickler.loads(message)
        except Exception:
            return ForkingPickler.dumps(("raised", RuntimeError(f"{type(error).__name__}: {error}"), text))
        return message
