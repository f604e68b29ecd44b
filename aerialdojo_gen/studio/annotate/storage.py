"""An annotation file that several people and servers change: every change is atomic.

A change is written in three steps, under a lock: the new file under a temporary name, the history record, the
rename. A crash before the record leaves the file unchanged; after it, the next reader completes the rename.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from aerialdojo_gen.annotations.format import Annotations, Strict, format_annotations, parse_annotations
from aerialdojo_gen.base.errors import AnnotationError, brief, disk_error
from aerialdojo_gen.store.layout import check_scene_name
from aerialdojo_gen.studio.annotate import document
from aerialdojo_gen.studio.annotate.document import ConflictError, Edit, Operation

Action = Literal["do", "undo", "redo", "import", "outside"]


class Record(Strict):
    """A line of the history."""

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


@dataclass(frozen=True)
class State:
    """The file at one moment."""

    annotations: Annotations
    text: str  # The file's text; empty if there is none yet
    version: str  # SHA-256 of its bytes, hexadecimal


@dataclass(frozen=True)
class Author:
    """The author of a change: the person's name and the browser tab."""

    who: str
    client: str


class StaleError(ConflictError):
    """A change was based on an outdated version of the file."""


class Storage:
    """The annotation file of one scene and its history."""

    def __init__(self, folder: Path, scene: str) -> None:
        self.scene = check_scene_name(scene)
        self.path = folder / f"{scene}.json"
        self.history = History(folder / f"{scene}.history.jsonl")
        self._temporary = folder / f".{scene}.json.next"
        self._read: State | None = None

    def load(self) -> State:
        """Read the file, completing a write that a crash interrupted."""
        if self._temporary.exists():
            with self.locked():
                self._recover()
        return self._load()

    def _load(self) -> State:
        try:
            raw = self.path.read_bytes()
        except FileNotFoundError:
            raw = b""
        except OSError as error:
            raise AnnotationError(f"{self.path} cannot be read: {error.strerror}") from None
        version = hashlib.sha256(raw).hexdigest()
        if self._read is None or self._read.version != version:
            content = parse_whole(raw, self.scene, str(self.path)) if raw else Annotations(self.scene, (), ())
            self._read = State(content, raw.decode("utf-8"), version)
        return self._read

    def change(self, version: str, author: Author, operation: Operation) -> tuple[State, Record | None]:
        """Apply an operation and save it."""

        def edits(state: State) -> list[Edit]:
            # No id is used again, of an entry that is gone either.
            ids = {entry.id for entry in getattr(state.annotations, operation.kind)}
            ids |= {e.id for record in self.history.records for e in record.edits if e.kind == operation.kind}
            return document.edits_of(operation, state.annotations, max(ids, default=-1) + 1)

        return self._commit(version, author, "do", edits)

    def replace(self, version: str, author: Author, raw: bytes) -> tuple[State, Record | None]:
        """Replace the file by another one, as a change that can be undone; `AnnotationError` if it is invalid."""
        after = parse_whole(raw, self.scene, "the file")
        return self._commit(version, author, "import", lambda state: document.difference(state.annotations, after))

    def undo(self, version: str, author: Author) -> tuple[State, Record | None]:
        """Undo the last change of the author's tab; `ConflictError` if the entry has changed since."""

        def edits(_: State) -> list[Edit]:
            done, _undone = self.history.stacks(author.client)
            return [edit.reversed() for edit in reversed(done[-1].edits)] if done else []

        return self._commit(version, author, "undo", edits)

    def redo(self, version: str, author: Author) -> tuple[State, Record | None]:
        """Redo the last undone change of the author's tab."""

        def edits(_: State) -> list[Edit]:
            return [edit for record in self.history.stacks(author.client)[1][-1:] for edit in record.edits]

        return self._commit(version, author, "redo", edits)

    def _commit(
        self, version: str, author: Author, action: Action, edits_of_state: Callable[[State], Sequence[Edit]]
    ) -> tuple[State, Record | None]:
        with self.locked():
            self._recover()
            state = self._load()
            if state.version != version:
                raise StaleError("these annotations have been changed by another client")
            edits = tuple(edits_of_state(state))
            after = document.apply(state.annotations, edits)
            if not edits:
                return state, None
            raw = format_annotations(after).encode("utf-8")
            digest = hashlib.sha256(raw).hexdigest()
            now = datetime.now(UTC).isoformat(timespec="seconds")
            record = Record(
                time=now, who=author.who, client=author.client, action=action, what=document.describe(edits),
                before=state.version, after=digest, edits=edits,
            )  # fmt: skip
            last_version = self.history.records[-1].after if self.history.records else state.version
            outside = Record(
                time=now, who="", client="", action="outside", what="changed outside of this tool",
                before=last_version, after=state.version, edits=(),
            )  # fmt: skip
            try:
                self._write(raw, [record] if last_version == state.version else [outside, record])
            except OSError as error:
                raise disk_error(error, self.path) from error
            self.history.refresh()
            self._read = State(after, raw.decode("utf-8"), digest)
            return self._read, record

    def _write(self, raw: bytes, records: Sequence[Record]) -> None:
        with self._temporary.open("wb") as file:
            file.write(raw)
            file.flush()
            os.fsync(file.fileno())
        with self.history.path.open("r+b") as file:
            file.truncate(self.history.whole)  # drop an incomplete line
            file.seek(self.history.whole)
            file.write(b"".join(record.model_dump_json().encode("utf-8") + b"\n" for record in records))
            file.flush()
            os.fsync(file.fileno())
        self._rename()

    def _rename(self) -> None:
        self._temporary.replace(self.path)
        folder = os.open(self.path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)

    def _recover(self) -> None:
        """Complete the rename of the history's last record, or drop an unrecorded file."""
        self.history.refresh()
        if not self._temporary.exists():
            return
        digest = hashlib.sha256(self._temporary.read_bytes()).hexdigest()
        last = self.history.records[-1] if self.history.records else None
        if last is not None and last.after == digest and self._load().version == last.before:
            self._rename()
        else:
            self._temporary.unlink()

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the scene against other writers."""
        # The history file is also the lock: it is never replaced, so that all processes share it.
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.history.path.open("ab") as file:
                fcntl.flock(file, fcntl.LOCK_EX)
                yield
        except OSError as error:
            raise disk_error(error, self.history.path) from error


def parse_whole(raw: bytes, scene: str, name: str) -> Annotations:
    """Parse an annotation file without faults of form."""
    try:
        source = parse_annotations(raw.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise AnnotationError(f"{name} is not UTF-8: {error}") from None
    if source.faults:
        more = f" (and {len(source.faults) - 1} more)" if len(source.faults) > 1 else ""
        raise AnnotationError(f"{name}: {source.faults[0]}{more}")
    if source.scene != scene:
        raise AnnotationError(f"{name} is of scene {brief(repr(source.scene), 60)}, not of {scene!r}")
    for kind in ("landmarks", "objects"):
        ids = [entry.id for entry in getattr(source.annotations, kind)]
        if len(set(ids)) < len(ids):
            raise AnnotationError(f"{name}: duplicate id in {kind}: fix it in an editor first")
    return source.annotations
