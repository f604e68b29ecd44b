"""Finished episodes on their way to the tables: one line of JSON each, so that a kill loses none of them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from aerialdojo_gen.base.errors import Malformed, StoreError, disk_error
from aerialdojo_gen.base.safe_parse import loads_json


class Journal:
    """A file of finished episodes, written line by line; a context manager."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
            self.done = frozenset(str(record.get("task_id")) for record in read(path))
            _cut_short_line(path)
            self._file = path.open("a", encoding="utf-8")
        except OSError as error:
            raise disk_error(error, path) from None

    def add(self, record: dict[str, Any]) -> None:
        """Write a record; it is the operating system's when this returns."""
        try:
            self._file.write(json.dumps(record, separators=(",", ":")) + "\n")
            self._file.flush()
        except OSError as error:
            raise disk_error(error, self._path) from None

    def __enter__(self) -> Journal:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self._file.close()


def _cut_short_line(path: Path) -> None:
    """Take away a last line that a kill cut short."""
    with path.open("r+b") as file:
        file.truncate(sum(len(line) for line in file if line.endswith(b"\n")))


def read(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the records of a journal; a line that a kill cut short is no record."""
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if not line.endswith(b"\n"):
                return
            try:
                record = loads_json(line, finite=False)
            except Malformed as error:
                raise StoreError(
                    f"{path}: line {number} is damaged ({error}): delete the file, or --restart"
                ) from None
            if not isinstance(record, dict):
                raise StoreError(f"{path}: line {number} is no record: delete the file, or --restart")
            yield record
