"""Finished episodes on their way to the tables: one line of JSON each, so that a kill loses none of them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from aerialdojo_gen.atomic import disk_error


class Journal:
    """A file of finished episodes, written line by line; a context manager.

    Parameters
    ----------
    path : Path
        Made anew, with its folder.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("w", encoding="utf-8")
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


def read(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the records of a journal; a line that a kill cut short is no record."""
    with path.open("rb") as file:
        for line in file:
            if not line.endswith(b"\n"):
                return
            record: dict[str, Any] = json.loads(line)
            yield record
