"""Import other benchmarks' task files as tables like the release's: whole or not at all, every bad record named."""

from __future__ import annotations

import os
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from aerialdojo_gen.base.errors import ImportRefused, UsageError, brief
from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.exchange import aerialdojo_layout, readers
from aerialdojo_gen.exchange.folder import whole_folder_below, write_json
from aerialdojo_gen.exchange.frames import FRAMES, Frame
from aerialdojo_gen.exchange.records import BadField, Fields, records, shown
from aerialdojo_gen.exchange.task import Context, Tables, Task, digest, route_row, task_rows
from aerialdojo_gen.store.layout import is_plain
from aerialdojo_gen.store.root import Where, open_root

_MAX_NAMED = 1000
_FAR_M = 3.0


@dataclass
class Report:
    """Counts over all files of an import."""

    format: str  # As asked or as the format fixes it
    frame: str
    files: list[str] = field(default_factory=list)
    records: int = 0  # Records read, good and bad
    bad: list[str] = field(default_factory=list)  # A line a bad record, the first thousand
    n_bad: int = 0  # All of them
    bad_fields: Counter[str] = field(default_factory=Counter)  # How many by field
    unmapped: Counter[str] = field(default_factory=Counter)
    notes: Counter[str] = field(default_factory=Counter)  # Else worth knowing, and of how many records
    rows: dict[str, int] = field(default_factory=dict)
    empty: dict[str, int] = field(default_factory=dict)
    errors_m: array[float] = field(default_factory=lambda: array("d"))  # Replay errors of routes

    def refuse(self, label: str, row: int, error: BadField) -> str:
        """Count a bad record; returns its line."""
        line = f"{label}: row {row}: {error.field}: {error.why}"
        self.n_bad += 1
        self.bad_fields[error.field.split("[")[0]] += 1
        if len(self.bad) < _MAX_NAMED:
            self.bad.append(line)
        return line

    def left(self, names: Iterable[str]) -> None:
        """Count the fields of a record that found no place."""
        for name in names:
            known = name in self.unmapped or len(self.unmapped) < _MAX_NAMED
            self.unmapped[name if known else "(others)"] += 1

    def replay(self) -> dict[str, Any] | None:
        """Summarise the replay errors, metres; None where no record has actions and poses."""
        if not self.errors_m:
            return None
        errors = np.asarray(self.errors_m)
        median_m, max_m = (round(float(value), 6) for value in (np.median(errors), errors.max()))
        far = int((errors > _FAR_M).sum())
        return {"routes": len(errors), "median_m": median_m, "max_m": max_m, f"over_{_FAR_M:g}_m": far}

    def document(self) -> dict[str, Any]:
        """All of it, for ``import.json``."""
        return {
            "format": self.format, "frame": self.frame, "files": self.files, "records": self.records,
            "rows": self.rows, "bad_records": self.n_bad, "bad_fields": dict(sorted(self.bad_fields.items())),
            "not_mapped": dict(sorted(self.unmapped.items())), "null_columns": dict(sorted(self.empty.items())),
            "notes": dict(sorted(self.notes.items())), "replay_error": self.replay(),
        }  # fmt: skip

    def lines(self) -> list[str]:
        """All of it, for a person."""
        made = ", ".join(f"{n:,} {name}" for name, n in sorted(self.rows.items(), reverse=True))
        lines = [f"{self.format}, frame {self.frame}: {self.records:,} records in {len(self.files)} files; {made}"]
        if self.n_bad:
            fields = ", ".join(f"{name} {n:,}" for name, n in self.bad_fields.most_common())
            lines.append(f"left out: {self.n_bad:,} bad records ({fields}): see bad_records.txt")
        if self.unmapped:
            lines.append("not mapped: " + ", ".join(f"{name} {n:,}" for name, n in sorted(self.unmapped.items())))
        for table, rows in sorted(self.rows.items(), reverse=True):
            columns = (column.split(".") for column, n in sorted(self.empty.items()) if n == rows)
            if names := [name for of, name in columns if of == table]:
                lines.append(f"always null in {table}: {', '.join(names)}")
        lines += [f"{n:,} x {note}" for note, n in sorted(self.notes.items())]
        if (replay := self.replay()) is not None:
            lines.append(
                f"replay_error_m over {replay['routes']:,} routes: median {replay['median_m']:g}, "
                f"largest {replay['max_m']:g}, over {_FAR_M:g} m {replay[f'over_{_FAR_M:g}_m']:,}"
            )
        return lines


# Numbers of ours, where other objects of the scene have the file's: out of their way.
_OURS_FROM = 1_000_000


class Objects:
    """Collects what tasks say about their targets; pictures are read at the end, so memory holds none."""

    def __init__(self) -> None:
        self._numbers: dict[str, dict[object, int]] = {}
        self._rows: dict[tuple[str, int], dict[str, Any]] = {}
        self._pictures: dict[tuple[str, int], dict[str, Path | None]] = {}
        self._owners: dict[str, tuple[str, int]] = {}

    def number(self, task: Task) -> int | None:
        """Number the task's target: the file's own number, else one by order of appearance; None for no object."""
        if "target_object_id" in task.known:
            return int(task.known["target_object_id"])
        if task.object_key is None:
            return None
        own = self._numbers.setdefault(task.scene, {})
        return own.setdefault(task.object_key, _OURS_FROM + len(own))

    def add(self, task: Task, number: int) -> list[str | None]:
        """Take in what the task says about its target and its start."""
        known = task.known
        texts = [i.description for i in task.instances if i.description]
        row = {name: known.get(name) for name in ("mesh_node", "category", "direction", "landmark")}
        row |= {"name": known.get("target_name"), "description": next(iter(texts), known.get("description"))}
        if task.object_m is not None:
            row |= dict(zip(("x_m", "y_m", "z_m"), task.object_m.tolist(), strict=True))
        self._merge(task.scene, number, row)
        if "start_object_id" in known:
            start = {"name": known.get("start_object_name"), "mesh_node": known.get("start_mesh_node")}
            self._merge(task.scene, known["start_object_id"], start)
        return [self._picture((task.scene, number), i.picture) if i.picture else None for i in task.instances]

    def _merge(self, scene: str, number: int, row: dict[str, Any]) -> None:
        kept = self._rows.setdefault((scene, number), {})
        for name, value in row.items():
            if value is not None:
                kept.setdefault(name, value)

    def _picture(self, owner: tuple[str, int], path: Path) -> str:
        name = path.stem
        if self._owners.setdefault(name, owner) != owner:
            name = f"{name}-{digest(*map(str, owner))}"
        self._pictures.setdefault(owner, {}).setdefault(name, path)
        return name

    def write(self, tables: Tables) -> None:
        """Write the rows, one an object and picture, by scene and number."""
        for scene, number in sorted(self._rows):
            row = self._rows[scene, number] | {"scene": scene, "object_id": number}
            for name, picture in sorted(self._pictures.get((scene, number), {"": None}).items()):
                data = picture and picture.read_bytes()
                tables.add("objects", {**row, "reference_image_id": name, "reference_image": data})


MARKER = "import.json"
Read = Callable[[Fields, Context], Task]


@dataclass(frozen=True)
class Format:
    """A format that can be imported."""

    read: Read | None  # Reads a record; None where a reader of its own remembers those before
    key: str | None = None  # Where the list of records stands; None: it is the whole file
    frame: str | None = "ned"  # Its frame; None where the format does not state it


FORMATS = {
    "aerialdojo": Format(None),
    "uav-on": Format(readers.read_uav_on),
    "cityavos": Format(readers.read_cityavos, frame=None),
    "aerialvln": Format(readers.read_aerialvln, key="episodes"),
    "openfly": Format(readers.read_openfly, frame=None),
}


@dataclass(frozen=True)
class Options:
    """What a format leaves open, and what to do with bad records."""

    frame: str | None = None  # For formats that do not state theirs
    angles: str = "radians"
    pictures: Path | None = None  # Folder below which CityAVOS's pictures lie; None: the file's own
    with_pictures: bool = True  # False: leave pictures aside, and the image instances of CityAVOS with them
    skip_bad: bool = False  # Keep the good records of files that have bad ones


def import_benchmark(
    format_name: str,
    files: Sequence[Path],
    data: Where,
    options: Options | None = None,
    *,
    name: str | None = None,
    force: bool = False,
) -> Report:
    """Import others' task files as tables; for damaged files, or bad records that are not skipped, write nothing."""
    options = options or Options()
    check_known("no format", [format_name], FORMATS)
    chosen = FORMATS[format_name]
    frame = _frame(format_name, chosen, options.frame)
    if options.angles not in ("radians", "degrees", "mixed"):
        raise UsageError(f"angles are radians, degrees or mixed, not {options.angles!r}")
    sources = _sources(format_name, files)
    report = Report(format_name, frame.name)
    if not is_plain(name or format_name):
        raise UsageError(f"{name!r} cannot name an import: use letters, digits, _ and - (64 at most)")
    root, target = open_root(data), f"imported/{name or format_name}"
    with whole_folder_below(root, target, MARKER, force=force) as folder:
        tables, objects = Tables(folder), Objects()
        with (folder / "bad_records.txt").open("w", encoding="utf-8") as bad:
            for task, source in _tasks(sources, chosen, frame, options, report, bad):
                _write(task, source, tables, objects, report)
        if report.n_bad and not options.skip_bad:
            more = [f"and {report.n_bad - len(report.bad):,} more"] if report.n_bad > len(report.bad) else []
            head = f"{report.n_bad:,} of {report.records:,} records are bad, nothing is written"
            raise ImportRefused("\n  ".join([f"{head} (--skip-bad keeps the rest):", *report.bad, *more]))
        objects.write(tables)
        tables.close()
        report.rows = dict(tables.written)
        report.empty = {column: n for column, n in tables.nulls.items() if n}
        if not report.n_bad:
            (folder / "bad_records.txt").unlink()
        write_json(folder / MARKER, report.document())
    return report


def _frame(format_name: str, chosen: Format, asked: str | None) -> Frame:
    if chosen.frame and asked not in (None, chosen.frame):
        raise UsageError(f"{format_name} files are {chosen.frame} by their format: leave --frame out")
    name = chosen.frame or asked
    if name is None:
        raise UsageError(f"{format_name} files do not say which way their axes point: --frame {'|'.join(FRAMES)}")
    if name not in FRAMES:
        raise UsageError(f"no frame {name!r}: it is one of {', '.join(FRAMES)} (the directions of x, y and z)")
    return FRAMES[name]


def _sources(format_name: str, files: Sequence[Path]) -> list[tuple[str, Path]]:
    """The files, each once, by their names relative to the folder that they share."""
    absolute: dict[Path, None] = {}
    for path in files:
        if not path.exists():
            raise UsageError(f"there is no file {path}")
        for file in aerialdojo_layout.task_files(path) if format_name == "aerialdojo" else [path]:
            if not file.is_file():
                raise UsageError(f"{file} is no file")
            absolute.setdefault(file.absolute())
    if not absolute:
        raise UsageError("no file is named")
    common = Path(os.path.commonpath([p.parent for p in absolute]))
    named: dict[str, Path] = {}
    for path in absolute:
        label = aerialdojo_layout.label(path) if format_name == "aerialdojo" else None
        label = label or path.relative_to(common).as_posix()
        if label in named:
            raise UsageError(f"{path} and {named[label]} are both {label}: import one of them, or each by its --name")
        named[label] = path
    return list(named.items())


def _tasks(
    sources: Sequence[tuple[str, Path]], chosen: Format, frame: Frame, options: Options, report: Report, bad: TextIO
) -> Iterator[tuple[Task, dict[str, Any]]]:
    read = chosen.read or aerialdojo_layout.Reader().read
    for label, path in sources:
        report.files.append(label)
        pictures = (options.pictures or path.parent) if options.with_pictures else None
        ids: set[str] = set()
        for row, value in enumerate(records(path, chosen.key)):
            report.records += 1
            # Notes count only if the record turns out good.
            context = Context(path, label, frame, options.angles, pictures, Counter())
            try:
                record = Fields(value)
                task = read(record, context)
                if not is_plain(task.scene):
                    why = "is not a scene name: use letters, digits, _ and - (64 at most)"
                    raise BadField("scene", f"{shown(task.scene)} {why}")
                if task.source_id in ids:
                    raise BadField("id", f"{brief(task.source_id, 60)} appears twice in the file")
            except BadField as error:
                bad.write(report.refuse(label, row, error) + "\n")
                continue
            ids.add(task.source_id)
            report.left(record.unread())
            report.notes.update(context.notes)
            yield task, {"source_file": label, "source_row": row, "source_id": task.source_id}


def _write(task: Task, source: dict[str, Any], tables: Tables, objects: Objects, report: Report) -> None:
    nav_id = task.nav_id or f"{task.scene}-{digest(source['source_file'], task.source_id)}"
    number = objects.number(task)
    pictures: list[str | None] = [None] * len(task.instances)
    if number is not None:
        task.known["target_object_id"] = number
        pictures = objects.add(task, number)
    for row in task_rows(task, nav_id, source, pictures):
        tables.add("tasks", row)
    if task.has_route_row:
        tables.add("routes", route_row(task, nav_id, source))
        if task.route is not None:
            report.errors_m.append(task.route.replay_error_m)
