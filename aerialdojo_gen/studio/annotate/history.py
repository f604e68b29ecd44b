"""The history of an annotation file: one JSON line a change, saying who did what and when.

It is also what undo and redo are made of, so that both outlive the server and a reload of the page.
"""

from __future__ import annotations

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
    who: str  # Name that the person gave
    client: str  # The browser tab, whose undo and redo this is a part of
    action: Action  # ``outside``: the file was changed by something other than this tool
    what: str  # In words
    before: str  # Versions of the file (SHA-256 of its bytes, hexadecimal)
    after: str
    edits: tuple[Edit, ...]


class History:
    """The lines of a history file, read on as it grows."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.records: list[Record] = []
        self.whole = 0  # bytes up to the end of the last whole line
        self._lock = threading.Lock()

    def refresh(self) -> None:
        """Read what has been added since; a line without an end, left by a crash, is passed over."""
        with self._lock:
            self._read_on()

    def _read_on(self) -> None:
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
            try:
                self.records.append(Record.model_validate_json(line))
            except ValidationError:
                continue  # of another version, or damaged: it can no longer be undone, and that is all
        self.whole += end

    def stacks(self, client: str) -> tuple[list[Record], list[Record]]:
        """What a tab can undo and redo, the next one last."""
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
        """The changes after a version, as far as the history knows it; all of them where it does not."""
        last = max((k for k, record in enumerate(self.records) if record.after == version), default=None)
        first = max((k for k, record in enumerate(self.records) if record.before == version), default=None)
        start = last + 1 if last is not None else first if first is not None else 0
        yield from self.records[start:]

    def highest_id(self, kind: str) -> int:
        """The highest id that an entry of a kind ever had here; -1 where there was none."""
        return max((e.id for record in self.records for e in record.edits if e.kind == kind), default=-1)
