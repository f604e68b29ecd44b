"""The executor's interface: tasks go in, results come back in the order of finishing, wherever they are computed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Protocol, TypeVar

from aerialdojo_gen.base.errors import AerialDojoError, UsageError
from aerialdojo_gen.pipeline.executors.link import WorkerChannel
from aerialdojo_gen.store.root import DataRoot, LocalRoot

EXECUTORS = ("local", "ray")


class Labelled(Protocol):
    """A task: a picklable thing with a name for messages.

    Where it holds paths of folders that are carried to other machines (`Folders.carried`), it has besides a method
    ``moved(place)`` that returns it with ``place(path)`` in their stead.
    """

    @property
    def label(self) -> str:
        """The task in words."""


T = TypeVar("T", bound=Labelled)
R = TypeVar("R")


@dataclass(frozen=True)
class SharedPaths:
    """The folders that tasks name."""

    shared: tuple[Path, ...] = ()
    carried: tuple[Path, ...] = ()
    written: tuple[Path, ...] = ()  # Those of `shared`, or in them, that are held and written to
    say: Callable[[str], None] = print  # Told in a line what a run waits for


def on_disk(*places: Path | DataRoot, below: str = "") -> tuple[Path, ...]:
    """Return those places, or what is `below` them, that are folders of a file system, not of an object store."""
    paths = (place.path if isinstance(place, LocalRoot) else place for place in places)
    return tuple(path / below for path in paths if isinstance(path, Path))


@dataclass(frozen=True)
class ParentChannel:
    """The parent's side of the links that its workers have."""

    hear: Callable[[Any], None]  # Called in this process with what a worker tells
    stopped: Callable[[], bool]


class Executor(ABC):
    """Does work on tasks in several processes; a context manager.

    Nothing is started before the first tasks need it. The processes are kept until the block ends; where it ends by
    an error or Ctrl-C they are ended at once (`cancel`) and are gone when the block has been left.
    """

    def __enter__(self) -> Executor:
        """Return self."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes; at once where an error is under way."""
        if kind is None:
            self.close()
        else:
            self.cancel()

    @property
    @abstractmethod
    def workers(self) -> int:
        """Processes that work at a time, as far as that is known before."""

    def map(
        self,
        work: Callable[..., R],
        tasks: Sequence[T],
        scene_of: Callable[[T], str] | None = None,
        *,
        talk: ParentChannel | None = None,
        memory_mb: int = 0,
    ) -> Iterator[R | AerialDojoError]:
        """Do work on tasks that are known from the start: `run` of `TaskQueue`."""
        return self.run(work, TaskQueue(tasks, scene_of), talk=talk, memory_mb=memory_mb)

    @abstractmethod
    def run(
        self, work: Callable[..., R], waiting: TaskQueue[T], *, talk: ParentChannel | None = None, memory_mb: int = 0
    ) -> Iterator[R | AerialDojoError]:
        """Do work on tasks and yield what it returns, or the expected error, in the order of finishing."""

    @abstractmethod
    def close(self) -> None:
        """End the processes when they have done what they are at."""

    @abstractmethod
    def cancel(self) -> None:
        """End the processes now, and wait until they are gone."""


def guarded(work: Callable[..., R], task: Any, link: WorkerChannel | None) -> R | AerialDojoError:
    """Do work on a task; an expected error is returned."""
    try:
        return work(task) if link is None else work(task, link)
    except AerialDojoError as error:
        return error


def make_executor(
    name: str, workers: int | None = None, address: str | None = None, folders: SharedPaths | None = None
) -> Executor:
    """Make an executor; nothing is started yet."""
    if name not in EXECUTORS:
        raise UsageError(f"unknown executor {name!r}; executors: {', '.join(EXECUTORS)}")
    if name == "ray":
        from aerialdojo_gen.pipeline.executors.ray import RayExecutor

        return RayExecutor(workers, address, folders or SharedPaths())
    if address is not None:
        raise UsageError("--address is of --executor ray: leave it out, or give both")
    from aerialdojo_gen.pipeline.executors.local import LocalExecutor

    return LocalExecutor(workers)


class TaskQueue(Generic[T]):
    """Tasks that nobody has begun, by scene; `Executor.run` takes them from here."""

    def __init__(self, tasks: Sequence[T], scene_of: Callable[[T], str] | None) -> None:
        self._scene_of = scene_of or (lambda _: "")
        self._scenes: dict[str, deque[T]] = {}
        self._add(tasks)
        self._at: dict[int, str] = {}
        self._alone = len(tasks) <= 1

    def __len__(self) -> int:
        return sum(map(len, self._scenes.values()))

    @property
    def alone(self) -> bool:
        """Whether there is never more than one task at a time, so that one process is enough."""
        return self._alone

    def give(self, idle: Sequence[int]) -> Iterator[tuple[int, T]]:
        """Give idle processes their next tasks, as far as there are: first those who stay with their scene."""
        for lane in sorted(idle, key=lambda lane: self._at.get(lane) not in self._scenes):
            task = self.take(lane)
            if task is not None:
                yield lane, task

    def take(self, lane: int) -> T | None:
        """Give a process its next task: of its scene, else of one that no other works at, else of the fullest."""
        scene = self._at.get(lane)
        if scene not in self._scenes:
            others = {at for other, at in self._at.items() if other != lane}
            free = [name for name in self._scenes if name not in others]
            names = free or [name for name in self._scenes if self._worth_joining(name)]
            if not names:
                return None
            scene = max(names, key=self._weight)
        self._at[lane] = scene
        return self._pop(scene)

    def one_by_one(self) -> Iterator[T]:
        """Yield the tasks for one process that does all, scene after scene in their order."""
        scene = ""
        while self._scenes:
            scene = scene if scene in self._scenes else next(iter(self._scenes))
            yield self._pop(scene)

    def on_done(self, task: T, outcome: Any) -> None:
        """Hear what became of a task, an error that was expected among it."""

    def put_back(self, task: T) -> None:
        """Take back a task whose process is gone; it is the next of its scene."""
        self._scenes.setdefault(self._scene_of(task), deque()).appendleft(task)

    def leave(self, lane: int) -> None:
        """Forget where a process that is gone was."""
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
        """How much there is to do of a scene: the heaviest goes first."""
        return len(self._scenes[scene])

    def _worth_joining(self, _scene: str) -> bool:
        """Whether a second process should work at a scene."""
        return True
