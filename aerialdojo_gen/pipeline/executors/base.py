"""The interface of executors: tasks in, results out in completion order.

Nothing heavy is imported: every worker process starts with this.
"""

from __future__ import annotations

import contextlib
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Protocol, TypeVar

from aerialdojo_gen.base.errors import AerialDojoError, UsageError
from aerialdojo_gen.store.root import DataRoot, LocalRoot


class WorkerChannel(Protocol):
    """A worker's channel to its parent."""

    every_s: float  # Least interval of messages, seconds; 0 if they are free

    def send(self, message: object) -> None:
        """Send a small message to the parent while the task runs."""

    def stopped(self) -> bool:
        """Whether the parent has asked to start nothing more."""

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait; turns of all workers are at least `interval_s` apart."""


class RateLimiter:
    """Gives out turns at even intervals."""

    def __init__(self) -> None:
        self._next = 0.0

    def take(self, interval_s: float) -> float:
        """Return how many seconds to wait for the next turn."""
        now = time.monotonic()
        at = max(now, self._next)
        self._next = at + interval_s
        return at - now


_closers: list[Callable[[], object]] = []


def at_end(close: Callable[[], object]) -> None:
    """Register a callback for the end of this process's work for its executor."""
    _closers.append(close)


def end() -> None:
    """Call the registered callbacks, the last first; their errors are ignored."""
    while _closers:
        with contextlib.suppress(Exception):
            _closers.pop()()


EXECUTORS = ("local", "ray")


class Labelled(Protocol):
    """A picklable task; ``moved(place)`` of one with paths of `SharedPaths.bundled` puts ``place(path)`` for each."""

    @property
    def label(self) -> str:
        """The task's name in messages."""


T = TypeVar("T", bound=Labelled)
R = TypeVar("R")


@dataclass(frozen=True)
class SharedPaths:
    """The folders that tasks refer to."""

    shared: tuple[Path, ...] = ()  # On a file system that all machines share
    bundled: tuple[Path, ...] = ()  # Read only, sent to other machines
    written: tuple[Path, ...] = ()  # Those of `shared`, or in them, that the run locks and writes to
    say: Callable[[str], None] = print  # Called with a line on what a run waits for


def on_disk(*places: Path | DataRoot, below: str = "") -> tuple[Path, ...]:
    """Return the places, or the folders `below` them, that are on a file system and not in an object store."""
    paths = (place.path if isinstance(place, LocalRoot) else place for place in places)
    return tuple(path / below for path in paths if isinstance(path, Path))


@dataclass
class ParentChannel:
    """The parent's side of its workers' channels, and the channel of a worker in this process."""

    send: Callable[[Any], None]  # Called in this process with a worker's message
    stopped: Callable[[], bool]
    every_s: float = 0.0
    turn: Callable[[float], float] = field(default_factory=lambda: RateLimiter().take)


class Executor(ABC):
    """Runs tasks in processes that start with the first task and end with the block, at once on an error."""

    def __enter__(self) -> Executor:
        """Return self."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes, immediately on an error."""
        if kind is None:
            self.close()
        else:
            self.cancel()

    @property
    @abstractmethod
    def workers(self) -> int:
        """Number of processes."""

    def map(
        self,
        work: Callable[..., R],
        tasks: Sequence[T],
        scene_of: Callable[[T], str] | None = None,
        *,
        channel: ParentChannel | None = None,
        memory_mb: int = 0,
    ) -> Iterator[R | AerialDojoError]:
        """Run tasks that are known from the start: `run` of a `TaskQueue`."""
        return self.run(work, TaskQueue(tasks, scene_of, channel, memory_mb))

    @abstractmethod
    def run(self, work: Callable[..., R], waiting: TaskQueue[T]) -> Iterator[R | AerialDojoError]:
        """Run tasks and yield results or expected errors in completion order."""

    @abstractmethod
    def close(self) -> None:
        """End the processes after their current tasks."""

    @abstractmethod
    def cancel(self) -> None:
        """Terminate the processes, and wait for them."""


def guarded(work: Callable[..., R], task: Any, channel: WorkerChannel | None) -> R | AerialDojoError:
    """Run a task; an expected error is returned."""
    try:
        return work(task) if channel is None else work(task, channel)
    except AerialDojoError as error:
        return error


def make_executor(
    name: str, workers: int | None = None, address: str | None = None, folders: SharedPaths | None = None
) -> Executor:
    """Create an executor; it starts nothing yet."""
    if name not in EXECUTORS:
        raise UsageError(f"unknown executor {name!r}; executors: {', '.join(EXECUTORS)}")
    if name == "ray":
        from aerialdojo_gen.pipeline.executors.ray import RayExecutor

        return RayExecutor(workers, address, folders or SharedPaths())
    if address is not None:
        raise UsageError("--address needs --executor ray")
    from aerialdojo_gen.pipeline.executors.local import LocalExecutor

    return LocalExecutor(workers)


class TaskQueue(Generic[T]):
    """Tasks not started yet, by scene, with what all of them need."""

    def __init__(
        self,
        tasks: Sequence[T],
        scene_of: Callable[[T], str] | None,
        channel: ParentChannel | None = None,
        memory_mb: int = 0,
    ) -> None:
        self.channel, self.memory_mb = channel, memory_mb  # Of each process: megabytes that it takes at most
        self._scene_of = scene_of or (lambda _: "")
        self._scenes: dict[str, deque[T]] = {}
        self._add(tasks)
        self._at: dict[int, str] = {}
        self._alone = len(tasks) <= 1

    def __len__(self) -> int:
        return sum(map(len, self._scenes.values()))

    @property
    def alone(self) -> bool:
        """Whether there is never more than one task at a time, so that one process suffices."""
        return self._alone

    def give(self, idle: Sequence[int]) -> Iterator[tuple[int, T]]:
        """Yield the next tasks of idle processes, first for those that stay with their scene."""
        for lane in sorted(idle, key=lambda lane: self._at.get(lane) not in self._scenes):
            task = self.take(lane)
            if task is not None:
                yield lane, task

    def take(self, lane: int) -> T | None:
        """Return a process's next task: of its scene, else of one without a process, else of the heaviest."""
        scene = self._at.get(lane)
        if scene not in self._scenes:
            others = {at for other, at in self._at.items() if other != lane}
            free = [name for name in self._scenes if name not in others]
            names = free or [name for name in self._scenes if self._should_join(name)]
            if not names:
                return None
            scene = max(names, key=self._weight)
        self._at[lane] = scene
        return self._pop(scene)

    def on_done(self, task: T, outcome: Any) -> None:
        """Record a task's result or expected error."""

    def requeue(self, task: T) -> None:
        """Queue a task again whose process is gone, as the first of its scene."""
        self._scenes.setdefault(self._scene_of(task), deque()).appendleft(task)

    def leave(self, lane: int) -> None:
        """Forget the scene of a process that is gone."""
        self._at.pop(lane, None)

    def _add(self, tasks: Sequence[T]) -> None:
        for task in tasks:
            self._scenes.setdefault(self._scene_of(task), deque()).append(task)

    def _pop(self, scene: str) -> T:
        task = self._scenes[scene].popleft()
        if not self._scenes[scene]:
            del self._scenes[scene]
        return task

    def _weight(self, scene: str) -> float:
        """Work left for a scene: the heaviest goes first."""
        return len(self._scenes[scene])

    def _should_join(self, _scene: str) -> bool:
        """Whether a second process should work on a scene."""
        return True
