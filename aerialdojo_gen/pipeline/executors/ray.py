"""Tasks on a Ray cluster, or on a local one: one actor per process, which stays with a scene.

Tasks lost with a node or a process run again elsewhere: a task commits its own result, so that only running tasks are
lost. Messages and results are small.
"""

from __future__ import annotations

import contextlib
import logging
import os
import re
import secrets
import socket
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import AerialDojoError, MissingPackage, UsageError, first_line, no_package
from aerialdojo_gen.pipeline.executors.base import Executor, ParentChannel, R, SharedPaths, T, TaskQueue
from aerialdojo_gen.pipeline.executors.local import own_cores
from aerialdojo_gen.pipeline.executors.ray_worker import Expected, MessageBoard, Worker, listing, pack, versions
from aerialdojo_gen.store.staging import scratch_folder, staged

# Attempts of a task before its failure is final.
_TRIES = 4
# Consecutive processes that may end before any has started.
_FALSE_STARTS = 6
_POLL_S, _WARN_AFTER_S, _STOP_TIMEOUT_S = 0.3, 30.0, 20.0
_FORWARDED = re.compile(r"(AWS|AERIALDOJO)_\w+|\w+_API_KEY|(OPENAI|ANTHROPIC)_BASE_URL|HF_TOKEN")


def _import_ray(own: bool) -> Any:
    """Import Ray without its messages; a local cluster listens on the loopback interface only."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ.setdefault("RAY_BACKEND_LOG_LEVEL", "error")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    if own:
        # Makes Ray use 127.0.0.1 as the node's address.
        os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
    try:
        import ray
    except ImportError:
        raise MissingPackage(no_package("--executor ray", "ray", "cluster")) from None
    return ray


@dataclass(eq=False)
class _Lane:
    """A process that runs one task at a time."""

    number: int
    actor: Any
    ready: bool = False


class RayExecutor(Executor):
    """Runs tasks in actors of a Ray cluster."""

    def __init__(self, workers: int | None, address: str | None, folders: SharedPaths) -> None:
        if address is not None and not re.fullmatch(r"(ray://)?[^\s:/]+:\d{1,5}", address):
            raise UsageError(f"--address {address}: write HOST:PORT, as `ray start --head` prints it")
        self._ray = _import_ray(address is None)
        self._requested, self._address, self._folders = workers, address, folders
        self._stack = contextlib.ExitStack()
        self._lanes: list[_Lane] = []
        self._refs: dict[Any, _Lane] = {}
        self._memory_mb = 0
        self._false_starts = 0
        self._expected: Any = None
        self._board: Any = None

    @property
    def workers(self) -> int:
        """Number of actors; connects to the cluster."""
        if self._requested is None:
            self._connect()
            return max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        return self._requested

    def run(self, work: Callable[..., R], waiting: TaskQueue[T]) -> Iterator[R | AerialDojoError]:
        """Run tasks and yield results or expected errors in completion order."""
        if not waiting:
            return
        self._connect()
        self._require(waiting.memory_mb)
        channel, running = waiting.channel, dict[Any, tuple[_Lane, T]]()
        tries: Counter[int] = Counter()
        begun_s = time.monotonic()
        while True:
            while len(self._lanes) < min(self.workers, len(running) + len(waiting)):
                self._add(len(self._lanes))
            busy = {lane.number for lane, _ in running.values()}
            idle = {lane.number: lane for lane in self._lanes if lane.ready and lane.number not in busy}
            for number, task in waiting.give(tuple(idle)):
                tries[id(task)] += 1
                lane = idle[number]
                running[lane.actor.do.remote(work, task, channel is not None)] = (lane, task)
            if not running and not waiting:
                return
            done, _ = self._ray.wait([*running, *self._refs], timeout=_POLL_S)
            if channel:
                self._pass_messages(channel)
            for reference in done:
                if reference in self._refs:
                    self._on_started(reference)
                    continue
                lane, task = running.pop(reference)
                try:
                    outcome = self._ray.get(reference)
                except self._lost:
                    waiting.leave(lane.number)
                    self._replace(lane)
                    if tries[id(task)] >= _TRIES:
                        raise AerialDojoError(
                            f"{task.label}: its process was lost {_TRIES} times (out of memory, or "
                            "lost nodes): run again, finished shards are kept"
                        ) from None
                    waiting.requeue(task)
                except self._ray.exceptions.RayTaskError as error:
                    raise error.cause from error
                else:
                    if channel:
                        self._pass_messages(channel)
                    waiting.on_done(task, outcome)
                    yield outcome
            if not running and time.monotonic() - begun_s > _WARN_AFTER_S:
                begun_s = float("inf")
                nodes, free = self._alive(), self._ray.available_resources()
                self._folders.say(
                    f"no process of the cluster has started yet: {len(nodes)} nodes, "
                    f"{free.get('CPU', 0):g} cores and {free.get('memory', 0) / 1e6:,.0f} MB free"
                )

    def close(self) -> None:
        """End the actors after their current tasks."""
        with contextlib.suppress(Exception):
            ends = [lane.actor.end.remote() for lane in self._lanes if lane.ready]
            if ends:
                self._ray.wait(ends, num_returns=len(ends), timeout=_STOP_TIMEOUT_S)
        self.cancel()

    def cancel(self) -> None:
        """Kill the actors, and wait for them."""
        self._end_lanes()
        self._stack.close()

    # ----- the cluster

    def _connect(self) -> None:
        if self._expected is not None:
            return
        ray, folders = self._ray, self._folders
        if ray.is_initialized():
            raise UsageError("this process has a Ray cluster already: call ray.shutdown() before")
        # The next command removes what a killed one leaves there.
        place: contextlib.AbstractContextManager[Path | str] = scratch_folder()
        if self._address is None:
            # Ray's sockets are in it, and socket paths are limited to 107 characters.
            place = tempfile.TemporaryDirectory(prefix="ad-ray-", ignore_cleanup_errors=True)
        scratch = Path(self._stack.enter_context(place))
        common = {"log_to_driver": False, "logging_level": logging.CRITICAL}
        if self._address is None:
            own = {"num_cpus": self._requested or own_cores(), "include_dashboard": False, "_temp_dir": str(scratch)}
            # Workers import this package in place, with its compiled kernels.
            python_path = os.pathsep.join(map(os.path.abspath, sys.path))
            options = common | own | {"runtime_env": {"env_vars": {"PYTHONPATH": python_path}}}
        else:
            _check_answers(self._address)
            archive = scratch / "bundle.zip"
            pack(archive, folders.bundled)
            options = common | {"address": self._address, "runtime_env": {"working_dir": str(archive)}}
        where = f"the Ray cluster at {self._address}" if self._address else "a Ray cluster on this machine"
        # On a loaded machine the first start may exceed Ray's half a minute.
        for left in reversed(range(2 if self._address is None else 1)):
            try:
                ray.init(**options)
                break
            except Exception as error:
                ray.shutdown()
                if not left:
                    self._stack.close()
                    raise AerialDojoError(f"cannot use {where}: {first_line(error)}") from error
        # Callbacks run in reverse order: Ray first, then its folder.
        self._stack.callback(ray.shutdown)
        node_id = ray.get_runtime_context().get_node_id()
        pin_to_driver = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy(node_id, soft=False)
        self._board = ray.remote(MessageBoard).options(num_cpus=0, scheduling_strategy=pin_to_driver).remote()
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
        """Put a marker file into the written folders during the run: every node must see it."""
        marks = {}
        for folder in folders:
            item = self._stack.enter_context(staged(folder, folder / "marker"))
            marker, text = item / "marker", secrets.token_hex(16)
            marker.write_text(text, encoding="utf-8")
            marks[str(marker)] = text
        return marks

    def _alive(self) -> list[Any]:
        """Return the resources of the nodes that are there."""
        return [node["Resources"] for node in self._ray.nodes() if node["Alive"]]

    # ----- its processes

    def _require(self, memory_mb: int) -> None:
        """Check that a node has that much memory, and restart the actors if they have less."""
        most = max((node["memory"] for node in self._alive() if "memory" in node), default=None)
        if most is not None and memory_mb * 1e6 > most:
            raise AerialDojoError(
                f"a process takes {memory_mb:,} MB, and no node gives more than {most / 1e6:,.0f} MB: larger "
                "nodes are needed (`ray start --memory` says how much of one is given)"
            )
        # A cluster need not report its memory.
        if most is not None and memory_mb > self._memory_mb:
            self._end_lanes()
            self._memory_mb = memory_mb

    def _add(self, number: int) -> None:
        options: dict[str, Any] = {"num_cpus": 1, "max_restarts": 0, "max_task_retries": 0}
        if self._memory_mb:
            options["memory"] = int(self._memory_mb * 1e6)
        lane = _Lane(number, self._ray.remote(Worker).options(**options).remote(self._board))
        self._lanes.append(lane)
        self._refs[lane.actor.hello.remote(self._expected)] = lane

    def _on_started(self, reference: Any) -> None:
        """Use a process that has started, or replace it if it has ended since."""
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
        """Kill the actors, and wait until their tasks are reported lost."""
        if self._lanes and self._ray.is_initialized():
            with contextlib.suppress(Exception):
                last = [lane.actor.hello.remote(self._expected) for lane in self._lanes if lane.ready]
                for lane in self._lanes:
                    self._ray.kill(lane.actor, no_restart=True)
                if last:
                    self._ray.wait(last, num_returns=len(last), timeout=_STOP_TIMEOUT_S)
        self._lanes.clear()
        self._refs.clear()

    def _pass_messages(self, channel: ParentChannel) -> None:
        for message in self._ray.get(self._board.take.remote(channel.stopped())):
            channel.send(message)


def _check_answers(address: str) -> None:
    """Check the address in five seconds; Ray's own check takes a minute."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=5.0).close()
    except (OSError, OverflowError) as error:
        raise AerialDojoError(
            f"no Ray cluster answers at {address} ({first_line(error)}): start one (docs/scale.md)"
        ) from None


def _required() -> set[str]:
    """Names of the package's required distributions, without extras."""
    try:
        texts = metadata.requires("aerialdojo-gen") or []
    except metadata.PackageNotFoundError:
        return set()
    return {re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in texts if "extra ==" not in text}


def last_line(error: BaseException) -> str:
    """Return the last line of an error's text, in which Ray gives the cause."""
    lines = str(error).strip().splitlines()
    return lines[-1][:300] if lines else type(error).__name__
