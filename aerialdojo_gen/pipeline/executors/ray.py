"""Tasks on a Ray cluster, or on one of this machine's own: an actor a process, which stays with a scene.

What is lost with a node or a process is done again elsewhere: a task's result is committed by whoever computes it, so
that only what was under way is lost. Messages and results that travel are small.
"""

from __future__ import annotations

import contextlib
import logging
import os
import re
import secrets
import shutil
import socket
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import AerialDojoError, MissingPackage, UsageError, first_line, lacks
from aerialdojo_gen.pipeline.executors.base import Executor, ParentChannel, R, SharedPaths, T, TaskQueue
from aerialdojo_gen.pipeline.executors.bundled import pack
from aerialdojo_gen.pipeline.executors.local import own_cores
from aerialdojo_gen.pipeline.executors.ray_worker import Expected, MessageBoard, Worker, listing, versions
from aerialdojo_gen.store.staging import scratch_folder, staged

# How often a task is begun before its fault is taken for its own.
_TRIES = 4
# So many processes may end one after the other before one has done anything.
_FALSE_STARTS = 6
_LOOK_EVERY_S, _SAY_AFTER_S, _END_WITHIN_S = 0.3, 30.0, 20.0
_FORWARDED = re.compile(r"(AWS|AERIALDOJO)_\w+|\w+_API_KEY|(OPENAI|ANTHROPIC)_BASE_URL|HF_TOKEN")


def _import_ray(own: bool) -> Any:
    """Import Ray, quiet; a cluster of our own listens on the loopback interface alone."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ.setdefault("RAY_BACKEND_LOG_LEVEL", "error")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    if own:
        # Ray's own switch against firewalls that ask: it takes 127.0.0.1 for the node's address.
        os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
    try:
        import ray
    except ImportError:
        raise MissingPackage(lacks("--executor ray", "ray", "cluster")) from None
    return ray


@dataclass(eq=False)
class _Lane:
    """A process that does one task at a time."""

    number: int
    actor: Any
    ready: bool = False


class RayExecutor(Executor):
    """Does work in actors of a Ray cluster."""

    def __init__(self, workers: int | None, address: str | None, folders: SharedPaths) -> None:
        if address is not None and not re.fullmatch(r"(ray://)?[^\s:/]+:\d{1,5}", address):
            raise UsageError(f"--address {address}: write HOST:PORT, as `ray start --head` says it")
        self._ray = _import_ray(address is None)
        self._asked, self._address, self._folders = workers, address, folders
        self._stack = contextlib.ExitStack()
        self._lanes: list[_Lane] = []
        self._refs: dict[Any, _Lane] = {}
        self._memory_mb = 0
        self._false_starts = 0
        self._expected: Any = None
        self._board: Any = None

    @property
    def workers(self) -> int:
        """Actors that work at a time; connects."""
        if self._asked is None:
            self._connect()
            return max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        return self._asked

    def run(
        self, work: Callable[..., R], waiting: TaskQueue[T], *, talk: ParentChannel | None = None, memory_mb: int = 0
    ) -> Iterator[R | AerialDojoError]:
        """Do work on tasks and yield what it returns, or the expected error, in the order of finishing."""
        if not waiting:
            return
        self._connect()
        self._require(memory_mb)
        running = dict[Any, tuple[_Lane, T]]()
        tries: Counter[int] = Counter()
        begun_s = time.monotonic()
        while True:
            self._grow(len(running) + len(waiting))
            busy = {lane.number for lane, _ in running.values()}
            idle = {lane.number: lane for lane in self._lanes if lane.ready and lane.number not in busy}
            for number, task in waiting.give(tuple(idle)):
                tries[id(task)] += 1
                lane = idle[number]
                running[lane.actor.do.remote(work, task, talk is not None)] = (lane, task)
            if not running and not waiting:
                return
            done, _ = self._ray.wait([*running, *self._refs], timeout=_LOOK_EVERY_S)
            if talk:
                self._hear(talk)
            for reference in done:
                if reference in self._refs:
                    self._welcome(reference)
                    continue
                lane, task = running.pop(reference)
                try:
                    outcome = self._ray.get(reference)
                except self._lost:
                    waiting.leave(lane.number)
                    self._replace(lane)
                    if tries[id(task)] >= _TRIES:
                        raise AerialDojoError(
                            f"{task.label}: the process that worked at it was lost {_TRIES} times (out of memory, or "
                            "nodes that went): run again, what was finished is kept"
                        ) from None
                    waiting.put_back(task)
                except self._ray.exceptions.RayTaskError as error:
                    raise error.cause from error
                else:
                    if talk:
                        self._hear(talk)
                    waiting.on_done(task, outcome)
                    yield outcome
            if not running and time.monotonic() - begun_s > _SAY_AFTER_S:
                begun_s = float("inf")
                self._folders.say(f"no process of the cluster has started yet: {self._room()}")

    def close(self) -> None:
        """End the actors when they have done what they are at."""
        with contextlib.suppress(Exception):
            ends = [lane.actor.end.remote() for lane in self._lanes if lane.ready]
            if ends:
                self._ray.wait(ends, num_returns=len(ends), timeout=_END_WITHIN_S)
        self.cancel()

    def cancel(self) -> None:
        """End the actors now, and wait until they are gone."""
        self._end_lanes()
        self._stack.close()

    # ----- the cluster

    def _connect(self) -> None:
        if self._expected is not None:
            return
        ray, folders = self._ray, self._folders
        if ray.is_initialized():
            raise UsageError("this process has a Ray cluster already: call ray.shutdown() before")
        # What a killed command leaves there is removed by the next one that carries an archive.
        place = _short_folder() if self._address is None else scratch_folder()
        scratch = self._stack.enter_context(place)
        common = {"log_to_driver": False, "logging_level": logging.CRITICAL}
        if self._address is None:
            own = {"num_cpus": self._asked or own_cores(), "include_dashboard": False, "_temp_dir": str(scratch)}
            # Their package is this one, where it is: its compiled kernels are used.
            python_path = os.pathsep.join(path for path in sys_path() if path)
            options = common | own | {"runtime_env": {"env_vars": {"PYTHONPATH": python_path}}}
        else:
            _check_answers(self._address)
            archive = scratch / "carried.zip"
            pack(archive, folders.carried)
            options = common | {"address": self._address, "runtime_env": {"working_dir": str(archive)}}
        where = f"the Ray cluster at {self._address}" if self._address else "a Ray cluster on this machine"
        # A machine that has much else to do may not start one within Ray's half a minute, but in the next.
        for left in reversed(range(2 if self._address is None else 1)):
            try:
                ray.init(**options)
                break
            except Exception as error:
                ray.shutdown()
                if not left:
                    self._stack.close()
                    raise AerialDojoError(f"cannot use {where}: {first_line(error)}") from error
        # Run in the order in which they are not listed: Ray first, then its folder.
        self._stack.callback(ray.shutdown)
        here = ray.get_runtime_context().get_node_id()
        stay = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(here, soft=False)
        self._board = ray.remote(MessageBoard).options(num_cpus=0, scheduling_strategy=stay).remote()
        own_names = {name for name in os.environ if _FORWARDED.fullmatch(name)}
        self._expected = Expected(
            seen={
                str(path): listing(path) for path in folders.shared if path not in folders.written and path.is_dir()
            },
            marked=self._mark(folders.written),
            versions=versions(_required()),
            environment={name: os.environ[name] for name in sorted(own_names)},
        )
        self._lost = (
            ray.exceptions.RayActorError, ray.exceptions.OutOfMemoryError, ray.exceptions.WorkerCrashedError,
            ray.exceptions.ObjectLostError, ray.exceptions.NodeDiedError,
        )  # fmt: skip

    def _mark(self, folders: Sequence[Path]) -> dict[str, str]:
        """Put a file into the folders that are written to, for as long as this runs: who works has to see it."""
        marks = {}
        for folder in folders:
            item = self._stack.enter_context(staged(folder, folder / "marker"))
            marker, text = item / "marker", secrets.token_hex(16)
            marker.write_text(text, encoding="utf-8")
            marks[str(marker)] = text
        return marks

    def _room(self) -> str:
        nodes = [node for node in self._ray.nodes() if node["Alive"]]
        free = self._ray.available_resources()
        return f"{len(nodes)} nodes, {free.get('CPU', 0):g} cores and {free.get('memory', 0) / 1e6:,.0f} MB free"

    # ----- its processes

    def _require(self, memory_mb: int) -> None:
        """Have no actors with less memory than that."""
        memory_mb = self._possible(memory_mb)
        if memory_mb > self._memory_mb:
            self._end_lanes()
            self._memory_mb = memory_mb

    def _grow(self, tasks: int) -> None:
        """Have as many actors as so many tasks need."""
        while len(self._lanes) < min(self.workers, tasks):
            self._add(len(self._lanes))

    def _possible(self, memory_mb: int) -> int:
        """Check that a node can give so much memory; 0 where the cluster does not say what it has."""
        nodes = [node["Resources"] for node in self._ray.nodes() if node["Alive"]]
        most = max((node["memory"] for node in nodes if "memory" in node), default=None)
        if most is None:
            return 0
        if memory_mb * 1e6 > most:
            raise AerialDojoError(
                f"a process takes {memory_mb:,} MB, and no node gives more than {most / 1e6:,.0f} MB: larger "
                "nodes are needed (`ray start --memory` says how much of one is given)"
            )
        return memory_mb

    def _add(self, number: int) -> None:
        options: dict[str, Any] = {"num_cpus": 1, "max_restarts": 0, "max_task_retries": 0}
        if self._memory_mb:
            options["memory"] = int(self._memory_mb * 1e6)
        lane = _Lane(number, self._ray.remote(Worker).options(**options).remote(self._board))
        self._lanes.append(lane)
        self._refs[lane.actor.hello.remote(self._expected)] = lane

    def _welcome(self, reference: Any) -> None:
        """Take a process into use that has started, or another one where it has ended since."""
        lane = self._refs.pop(reference)
        try:
            wrong = self._ray.get(reference)
        except self._lost as error:
            self._false_starts += 1
            if self._false_starts >= _FALSE_STARTS:
                raise AerialDojoError(
                    f"processes on the cluster end as soon as they are started: {first_line(error)}"
                ) from None
            self._replace(lane)
        except (self._ray.exceptions.RuntimeEnvSetupError, self._ray.exceptions.RayTaskError) as error:
            raise AerialDojoError(f"a process on the cluster cannot be started: {last_line(error)}") from error
        else:
            if wrong:
                raise AerialDojoError(wrong)
            self._false_starts = 0
            lane.ready = True

    def _replace(self, lane: _Lane) -> None:
        with contextlib.suppress(Exception):
            self._ray.kill(lane.actor, no_restart=True)
        self._lanes.remove(lane)
        self._add(lane.number)

    def _end_lanes(self) -> None:
        """Kill the actors, and wait until all that they were at has come back as lost."""
        if self._lanes and self._ray.is_initialized():
            with contextlib.suppress(Exception):
                last = [lane.actor.hello.remote(self._expected) for lane in self._lanes if lane.ready]
                for lane in self._lanes:
                    self._ray.kill(lane.actor, no_restart=True)
                if last:
                    self._ray.wait(last, num_returns=len(last), timeout=_END_WITHIN_S)
        self._lanes.clear()
        self._refs.clear()

    def _hear(self, talk: ParentChannel) -> None:
        for message in self._ray.get(self._board.take.remote(talk.stopped())):
            talk.hear(message)


def _check_answers(address: str) -> None:
    """Find out in five seconds what Ray needs a minute for, and then says in its own words."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=5.0).close()
    except (OSError, OverflowError) as error:
        raise AerialDojoError(
            f"no Ray cluster answers at {address} ({first_line(error)}): start one (docs/scale.md)"
        ) from None


@contextlib.contextmanager
def _short_folder() -> Iterator[Path]:
    # Ray's sockets lie in it, and their paths have room for 107 characters.
    folder = Path(tempfile.mkdtemp(prefix="ad-ray-"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def sys_path() -> list[str]:
    """Return where this process imports from, absolute."""
    import sys

    return [os.path.abspath(path) for path in sys.path]


def _required() -> set[str]:
    """Names of the distributions that the package needs, without its extras."""
    try:
        texts = metadata.requires("aerialdojo-gen") or []
    except metadata.PackageNotFoundError:
        return set()
    return {re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in texts if "extra ==" not in text}


def last_line(error: BaseException) -> str:
    """Return the last line of an error's text, where Ray says the cause."""
    lines = str(error).strip().splitlines()
    return lines[-1][:300] if lines else type(error).__name__
