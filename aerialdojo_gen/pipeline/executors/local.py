"""The executor seam: compute shards in this process or in several, and commit each one whole."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Generic, Protocol, TypeVar

from aerialdojo_gen.common.trouble import explained
from aerialdojo_gen.config.sections import Section
from aerialdojo_gen.errors import AerialDojoError, BudgetSpent
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.pipeline.stage import Job
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.footers import ShardFile


class _Labelled(Protocol):
    @property
    def label(self) -> str: ...


T = TypeVar("T", bound=_Labelled)
R = TypeVar("R")


@dataclass(frozen=True)
class Task:
    """A shard to compute: its job, its stage's config, and the fingerprint to store with it."""

    job: Job
    config: Section
    fingerprint: str

    @property
    def label(self) -> str:
        """The shard in words, for messages."""
        part = f" part {self.job.part} of {self.job.parts}" if self.job.parts > 1 else ""
        return f"{self.job.stage} {self.job.scene}{part}"


def compute(task: Task) -> dict[str, Any]:
    """Compute one shard and commit its tables.

    Returns
    -------
    dict
        The shard's summary: ``rows_in``, ``rows_out``, ``counts``.

    Raises
    ------
    AerialDojoError
        An expected failure.
    RuntimeError
        Anything else, with the shard in its message and the cause chained.
    """
    job = task.job
    if job.deadline is not None and time.time() >= job.deadline:
        raise BudgetSpent(f"the budget was spent before {task.label}")
    stage = BY_NAME[job.stage]
    try:
        output = stage.run(job, task.config)
    except AerialDojoError:
        raise
    except Exception as error:
        if why := explained(error):
            # Without the shard: it is no fault of its own, and all of them say the same.
            raise AerialDojoError(why) from error
        raise RuntimeError(f"{task.label} failed: {type(error).__name__}: {error}") from error
    if set(output.tables) != set(stage.writes):
        raise RuntimeError(f"{task.label} returned tables {sorted(output.tables)}, not {sorted(stage.writes)}")
    summary = {"rows_in": output.rows_in, "rows_out": output.rows_out, "counts": dict(sorted(output.counts.items()))}
    files = {name: _described(job, name) for name in sorted(job.files)}
    for name, table in output.tables.items():
        store.write_shard(
            job.roots.data,
            name,
            job.scene,
            job.part,
            table,
            fingerprint=task.fingerprint,
            parts=job.parts,
            summary=summary,
            files=files,
        )
    return summary


def _described(job: Job, name: str) -> ShardFile:
    data = job.roots.data
    return ShardFile(data.size(name), data.digest(name) if name in job.digested else "")


def start_worker(parent: int) -> None:
    """Make a new worker process leave Ctrl-C to its parent, and end with it."""
    # Ctrl-C goes to the whole process group: the parent alone answers it, and ends the workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A worker must not outlive a parent that was killed with SIGKILL.
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        # It may have been killed before the line above, while this process was starting.
        if os.getppid() != parent:
            os._exit(1)


def _guarded(task: Task) -> dict[str, Any] | AerialDojoError:
    try:
        return compute(task)
    except AerialDojoError as error:
        return error


class Pool:
    """Computes tasks in `workers` processes; in this one where that is 1.

    Processes are started when the first tasks need them and are kept for the stages that follow.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        # A pool of one process each, so that this side chooses who does what.
        self._lanes: list[ProcessPoolExecutor] = []

    def __enter__(self) -> Pool:
        """Return self."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes; at once where an error is under way."""
        if kind is not None:
            for lane in self._lanes:
                for process in list((lane._processes or {}).values()):
                    with contextlib.suppress(OSError):
                        process.terminate()
        for lane in self._lanes:
            lane.shutdown(wait=True, cancel_futures=True)
        self._lanes.clear()

    def imap(self, tasks: Sequence[Task]) -> Iterator[dict[str, Any] | AerialDojoError]:
        """Compute tasks and yield summaries, or the expected errors, in the order of finishing.

        Raises
        ------
        AerialDojoError
            A worker was killed.
        RuntimeError
            A task failed in an unexpected way.
        """
        yield from self.map(_guarded, tasks, lambda task: task.job.scene)

    def map(
        self, work: Callable[[T], R], tasks: Sequence[T], scene_of: Callable[[T], str] | None = None
    ) -> Iterator[R]:
        """Do work on tasks and yield what it returns, in the order of finishing.

        Parameters
        ----------
        work : callable
            A function of a module: other processes import it.
        tasks : sequence
            What it is called with; each has a `label` for messages.
        scene_of : callable, optional
            A task's scene. A process stays with a scene while there is work, for it keeps what it has read and
            built of it; tasks of no scene are done in their order.

        Raises
        ------
        AerialDojoError
            A worker was killed.
        """
        if self.workers <= 1 or len(tasks) <= 1:
            for task in tasks:
                yield work(task)
            return
        if not self._lanes:
            # spawn: FCL, PyBullet and numba hold state that does not survive a fork.
            context = multiprocessing.get_context("spawn")
            self._lanes = [
                ProcessPoolExecutor(1, mp_context=context, initializer=start_worker, initargs=(os.getpid(),))
                for _ in range(self.workers)
            ]
        waiting = _Waiting(tasks, scene_of or (lambda _: ""))
        running: dict[Future[R], tuple[int, T]] = {}
        idle = list(range(len(self._lanes)))
        try:
            while True:
                # One task a process keeps a Ctrl-C from waiting for what has not begun.
                # The first submit starts the process; it inherits a blocked SIGINT, so that a Ctrl-C while it
                # starts is the parent's alone.
                signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
                try:
                    while idle and waiting:
                        lane = idle.pop(0)
                        task = waiting.take(lane)
                        running[self._lanes[lane].submit(work, task)] = (lane, task)
                finally:
                    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
                if not running:
                    return
                finished, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    outcome = future.result()
                    idle.append(running.pop(future)[0])
                    yield outcome
        except BrokenProcessPool:
            labels = "; ".join(task.label for _, task in running.values())
            raise AerialDojoError(
                f"a worker process was killed at {labels} (out of memory?): "
                "run again, finished shards are kept; use fewer --workers if memory ran out"
            ) from None


class _Waiting(Generic[T]):
    """Tasks that nobody has begun, by scene."""

    def __init__(self, tasks: Sequence[T], scene_of: Callable[[T], str]) -> None:
        self._scenes: dict[str, deque[T]] = {}
        for task in tasks:
            self._scenes.setdefault(scene_of(task), deque()).append(task)
        self._at: dict[int, str] = {}

    def __bool__(self) -> bool:
        return bool(self._scenes)

    def take(self, lane: int) -> T:
        """Give a process its next task: of its scene, else of one that no other works at, else of the fullest."""
        scene = self._at.get(lane)
        if scene not in self._scenes:
            others = {at for other, at in self._at.items() if other != lane}
            free = [name for name in self._scenes if name not in others]
            scene = max(free or self._scenes, key=lambda name: len(self._scenes[name]))
        self._at[lane] = scene
        task = self._scenes[scene].popleft()
        if not self._scenes[scene]:
            del self._scenes[scene]
        return task
