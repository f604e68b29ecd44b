"""What a release consists of, and whether all of it is there: tables, splits, rows, bytes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from aerialdojo_gen.errors import StoreError
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store


@dataclass(frozen=True)
class Table:
    """A table of the release.

    Attributes
    ----------
    spec : TableSpec
        Its columns.
    about : str
        What a row is.
    split : bool
        Whether it lies in a folder a split.
    """

    spec: schemas.TableSpec
    about: str
    split: bool = False


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
    "scenes": Table(schemas.SCENES, "One row a scene."),
}

# Keys of `store.LAYOUT` that make up a scene's part of the release.
SHARDS = tuple(name for name, place in store.LAYOUT.items() if place.template.startswith("release/"))


def check_release(data: Path, scenes: list[str] | None = None) -> list[str]:
    """Check from the footers that the release's parts are there, whole and of one run.

    Parameters
    ----------
    data : Path
        The data directory.
    scenes : list of str, optional
        Look at these alone; every scene of the release where absent.

    Returns
    -------
    list of str
        The scenes, by name.

    Raises
    ------
    StoreError
        One line a part that is missing, damaged, of a wrong number of rows, or of another run than its fellows.
    """
    there = {name: set(_scenes_with(data, name)) for name in SHARDS}
    known = sorted(set().union(*there.values())) if scenes is None else scenes
    if not known:
        raise StoreError(f"there is no release in {data}: run aerialdojo-gen split")
    wrong = [line for scene in known for line in _faults(data, scene, [n for n in SHARDS if scene in there[n]])]
    if wrong:
        raise StoreError("\n".join(wrong))
    return known


def _scenes_with(data: Path, name: str) -> list[str]:
    paths = {store.shard_path(data, name, scene).parent for scene in ("X_0", "X_1")}
    return [p.stem.removeprefix("part-") for folder in paths for p in folder.glob("part-*.parquet")]


def _faults(data: Path, scene: str, present: list[str]) -> list[str]:
    mend = f"run aerialdojo-gen split --scene {scene}"
    if not present:
        return [f"{scene} is not in the release in {data}: {mend}"]
    lines, prints = [], {}
    for name in SHARDS:
        path = store.shard_path(data, name, scene)
        if name not in present:
            lines.append(f"{path} is missing: {mend}")
            continue
        try:
            info = store.read_info(path)
        except StoreError as error:
            lines.append(str(error))
            continue
        if info is None:
            lines.append(f"{path} was not written by aerialdojo-gen: delete it and {mend}")
            continue
        prints[name] = info.fingerprint
    if len(set(prints.values())) > 1:
        lines.append(f"the release's parts of {scene} in {data} are of different runs: {mend} --force")
    return lines


def counts(data: Path, scenes: list[str]) -> dict[str, dict[str, int]]:
    """Count the rows of every table and split of these scenes, from the footers.

    Returns
    -------
    dict
        ``{"tasks": {"id_train": 113642, …}, …, "objects": {"all": 2099}, …}``; a split that no scene has is left out.

    Raises
    ------
    StoreError
        A part is missing or damaged.
    """
    found: dict[str, dict[str, int]] = {name: {} for name in TABLES}
    for scene in scenes:
        for name in SHARDS:
            table, split = table_and_split(name, scene)
            rows = found[table]
            rows[split] = rows.get(split, 0) + store.count_rows(data, name, scene)
    return {
        table: {s: rows[s] for s in (*schemas.SUBSETS, "all") if s in rows} for table, rows in found.items()
    }  # fmt: skip


def sizes(data: Path, scenes: list[str]) -> dict[str, int]:
    """Bytes of every table of these scenes."""
    total = dict.fromkeys(TABLES, 0)
    for scene in scenes:
        for name in SHARDS:
            total[table_and_split(name, scene)[0]] += store.shard_path(data, name, scene).stat().st_size
    return total


def table_and_split(name: str, scene: str) -> tuple[str, str]:
    """Return the release's table and split that a scene's shard belongs to: ``"tasks/train"`` of U_Mall_1 is
    ``("tasks", "ood_train")``, ``"release/objects"`` is ``("objects", "all")``.
    """  # noqa: D205
    first, second = name.split("/")
    return (second, "all") if first == "release" else (first, f"{store.partition(scene)}_{second}")


def meaning(field: pa.Field) -> str:
    """What a column means, from its metadata."""
    return field.metadata[b"meaning"].decode()


def unit(field: pa.Field) -> str:
    """A column's unit, from its metadata; empty where it has none."""
    return field.metadata.get(b"unit", b"").decode()
