"""What runs on a Ray cluster: the actor that does one task after the other, and the one that passes messages.

Ray itself is imported only where it runs.
"""

from __future__ import annotations

import hashlib
import os
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from aerialdojo_gen.pipeline.executors.base import guarded
from aerialdojo_gen.pipeline.executors.bundled import Unpacked
from aerialdojo_gen.pipeline.executors.link import RateLimiter, end

_ASK_EVERY_S = 0.5


@dataclass(frozen=True)
class Expected:
    """What a machine must see and have to work."""

    seen: Mapping[str, str]  # Folders, with what `listing` gives of them
    marked: Mapping[str, str]  # Files, with their text
    versions: Mapping[str, str]  # Libraries by the name of their distribution
    environment: Mapping[str, str]

    def __repr__(self) -> str:
        return "Expected()"


def listing(folder: Path) -> str:
    """Digest the names in a folder that are not hidden; empty where there is no such folder."""
    try:
        names = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
    except OSError:
        return ""
    return hashlib.sha256("\0".join(names).encode("utf-8", "surrogateescape")).hexdigest()


def versions(names: Mapping[str, str] | set[str]) -> dict[str, str]:
    """Return the versions of installed distributions; "missing" for others."""
    found = {}
    for name in names:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "missing"
    return found


class Worker:
    """Does tasks, one at a time; Ray makes an actor of it, a process each."""

    def __init__(self, board: Any) -> None:
        self._link = BoardLink(board)
        self._unpacked = Unpacked(Path(__file__).resolve().parents[3])

    def hello(self, expected: Expected) -> str:
        """Say what is wrong with this machine; nothing where it can work."""
        os.environ.update(expected.environment)
        where = f"node {socket.gethostname()}"
        for path, text in expected.marked.items():
            try:
                right = Path(path).read_text(encoding="utf-8") == text
            except OSError:
                right = False
            if not right:
                return f"{where} does not see {_above_marker(path)}: {_SHARE}"
        for folder, digest in expected.seen.items():
            if listing(Path(folder)) != digest:
                return f"{where} does not see {folder}, or another one of that name: {_SHARE}"
        here = versions(expected.versions)
        other = [f"{n} {here[n]}, not {v}" for n, v in sorted(expected.versions.items()) if here[n] != v]
        if other:
            return f"{where} has {'; '.join(other)}: install what constraints.txt pins on every node"
        return ""

    def do(self, work: Callable[..., Any], task: Any, linked: bool) -> Any:
        """Do work on a task; an expected error is returned."""
        moved = getattr(task, "moved", None)
        if moved is not None:
            task = moved(self._unpacked.place)
        try:
            return guarded(work, task, self._link if linked else None)
        finally:
            self._link.flush()

    def end(self) -> None:
        """Close what the tasks have kept open."""
        end()


_SHARE = "all nodes must mount the data directory's file system at the same path, or --data be an object store"


def _above_marker(path: str) -> Path:
    # DIR/.aerialdojo-staging/ITEM/marker
    return Path(path).parents[2]


class MessageBoard:
    """Keeps what workers tell until the driver takes it; Ray makes an actor of it."""

    def __init__(self) -> None:
        self._told: list[object] = []
        self._stopped = False
        self._turns = RateLimiter()

    def tell(self, message: object) -> None:
        """Keep a message."""
        self._told.append(message)

    def take(self, stop: bool) -> list[object]:
        """Give out the messages, and hear whether workers are to begin nothing more."""
        self._stopped = stop
        told, self._told = self._told, []
        return told

    def stopped(self) -> bool:
        """Whether workers are to begin nothing more."""
        return self._stopped

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait for a turn."""
        return self._turns.take(interval_s, time.monotonic())


class BoardLink:
    """A worker's link by way of the board."""

    every_s = 0.5

    def __init__(self, board: Any) -> None:
        self._board = board
        self._last: Any = None
        self._asked_s, self._stopped = -1e9, False

    def tell(self, message: object) -> None:
        """Send a small message."""
        self._last = self._board.tell.remote(message)

    def flush(self) -> None:
        """Wait until what was sent has arrived."""
        if self._last is not None:
            _get(self._last)
            self._last = None

    def stopped(self) -> bool:
        """Whether the parent wants nothing more to be begun, as of half a second ago at most."""
        if time.monotonic() - self._asked_s > _ASK_EVERY_S:
            self._stopped = _get(self._board.stopped.remote())
            self._asked_s = time.monotonic()
        return self._stopped

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait for a turn."""
        wait_s: float = _get(self._board.turn.remote(interval_s))
        return wait_s


def _get(reference: Any) -> Any:
    import ray

    return ray.get(reference)
