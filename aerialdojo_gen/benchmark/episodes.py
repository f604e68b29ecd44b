"""The log of a run: `episodes`, `steps`, `timings` and `failures`, and the journals that come before them.

The tables are under ``<folder>/<table>/<run>/``. A finished episode goes into a journal, a line of JSON each, so that
a kill loses none of them. In a data directory journals are in the run's folder. An object store cannot append to a
file: there the journals are in a local folder, and new lines are committed every `CHECKPOINT_S` seconds as an object
of their own. Another machine that resumes the run repeats what was finished after the last checkpoint.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path, PurePosixPath
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import Malformed, StoreError, disk_error
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import make_folder
from aerialdojo_gen.store.cache import cache_folder
from aerialdojo_gen.store.layout import shard_folder
from aerialdojo_gen.store.root import DataRoot, LocalRoot, Where, open_root
from aerialdojo_gen.store.tables import from_rows

TABLES = ("episodes", "steps", "timings", "failures")


def runs(data: Where) -> list[str]:
    """List the runs that have written episodes, by name."""
    return sorted({PurePosixPath(name).parent.name for name in open_root(data).list("episodes", "*/part-*.parquet")})


def run_scenes(data: Where, run: str) -> list[str]:
    """List the scenes that a run has written, by name."""
    names = open_root(data).list(shard_folder("episodes", "any", run), "part-*.parquet")
    return sorted(PurePosixPath(name).stem.removeprefix("part-") for name in names)


def read_run(data: Where, run: str, table: str = "episodes", columns: Sequence[str] | None = None) -> pa.Table:
    """Read a table of a run, all its scenes."""
    root = open_root(data)
    scenes = run_scenes(root, run)
    if not scenes:
        raise StoreError(f"{unknown(f'in {root} there is no run', run, runs(root))}; "
                         f"{command('evaluate', run=run)} makes it")  # fmt: skip
    return pa.concat_tables([store.read_scene(root, table, scene, columns, run=run) for scene in scenes])


def has_table(data: Where, run: str, table: str) -> bool:
    """Whether a run has a table for every scene with episodes."""
    return all(store.shards(data, table, scene, run) for scene in run_scenes(data, run))


def add_records(data: Where, run: str, scene: str, records: Sequence[dict[str, Any]], fingerprint: str) -> None:
    """Add finished episodes of a scene to a run's tables."""
    by_task = {record["task_id"]: record for record in records}
    ordered = [by_task[task_id] for task_id in sorted(by_task)]
    flown = [record for record in ordered if "episode" in record]
    new = {
        "episodes": from_rows(schemas.EPISODES, [record["episode"] for record in flown]),
        "steps": _steps(run, scene, flown),
        "timings": from_rows(schemas.TIMINGS, [record["timing"] for record in flown]),
        "failures": from_rows(schemas.FAILURES, [r["failure"] for r in ordered if "failure" in r]),
    }
    replaced = pa.array([record["task_id"] for record in flown], pa.string())
    for table in reversed(TABLES):
        rows = new[table]
        if store.shards(data, table, scene, run):
            # An episode or a newer failure replaces an older failure.
            gone = replaced if table != "failures" else pa.array(list(by_task), pa.string())
            kept = store.read_scene(data, table, scene, run=run)
            kept = kept.filter(pc.invert(pc.is_in(kept["task_id"], gone)))
            rows = pa.concat_tables([kept, rows.replace_schema_metadata(None).cast(kept.schema)])
            rows = rows.sort_by([(key, "ascending") for key in store.LAYOUT[table].spec.key])
        store.write_shard(data, table, scene, 0, rows, fingerprint=fingerprint, run=run)


def _steps(run: str, scene: str, flown: Sequence[dict[str, Any]]) -> pa.Table:
    """Join the columns of the episodes' steps."""
    parts = [schemas.STEPS.schema.empty_table()]
    for record in flown:
        own, n = {"run_id": run, "scene": scene, "task_id": record["task_id"]}, len(record["steps"]["action"])
        columns = {name: [value] * n for name, value in own.items()} | {"step": [*range(n)]} | record["steps"]
        parts.append(pa.table(columns, schema=schemas.STEPS.schema))
    return pa.concat_tables(parts)


def remove_run(data: Where, run: str) -> None:
    """Remove a run's tables."""
    root = open_root(data)
    for table in TABLES:
        for name in root.list(shard_folder(table, "any", run), "part-*.parquet"):
            root.delete(name)


class Journal(AbstractContextManager["Journal"]):
    """A file of finished episodes, written line by line; a context manager."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
            self.done = frozenset(str(record.get("task_id")) for record in read_journal(path))
            # A last line that a kill cut short goes.
            os.truncate(path, sum(map(len, _whole_lines(path))))
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

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._file.close()


def read_journal(path: Path) -> Iterator[dict[str, Any]]:
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


CHECKPOINT_S = 30.0


class Journals:
    """The journals of a run."""

    def __init__(self, root: DataRoot, run: str) -> None:
        self._root, self._name = root, f"runs/{run}/journal"
        self._committed = not isinstance(root, LocalRoot)
        if isinstance(root, LocalRoot):
            self.folder = root.path / self._name
        else:
            # Of this machine: the same for the same URL and name.
            self.folder = cache_folder() / "journals" / hashlib.sha256(root.url.encode()).hexdigest()[:16] / run
            make_folder(self.folder)
        self._sent: dict[Path, int] = {}
        self._call, self._batches = secrets.token_hex(4), 0
        self._last = time.monotonic()

    def path(self, scene: str, unit: int) -> Path:
        """Return the file of a unit of a scene's episodes."""
        return self.folder / f"{scene}.{unit:04d}.jsonl"

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._by_scene("*"))

    def _by_scene(self, scene: str) -> dict[str, tuple[list[Path], list[str]]]:
        """List journals by scene: files of this machine, and objects of the store."""
        found: dict[str, tuple[list[Path], list[str]]] = defaultdict(lambda: ([], []))
        for path in sorted(self.folder.glob(f"{scene}.*.jsonl")):
            found[path.name.split(".", 1)[0]][0].append(path)
        for name in self._root.list(self._name, f"{scene}.*.jsonl") if self._committed else ():
            found[PurePosixPath(name).name.split(".", 1)[0]][1].append(name)
        return found

    def take(self, scene: str = "*") -> Iterator[tuple[str, list[dict[str, Any]]]]:
        """Yield the finished episodes by scene, some twice, and remove their journals when the next are asked for."""
        for own, (paths, names) in self._by_scene(scene).items():
            files = [*map(self._root.local_copy, names), *paths]
            yield own, [record for path in files for record in read_journal(path)]
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


def _whole_lines(path: Path, begun: int = 0) -> Iterator[bytes]:
    with path.open("rb") as file:
        file.seek(begun)
        yield from (line for line in file if line.endswith(b"\n"))
