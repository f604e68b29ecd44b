"""The files of a release: which there should be, what they hold, and which do not belong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate
from pathlib import PurePosixPath

import pyarrow as pa

from aerialdojo_gen.base.errors import DamagedFile
from aerialdojo_gen.dataset.contents import FOLDER, SHARDS, part_name
from aerialdojo_gen.dataset.validate.registry import Outcome
from aerialdojo_gen.dataset.validate.rows import Rows
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, LocalRoot, Where, open_root
from aerialdojo_gen.store.schemas import TableSpec
from aerialdojo_gen.store.tables import content_digest, read_file

# Other files of a release: cards, licence, files of a hub's client, pictures.
_OTHER_FILES = {
    "README.md", "croissant.json", "pipeline.json", "protocol.json", "LICENSE", "CITATION.cff", ".gitattributes",
    "figures", "stats",
}  # fmt: skip

# Tables that must not be empty; a split may have none of a scene's tasks.
_FEW = ("release/scenes", "release/landmarks", "release/objects", "release/anchors")


def release_tables() -> dict[str, list[str]]:
    """Return the keys of `store.LAYOUT` that make up each table of a release, by the table's name."""
    keys: dict[str, list[str]] = {}
    for key in SHARDS:
        keys.setdefault(store.LAYOUT[key].spec.name, []).append(key)
    return keys


@dataclass(frozen=True)
class Release:
    """Where a release lies."""

    root: DataRoot  # What holds it: meshes are named relative to this
    folder: str = FOLDER  # The release's folder there; empty where it is the root itself

    def name(self, relative: str) -> str:
        """Return the name of a file of the release, relative to the root."""
        return f"{self.folder}/{relative}" if self.folder else relative


def release_of(where: Release | Where) -> Release:
    """Find the release in a data root; a release by itself, with or without meshes beside it, is one too."""
    if isinstance(where, Release):
        return where
    root = open_root(where)
    if root.exists(FOLDER):
        return Release(root)
    above, _, name = root.url.rstrip("/").rpartition("/")
    # The root of a disk, or a whole bucket, lies in nothing.
    if not name or above.endswith(":/"):
        return Release(root, "")
    return Release(open_root(above or "/"), name)


def foreign_files(release: Release, scenes: list[str]) -> Outcome:
    """Find what does not belong: no part of a scene, no card."""
    expected = {part_name(key, scene, "") for keys in release_tables().values() for key in keys for scene in scenes}
    outcome = Outcome("foreign_file", "files")
    names = release.root.list(release.folder, "**/*")
    folders = {str(parent) for name in names for parent in PurePosixPath(name).parents}
    for name in names:
        # An object store has no empty folders.
        path = release.root.path / name if isinstance(release.root, LocalRoot) else None
        if name in folders or (path is not None and path.is_dir() and not path.is_symlink()):
            continue
        outcome.rows += 1
        relative = PurePosixPath(name).relative_to(release.folder)
        if relative.as_posix() not in expected and relative.parts[0] not in _OTHER_FILES:
            outcome.fault("a file that is no part of a release", "none", part=relative.as_posix())
    return outcome


def read_tables(release: Release, scene: str) -> tuple[dict[str, Rows], list[Outcome]]:
    """Read a scene's tables, if they can be read."""
    found = {name: Outcome(name, "files") for name in PART_CHECKS}
    runs: dict[str, str] = {}
    tables = {}
    for name, keys in release_tables().items():
        parts = [_read(release, key, scene, found, runs) for key in keys]
        whole = [part for part in parts if part is not None]
        if len(whole) < len(parts):
            continue
        ends = tuple(accumulate(part.num_rows for part in whole))
        paths = tuple(part_name(key, scene, "") for key in keys)
        tables[name] = Rows(name, store.LAYOUT[keys[0]].spec, pa.concat_tables(whole), paths, ends)
    found["part_of_other_run"].rows = len(runs)
    # Parts whose fingerprint is not that of most of the scene's parts.
    for fingerprint, _ in Counter(runs.values()).most_common()[1:]:
        for part in (part for part, own in runs.items() if own == fingerprint):
            written = f"written by run {fingerprint[:12] or '(none)'}"
            found["part_of_other_run"].fault(written, "the run of the scene's other parts", scene=scene, part=part)
    return tables, list(found.values())


PART_CHECKS = {
    "part_missing": "Every scene has its part of every table.",
    "part_damaged": "A part can be read, checksums included.",
    "part_schema": "A part has the declared columns, types and units.",
    "leaking_column": "Tasks have no column beside the declared ones.",
    "part_rows": "A scene has one row in scenes, and is not without landmarks, objects or anchors.",
    "part_content": "A part's rows are those that its footer's digest was made of.",
    "part_of_other_run": "A scene's parts were written by one run of split.",
}


def _read(release: Release, key: str, scene: str, found: dict[str, Outcome], runs: dict[str, str]) -> pa.Table | None:
    spec = store.LAYOUT[key].spec
    relative = part_name(key, scene, "")
    name = release.name(relative)

    def fault(check: str, what: str, expected: str) -> None:
        found[check].fault(what, expected, scene=scene, table=spec.name, part=relative)

    found["part_missing"].rows += 1
    try:
        path = release.root.local_copy(name)
    except FileNotFoundError:
        path = None
    if path is None or not path.is_file():
        fault("part_missing", "no file", f"the {spec.name} of {scene}")
        return None
    found["part_damaged"].rows += 1
    try:
        table, info = read_file(path, None, release.root.at(name)), store.read_info(release.root, name)
    except DamagedFile as error:
        what = str(error).removeprefix(f"{release.root.at(name)} ").split(": delete")[0]
        fault("part_damaged", what, "a whole Parquet file")
        return None
    found["part_schema"].rows += 1
    runs[relative] = info.fingerprint
    found["part_content"].rows += 1
    if content_digest(table) != info.content:
        fault("part_content", "other rows than its footer tells of", f"rows of SHA-256 {info.content[:12]}…")
    extra = [name for name in table.column_names if name not in spec.schema.names]
    if spec.name == "tasks":
        found["leaking_column"].rows += 1
        if extra:
            fault("leaking_column", f"columns {', '.join(extra)}", "what an agent may know, no more")
            table, extra = table.drop_columns(extra), []
    if wrong := list(_schema_faults(spec, table, extra)):
        fault("part_schema", "; ".join(wrong), f"the columns of {spec.name}")
        return None
    found["part_rows"].rows += 1
    if key in _FEW and not (table.num_rows == 1 if key == "release/scenes" else table.num_rows):
        fault("part_rows", f"{table.num_rows} rows", "one row" if key == "release/scenes" else "at least one")
        return None
    return table.replace_schema_metadata(None).cast(pa.schema([pa.field(f.name, f.type) for f in spec.schema]))


def _schema_faults(spec: TableSpec, table: pa.Table, extra: list[str]) -> Iterator[str]:
    if extra:
        yield f"unknown columns {', '.join(extra)}"
    missing = [name for name in spec.schema.names if name not in table.column_names]
    if missing:
        yield f"no columns {', '.join(missing)}"
        return
    for field in spec.schema:
        own = table.schema.field(field.name)
        if own.type != field.type:
            yield f"{field.name} is {own.type}, not {field.type}"
        elif (own.metadata or {}).get(b"unit") != (field.metadata or {}).get(b"unit"):
            yield f"{field.name} is in another unit than {(field.metadata or {}).get(b'unit', b'none').decode()}"
    if not extra and table.column_names != spec.schema.names:
        yield "columns in another order"
