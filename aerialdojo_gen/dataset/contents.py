"""What a release consists of, whether all of it is there, and which recordings belong to no trajectory of it."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import pyarrow as pa

from aerialdojo_gen.base.cli_context import command, current_context
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.names import choose_scenes
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.layout import LAYOUT, is_plain, partition, shard_name
from aerialdojo_gen.store.root import DataRoot, LocalRoot, Where, open_root


@dataclass(frozen=True)
class Table:
    """A table of the release."""

    spec: schemas.TableSpec  # Its columns
    about: str  # What a row is
    split: bool = False  # Whether it lies in a folder a split


TABLES = {
    "tasks": Table(
        schemas.TASKS,
        "One row a task instance: what an agent may know. It holds no coordinate of the target and no route.",
        split=True,
    ),
    "routes": Table(
        schemas.ROUTES,
        "One row a navigation task: the goal and the reference trajectory, for the evaluator.",
        split=True,
    ),
    "objects": Table(schemas.RELEASE_OBJECTS, "One row a target object, with the picture that image goals show."),
    "landmarks": Table(schemas.LANDMARKS, "One row a landmark."),
    "anchors": Table(schemas.RELEASE_ANCHORS, "One row a viewpoint; three an object, one selected as the goal."),
    "viewpoints": Table(
        schemas.VIEWPOINTS, "One row a place at 1 m from an object from which it is seen: where a person would stop."
    ),
    "scenes": Table(schemas.SCENES, "One row a scene."),
}

# Keys of `LAYOUT` that make up a scene's part of the release.
SHARDS = tuple(name for name, place in LAYOUT.items() if place.in_release)
FOLDER = "release"
CARD = f"{FOLDER}/README.md"
CROISSANT = f"{FOLDER}/croissant.json"


def part_name(name: str, scene: str, folder: str = FOLDER) -> str:
    """Return where a scene's part of one of `SHARDS` lies, relative to the data root; `folder` is the release's."""
    return f"{folder}/{shard_name(name, scene).partition('/')[2]}".lstrip("/")


def existing_parts(where: Where, folder: str = FOLDER) -> dict[str, list[str]]:
    """List what a release holds: the scenes, by name, that each of `SHARDS` has a part of."""
    root = open_root(where)
    found: dict[str, list[str]] = {}
    for name in SHARDS:
        folders = sorted({part_name(name, scene, folder).rpartition("/")[0] for scene in ("X_0", "X_1")})
        stems = (PurePosixPath(path).stem for at in folders for path in root.list(at, "part-*.parquet"))
        found[name] = sorted(filter(is_plain, (stem.removeprefix("part-") for stem in stems)))
    return found


def existing_files(where: Where) -> list[str]:
    """List what `TABLES` of a release are made of: names of files, relative to the data root."""
    return [part_name(name, scene) for name, scenes in existing_parts(where).items() for scene in scenes]


def existing_scenes(where: Where, folder: str = FOLDER) -> list[str]:
    """List the scenes that any table of a release has a part of, by name; none if there is no release.

    A scene that lacks a part is listed too, so that reading it raises an error.
    """
    return sorted(set().union(*existing_parts(where, folder).values()))


def prune_release(where: Where, scenes: Sequence[str]) -> list[str]:
    """Remove the parts of all other scenes from the release; returns the names of those removed."""
    root = open_root(where)
    gone = [scene for scene in existing_scenes(root) if scene not in scenes]
    for scene in gone:
        for name in SHARDS:
            root.delete(part_name(name, scene))
    return gone


def scenes_in_release(where: Where, patterns: Sequence[str] | None = None, folder: str = FOLDER) -> list[str]:
    """Resolve names and globs to scenes of a release, by name; all of them if there are no patterns.

    A scene that lacks a part is among them.
    """
    root = open_root(where)
    scenes = existing_scenes(root, folder)
    if not scenes:
        raise no_release(root, folder)
    return choose_scenes(patterns, scenes)


def write_document(where: Where, name: str, text: str) -> None:
    """Write a file that stands beside the tables, whole or not at all."""
    with open_root(where).commit(name) as path:
        path.write_text(text, encoding="utf-8")


def no_release(where: Where, folder: str = FOLDER) -> StoreError:
    """Return the error for a missing release: the folder, what is missing, and what to do."""
    root = open_root(where)
    place = root.url if folder in ("", FOLDER) else root.at(folder)
    # A wheel has no Makefile.
    has_makefile = (Path(__file__).resolve().parents[2] / "Makefile").is_file()
    make = "make dataset" if has_makefile else f"{current_context().program} run aerialdojo-200k"
    lack = _missing_part(root, folder)
    return StoreError(f"there is no release in {place}: {lack}; name its folder with --data, or make one with {make}")


def _missing_part(root: DataRoot, folder: str) -> str:
    if isinstance(root, LocalRoot):
        at = root.path if folder == FOLDER else root.path / folder
        if not at.exists():
            return "the folder does not exist"
        if not at.is_dir():
            return "it is a file, not a folder"
    names = {PurePosixPath(path).name for path in root.list(folder, "*")}
    there = [table for table in TABLES if table in names]
    if there:
        return f"{', '.join(there)} without a file part-<scene>.parquet"
    if folder == FOLDER:
        return "its folder release holds no tables" if root.exists(FOLDER) else "it has no folder release"
    tables = list(TABLES)
    return f"it has no folder release, nor {', '.join(tables[:-1])} or {tables[-1]}"


def check_release(where: Where, scenes: list[str] | None = None) -> list[str]:
    """Check from the footers that the release's parts are there, whole and of one run."""
    root = open_root(where)
    there = existing_parts(root)
    known = sorted(set().union(*there.values())) if scenes is None else scenes
    if not known:
        raise no_release(root)
    wrong = [line for scene in known for line in _faults(root, scene, [n for n in SHARDS if scene in there[n]])]
    if wrong:
        raise StoreError("\n".join(wrong))
    return known


def _faults(root: DataRoot, scene: str, present: list[str]) -> list[str]:
    remedy = f"run {command('split', scene=scene)}"
    if not present:
        return [f"{scene} is not in the release in {root}: {remedy}"]
    lines, prints = [], {}
    for name in SHARDS:
        part = part_name(name, scene)
        if name not in present:
            lines.append(f"{root.at(part)} is missing: {remedy}")
            continue
        try:
            prints[name] = store.read_info(root, part).fingerprint
        except StoreError as error:
            lines.append(str(error))
    if len(set(prints.values())) > 1:
        lines.append(f"the release's parts of {scene} in {root} are of different runs: {remedy} --force")
    return lines


def counts(root: Where, scenes: list[str]) -> dict[str, dict[str, int]]:
    """Count the rows of every table and split of these scenes, from the footers."""
    found: dict[str, Counter[str]] = {name: Counter() for name in TABLES}
    for scene in scenes:
        for name in SHARDS:
            table, split = table_and_split(name, scene)
            found[table][split] += store.count_rows(root, name, scene)
    splits = (*schemas.SUBSETS, "all")
    return {table: {split: rows[split] for split in splits if split in rows} for table, rows in found.items()}


def sizes(where: Where, scenes: list[str]) -> dict[str, int]:
    """Bytes of every table of these scenes."""
    root, total = open_root(where), dict.fromkeys(TABLES, 0)
    for scene in scenes:
        for name in SHARDS:
            total[table_and_split(name, scene)[0]] += root.size(part_name(name, scene))
    return total


def release_fingerprint(data: Where) -> str:
    """SHA-256, hexadecimal, of the names and meshes of a release's scenes: a trained policy depends on them."""
    root, facts = open_root(data), ("scene", "mesh_sha256")
    rows = [store.read_scene(root, "release/scenes", scene, facts).to_pylist() for scene in scenes_in_release(root)]
    return hashlib.sha256(json.dumps(rows, sort_keys=True).encode()).hexdigest()


def table_and_split(name: str, scene: str) -> tuple[str, str]:
    """Return the release's table and split that a scene's shard belongs to: ``"tasks/train"`` of U_Mall_1 is
    ``("tasks", "ood_train")``, ``"release/objects"`` is ``("objects", "all")``.
    """  # noqa: D205
    first, second = name.split("/")
    return (second, "all") if first == "release" else (first, f"{partition(scene)}_{second}")


def meaning(field: pa.Field) -> str:
    """What a column means, from its metadata."""
    return field.metadata[b"meaning"].decode()


def unit(field: pa.Field) -> str:
    """A column's unit, from its metadata; empty where it has none."""
    return field.metadata.get(b"unit", b"").decode()


def orphan_recordings(where: Where) -> list[str]:
    """List the folders of recordings, relative to the data root, whose trajectories the release does not have."""
    root = open_root(where)
    folders = [PurePosixPath(name).parent for name in root.list("media", "*/*/recording.json")]
    routes = {
        (scene, nav_id)
        for scene in {*scenes_in_release(root)} & {folder.parent.name for folder in folders}
        for side in ("train", "test")
        for nav_id in store.read_scene(root, f"routes/{side}", scene, ["nav_id"])["nav_id"].to_pylist()
    }
    return sorted(str(folder) for folder in folders if (folder.parent.name, folder.name) not in routes)


def prune_recordings(where: Where) -> list[str]:
    """Remove the folders of `orphan_recordings`; returns them. StoreError as there, or where a run holds the data."""
    root = open_root(where)
    with root.lock():
        gone = orphan_recordings(root)
        for folder in gone:
            root.delete(folder)
        for scene in {folder.rpartition("/")[0] for folder in gone}:
            if not root.list(scene):
                root.delete(scene)
    return gone
