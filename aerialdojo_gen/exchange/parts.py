"""Exports that take long: parts that are finished stay where a run is killed, and the same command goes on."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import Malformed, StoreError, UsageError
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.store.atomic import atomic_file, atomic_folder, make_folder
from aerialdojo_gen.store.staging import NO_LOCKS, remove, sweep

_REQUEST, _LOCK = "request.json", "lock"


class Unfinished:
    """The parts of an export that are finished, beside the folder that it will be."""

    def __init__(self, target: Path, request: dict[str, Any]) -> None:
        self.folder = target.absolute().with_name(f".{target.name}.unfinished")
        self._request = request
        self.resumed = False

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Hold the folder, which nobody else may write to meanwhile."""
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
        path = self.folder / _REQUEST
        try:
            same = loads_json(path.read_text(encoding="utf-8")) == self._request
        except (OSError, ValueError, Malformed):
            same = False
        if not same:
            remove(self.folder / "parts")
            with atomic_file(self.folder, _REQUEST) as temporary:
                temporary.write_text(json.dumps(self._request, sort_keys=True), encoding="utf-8")
        make_folder(self.folder / "parts")
        self.resumed = same and any((self.folder / "parts").iterdir())

    def part(self, number: int) -> Path:
        """Return where a part lies, or will lie."""
        return part_folder(self.folder, number)

    def has(self, number: int) -> bool:
        """Whether a part is finished: its folder appears whole."""
        return self.part(number).is_dir()

    def remove(self) -> None:
        """Remove all of it, when the export is whole."""
        shutil.rmtree(self.folder, ignore_errors=True)


def part_folder(unfinished: Path, number: int) -> Path:
    """Return where a part lies."""
    return unfinished / "parts" / f"{number:06d}"


@contextlib.contextmanager
def whole_part(unfinished: Path, number: int) -> Iterator[Path]:
    """Fill the folder of a part, which appears whole or not at all."""
    with atomic_folder(part_folder(unfinished, number), unfinished) as folder:
        yield folder


def place(source: Path, target: Path) -> None:
    """Give a finished file its place in the export, without copying it where the disk can."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target)
    except FileNotFoundError:
        raise StoreError(f"{source} is missing: run the same command with --force") from None
    except OSError:
        # No hard links here: a copy.
        shutil.copyfile(source, target)
