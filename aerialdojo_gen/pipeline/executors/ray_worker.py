"""What a Ray cluster gets and runs: an archive of the package and of folders; actors for tasks and for messages.

The archive's bytes depend on the files' content alone, so that a cluster that has it already does not receive it
again. It includes Numba's compiled kernels: compiling them takes half a minute. Ray is imported only where it runs.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import socket
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from aerialdojo_gen.base import memory
from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.base.kernel_cache import folder_name
from aerialdojo_gen.pipeline.executors.base import RateLimiter, end, guarded

_POLL_EVERY_S = 0.5
MAX_BYTES = 200 << 20
_NAMES = "bundled.json"
_KERNELS = (".nbi", ".nbc")
_EPOCH = (1980, 1, 1, 0, 0, 0)


def pack(target: Path, folders: Sequence[Path]) -> None:
    """Write the archive."""
    package = Path(__file__).resolve().parents[2]
    files: dict[str, Path] = {}
    names: dict[str, str] = {}
    # Without machine code of other versions of the sources.
    kernels = {folder for folder in package.rglob("__pycache__/kernels/*") if _is_current(folder)}
    for path in _files(package):
        if "__pycache__" not in path.relative_to(package).parts or (
            path.parent in kernels and path.suffix in _KERNELS
        ):
            files[f"{package.name}/{path.relative_to(package).as_posix()}"] = path
    # In a checkout these folders are next to the package, in a wheel inside it.
    siblings = [package.parent / name for name in ("pipelines", "scene_assets") if (package.parent / name).is_dir()]
    for number, folder in enumerate(dict.fromkeys([*siblings, *folders])):
        if folder.is_relative_to(package):
            names[str(folder)] = f"{package.name}/{folder.relative_to(package).as_posix()}"
            continue
        names[str(folder)] = folder.name if folder in siblings else f"bundled/{number}"
        files |= {f"{names[str(folder)]}/{p.relative_to(folder).as_posix()}": p for p in _files(folder)}
    size = sum(path.stat().st_size for path in files.values())
    if size > MAX_BYTES:
        raise UsageError(
            f"the package and {', '.join(map(str, folders))} have {size >> 20} MB: no more than {MAX_BYTES >> 20} MB "
            "are sent to a cluster; remove files that are no recipe, prop or annotation"
        )
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(zipfile.ZipInfo(_NAMES, _EPOCH), json.dumps(names, sort_keys=True))
        for name, path in sorted(files.items()):
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), _bytes(path), zipfile.ZIP_DEFLATED)


def _files(folder: Path) -> Iterator[Path]:
    yield from (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith("."))


def _is_current(kernels: Path) -> bool:
    source = kernels.parents[2] / f"{kernels.name.rpartition('-')[0]}.py"
    return source.is_file() and folder_name(source) == kernels.name


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise AssetError(f"cannot read {path}: {error.strerror}") from None


class Unpacked:
    """An archive that Ray has unpacked."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._names: dict[str, str] = {}
        with contextlib.suppress(FileNotFoundError):
            self._names = json.loads((folder / _NAMES).read_text(encoding="utf-8"))

    def place(self, path: Path) -> Path:
        """Return the unpacked location of a path in a packed folder; any other path unchanged."""
        for above in (path, *path.parents):
            if str(above) in self._names:
                return self._folder / self._names[str(above)] / path.relative_to(above)
        return path


@dataclass(frozen=True)
class Expected:
    """What a machine must have to run tasks."""

    seen: Mapping[str, str]  # Folders, with their `listing`
    marked: Mapping[str, str]  # Files, with their text
    versions: Mapping[str, str]  # Libraries by the name of their distribution
    environment: Mapping[str, str]

    def __repr__(self) -> str:
        return "Expected()"


def listing(folder: Path) -> str:
    """Digest the names of a folder's visible files; empty if there is no such folder."""
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
    """Runs tasks, one at a time; a Ray actor in its own process."""

    def __init__(self, board: Any) -> None:
        memory.set_up()
        self._channel = BoardChannel(board)
        self._unpacked = Unpacked(Path(__file__).resolve().parents[3])

    def hello(self, expected: Expected) -> str:
        """Return what this machine lacks; empty if it can run tasks."""
        os.environ.update(expected.environment)
        where = f"node {socket.gethostname()}"
        # A marker is DIR/.aerialdojo-staging/ITEM/marker.
        for path, text in expected.marked.items():
            try:
                right = Path(path).read_text(encoding="utf-8") == text
            except OSError:
                right = False
            if not right:
                return f"{where} does not see {Path(path).parents[2]}: {_SHARE}"
        for folder, digest in expected.seen.items():
            if listing(Path(folder)) != digest:
                return f"{where} does not see {folder}, or another one of that name: {_SHARE}"
        installed = versions(expected.versions)
        mismatches = [
            f"{n} {installed[n]}, not {v}" for n, v in sorted(expected.versions.items()) if installed[n] != v
        ]
        if mismatches:
            return f"{where} has {'; '.join(mismatches)}: install what constraints.txt pins on every node"
        return ""

    def do(self, work: Callable[..., Any], task: Any, has_channel: bool) -> Any:
        """Run a task; an expected error is returned."""
        moved = getattr(task, "moved", None)
        if moved is not None:
            task = moved(self._unpacked.place)
        try:
            return guarded(work, task, self._channel if has_channel else None)
        finally:
            self._channel.flush()

    def end(self) -> None:
        """Close what the tasks have left open."""
        end()


_SHARE = "all nodes must mount the data directory's file system at the same path, or --data be an object store"


class MessageBoard:
    """Keeps workers' messages until the driver fetches them; a Ray actor."""

    def __init__(self) -> None:
        self._messages: list[object] = []
        self._stopped = False
        self._turns = RateLimiter()

    def send(self, message: object) -> None:
        """Keep a message."""
        self._messages.append(message)

    def take(self, stop: bool) -> list[object]:
        """Return the messages, and set whether workers must start nothing more."""
        self._stopped = stop
        messages, self._messages = self._messages, []
        return messages

    def stopped(self) -> bool:
        """Whether workers must start nothing more."""
        return self._stopped

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait for a turn."""
        return self._turns.take(interval_s)


class BoardChannel:
    """A worker's channel through the message board."""

    every_s = 0.5

    def __init__(self, board: Any) -> None:
        self._board = board
        self._last: Any = None
        self._polled_s, self._stopped = -1e9, False

    def send(self, message: object) -> None:
        """Send a small message."""
        self._last = self._board.send.remote(message)

    def flush(self) -> None:
        """Wait until what was sent has arrived."""
        if self._last is not None:
            _get(self._last)
            self._last = None

    def stopped(self) -> bool:
        """Whether the parent has asked to start nothing more; at most half a second old."""
        if time.monotonic() - self._polled_s > _POLL_EVERY_S:
            self._stopped = _get(self._board.stopped.remote())
            self._polled_s = time.monotonic()
        return self._stopped

    def turn(self, interval_s: float) -> float:
        """Return how many seconds to wait for a turn."""
        wait_s: float = _get(self._board.turn.remote(interval_s))
        return wait_s


def _get(reference: Any) -> Any:
    import ray

    return ray.get(reference)
