"""Where a run's finished episodes lie until they are in its tables.

In a data directory that is the run's folder. An object store has no file that lines can be added to: there the
journals lie in a folder of this machine, and what has come to them is committed every `CHECKPOINT_S` seconds, each
time as an object of its own. The tables take both. So a kill loses nothing that this machine goes on with; where
another machine goes on, it flies again what was finished since the last checkpoint.
"""

from __future__ import annotations

import hashlib
import secrets
import shutil
import time
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from aerialdojo_gen.benchmark import journal
from aerialdojo_gen.store.atomic import make_folder
from aerialdojo_gen.store.cache import cache_folder
from aerialdojo_gen.store.layout import check_run_name
from aerialdojo_gen.store.root import DataRoot, LocalRoot

CHECKPOINT_S = 30.0


class Journals:
    """The journals of a run."""

    def __init__(self, root: DataRoot, run: str) -> None:
        self._root, self._name = root, f"runs/{check_run_name(run)}/journal"
        self._committed = not isinstance(root, LocalRoot)
        self.folder = root.path / self._name if isinstance(root, LocalRoot) else _working_folder(root, run)
        self._sent: dict[Path, int] = {}
        self._call, self._batches = secrets.token_hex(4), 0
        self._last = time.monotonic()

    def path(self, scene: str, unit: int) -> Path:
        """Return the file of a unit of a scene's episodes."""
        return self.folder / f"{scene}.{unit:04d}.jsonl"

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self.scenes())

    def scenes(self, scene: str = "*") -> dict[str, tuple[list[Path], list[str]]]:
        """List journals by scene: files of this machine, and objects of the store; of one scene where it is named."""
        found: dict[str, tuple[list[Path], list[str]]] = {}
        for path in sorted(self.folder.glob(f"{scene}.*.jsonl")):
            found.setdefault(path.name.split(".", 1)[0], ([], []))[0].append(path)
        for name in self._root.list(self._name, f"{scene}.*.jsonl") if self._committed else ():
            found.setdefault(PurePosixPath(name).name.split(".", 1)[0], ([], []))[1].append(name)
        return found

    def records(self, scene: str) -> list[dict[str, Any]]:
        """Read the finished episodes of a scene; one may stand in a file and in an object."""
        paths, names = self.scenes(scene).get(scene, ([], []))
        return [record for path in [*map(self._root.local_copy, names), *paths] for record in journal.read(path)]

    def remove(self, scene: str) -> None:
        """Remove the journals of a scene, which are in the tables."""
        paths, names = self.scenes(scene).get(scene, ([], []))
        for path in paths:
            path.unlink()
            self._sent.pop(path, None)
        for name in names:
            self._root.delete(name)

    def drop(self) -> None:
        """Remove all."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self._root.delete(self._name)
        self._sent.clear()

    def checkpoint(self) -> None:
        """Commit what has come since the last checkpoint, if that is long enough ago; nothing in a data directory."""
        if not self._committed or time.monotonic() - self._last < CHECKPOINT_S:
            return
        self._last = time.monotonic()
        for path in sorted(self.folder.glob("*.jsonl")):
            begun = self._sent.get(path, 0)
            lines = b"".join(_whole_lines(path, begun))
            if lines:
                name = f"{self._name}/{path.stem}.{self._call}-{self._batches:05d}.jsonl"
                with self._root.commit(name) as temporary:
                    temporary.write_bytes(lines)
                self._batches += 1
                self._sent[path] = begun + len(lines)


def _whole_lines(path: Path, begun: int) -> Iterator[bytes]:
    with path.open("rb") as file:
        file.seek(begun)
        yield from (line for line in file if line.endswith(b"\n"))


def _working_folder(root: DataRoot, run: str) -> Path:
    """Return the folder of this machine that a run's journals lie in, made: the same for the same URL and name."""
    folder = cache_folder() / "journals" / hashlib.sha256(root.url.encode()).hexdigest()[:16] / run
    make_folder(folder)
    return folder
