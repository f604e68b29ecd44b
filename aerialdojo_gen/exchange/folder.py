"""Folders that appear whole or not at all, resumable parts of an export, and safe relative paths."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import pyarrow.compute as pc

from aerialdojo_gen.base.errors import Malformed, StoreError, UsageError, disk_error
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import atomic_folder, atomic_write, make_folder
from aerialdojo_gen.store.root import DataRoot, LocalRoot
from aerialdojo_gen.store.staging import NO_LOCKS, remove, sweep

# Stands in every export, and says what it holds.
MARKER = "export.json"
_PICTURES = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff")
_LARGEST_PICTURE = 32 << 20


@contextlib.contextmanager
def whole_folder(target: Path, marker: str, *, force: bool) -> Iterator[Path]:
    """Fill a folder beside its place, and give it its name at the end."""
    check_target(target, marker, force=force)
    with atomic_folder(target.absolute()) as temporary:
        yield temporary


def check_target(target: Path, marker: str, *, force: bool) -> None:
    """Refuse a folder that `whole_folder` could not fill, before work that takes long."""
    target = target.absolute()
    # Before anything is decided: it may bring back what a kill between two renames took away.
    sweep(target.parent)
    try:
        taken = target.is_file() or (target.is_dir() and any(target.iterdir()))
        ours = (target / marker).is_file()
    except OSError as error:
        raise disk_error(error, target) from None
    _refuse_taken(str(target), taken, ours, marker, force)


def _refuse_taken(place: str, taken: bool, ours: bool, marker: str, force: bool) -> None:
    if taken and not ours:
        raise UsageError(f"{place} exists and holds no {marker}: name another folder")
    if taken and not force:
        raise UsageError(f"{place} exists: --force replaces it")


@contextlib.contextmanager
def whole_folder_below(root: DataRoot, relative: str, marker: str, *, force: bool) -> Iterator[Path]:
    """Fill a folder below a data root as `whole_folder` does."""
    if isinstance(root, LocalRoot):
        with whole_folder(root.path / relative, marker, force=force) as temporary:
            yield temporary
        return
    taken, ours = root.exists(relative), root.exists(f"{relative}/{marker}")
    _refuse_taken(root.at(relative), taken, ours, marker, force)
    with root.commit_folder(relative) as temporary:
        yield temporary


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a small JSON document for people and programs."""
    path.write_text(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def write_marker(folder: Path, format_name: str, frame: str, **facts: Any) -> None:
    """Write the marker of an export: its format, frame and program, and what else there is to know."""
    head = {"format": format_name, "written_by": f"aerialdojo-gen {__version__}", "frame": frame}
    write_json(folder / MARKER, head | facts)


def inside(root: Path, relative: str) -> Path:
    """Follow a path that a file names, below a folder."""
    name = PurePosixPath(relative.replace("\\", "/"))
    if not relative or "\0" in relative or name.is_absolute() or re.match(r"[A-Za-z]:", relative):
        raise ValueError(f"{relative!r} is no path relative to {root}")
    path = root / name
    try:
        resolved = path.resolve()
    except (OSError, RuntimeError) as error:
        raise ValueError(f"{relative!r} cannot be followed ({error})") from None
    if ".." in name.parts or not resolved.is_relative_to(root.resolve()):
        raise ValueError(f"{relative!r} points outside {root}")
    return path


def check_picture(path: Path) -> Path:
    """Return the path if a PNG or JPEG file of a sensible size is there."""
    try:
        if not path.is_file():
            raise ValueError(f"there is no file {path}")
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(8)
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror})") from None
    if size > _LARGEST_PICTURE:
        raise ValueError(f"{path} is larger than {_LARGEST_PICTURE >> 20} MiB")
    if not head.startswith(_PICTURES):
        raise ValueError(f"{path} is neither PNG nor JPEG")
    return path


_REQUEST, _LOCK = "request.json", "lock"


class PartialExport:
    """The parts of an export that are finished, beside the folder that it will be."""

    def __init__(self, target: Path, request: dict[str, Any]) -> None:
        self.folder = target.absolute().with_name(f".{target.name}.unfinished")
        self._request = request
        self.resumed = False

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the folder against other writers."""
        make_folder(self.folder)
        with (self.folder / _LOCK).open("a") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise UsageError(f"another process is making this export: {self.folder} is in use") from None
            except OSError as error:
                if error.errno not in NO_LOCKS:
                    raise
            sweep(self.folder)
            self._begin()
            yield

    def _begin(self) -> None:
        parts, same = self.folder / "parts", False
        with contextlib.suppress(OSError, ValueError, Malformed):
            same = loads_json((self.folder / _REQUEST).read_text(encoding="utf-8")) == self._request
        if not same:
            remove(parts)
            atomic_write(self.folder, _REQUEST, json.dumps(self._request, sort_keys=True))
        make_folder(parts)
        self.resumed = same and any(parts.iterdir())

    def part(self, number: int) -> Path:
        """Return where a part lies, whose folder appears when it is finished."""
        return self.folder / "parts" / f"{number:06d}"


def link_or_copy(source: Path, target: Path) -> None:
    """Give a finished file its place in the export, without copying it where the disk can."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target)
    except FileNotFoundError:
        raise StoreError(f"{source} is missing: run the same command with --force") from None
    except OSError:
        # No hard links here: a copy.
        shutil.copyfile(source, target)


def count_routes(data: DataRoot, scene: str, subset: str) -> tuple[int, int]:
    """Count a scene's routes in a subset, and their poses: one before every action, and the last one."""
    actions = store.read_scene(data, f"routes/{subset}", scene, ("n_actions",))["n_actions"]
    return len(actions), len(actions) + (pc.sum(actions).as_py() or 0)
