"""Folders that appear whole or not at all, and paths that stay in theirs."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from aerialdojo_gen.base.errors import UsageError, disk_error
from aerialdojo_gen.store.atomic import atomic_folder
from aerialdojo_gen.store.root import DataRoot, LocalRoot
from aerialdojo_gen.store.staging import sweep

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
    if taken and not ours:
        raise UsageError(f"{target} is there already and holds no {marker}: name another folder")
    if taken and not force:
        raise UsageError(f"{target} is there already: --force replaces it")


@contextlib.contextmanager
def whole_folder_below(root: DataRoot, relative: str, marker: str, *, force: bool) -> Iterator[Path]:
    """Fill a folder below a data root as `whole_folder` does."""
    if isinstance(root, LocalRoot):
        with whole_folder(root.path / relative, marker, force=force) as temporary:
            yield temporary
        return
    if root.exists(relative):
        if not root.exists(f"{relative}/{marker}"):
            raise UsageError(f"{root.at(relative)} is there already and holds no {marker}: name another folder")
        if not force:
            raise UsageError(f"{root.at(relative)} is there already: --force replaces it")
    with root.commit_folder(relative) as temporary:
        yield temporary


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a small JSON document for people and programs."""
    path.write_text(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


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
        raise ValueError(f"{relative!r} leads out of {root}")
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
