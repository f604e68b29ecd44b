"""The history of an annotation file: one JSON line per change, with author and time.

Undo and redo are based on it, so that they survive restarts of the server and reloads of the page.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from aerialdojo_gen.studio.annotate.document import Edit

Action = Literal["do", "undo", "redo", "import", "outside"]


class Record(BaseModel):
    """A line of the history."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    time: str  # UTC, ISO 8601
    who: str  # Name that the person entered
    client: str  # The browser tab that the change's undo belongs to
    action: Action  # ``outside``: changed by something other than this tool
    what: str  # Summary in words
    before: str  # Versions of the file (SHA-256 of its bytes, hexadecimal)
    after: str
    edits: tuple[Edit, ...]


class History:
    """The records of a history file, read incrementally."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.records: list[Record] = []
        self.whole = 0  # bytes up to the end of the last complete line
        self._lock = threading.Lock()

    def refresh(self) -> None:
        """Read new records; an incomplete last line, left by a crash, is ignored."""
        with self._lock:
            size = self.path.stat().st_size if self.path.exists() else 0
            if size < self.whole:
                self.records, self.whole = [], 0
            if size == self.whole:
                return
            with self.path.open("rb") as file:
                file.seek(self.whole)
                tail = file.read()
            end = tail.rfind(b"\n") + 1
            for line in tail[:end].splitlines():
                # Of another version, or damaged: it only cannot be undone.
                with contextlib.suppress(ValidationError):
                    self.records.append(Record.model_validate_json(line))
            self.whole += end

    def stacks(self, client: str) -> tuple[list[Record], list[Record]]:
        """Return a tab's undo and redo stacks, the next one last."""
        undo: list[Record] = []
        redo: list[Record] = []
        for record in self.records:
            if record.client != client:
                continue
            if record.action == "undo" and undo:
                redo.append(undo.pop())
            elif record.action == "redo" and redo:
                undo.append(redo.pop())
            elif record.action in ("do", "import"):
                undo.append(record)
                redo.clear()
        return undo, redo

    def since(self, version: str) -> Iterator[Record]:
        """Yield the changes after a version; all of them if it is unknown."""
        last = max((k for k, record in enumerate(self.records) if record.after == version), default=None)
        first = max((k for k, record in enumerate(self.records) if record.before == version), default=None)
        start = last + 1 if last is not None else first if first is not None else 0
        yield from self.records[start:]

    def highest_id(self, kind: str) -> int:
        """Return the highest id that a kind of entry ever had; -1 if none."""
        return max((e.id for record in self.records for e in record.edits if e.kind == kind), default=-1)
