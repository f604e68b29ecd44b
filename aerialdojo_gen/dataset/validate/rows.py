"""What the checks see of a release: one scene's tables, and the poses of its routes as flat arrays."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.rng import rank
from aerialdojo_gen.store.schemas import TableSpec

if TYPE_CHECKING:
    from aerialdojo_gen.dataset.validate.parts import Release

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
T = TypeVar("T")

LISTS = ("x_m", "y_m", "z_m", "yaw_rad", "action")
# What names a row to a person, where it is not the table's key without the scene.
_NAMED_BY = {"tasks": ("task_id",), "scenes": ("scene",)}


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one table of a scene, from all of its parts."""

    name: str  # Name of the table
    spec: TableSpec  # Its schema and key
    table: pa.Table  # The rows, parts one after the other
    parts: tuple[str, ...]  # Paths of the parts, relative to the release
    ends: tuple[int, ...]  # Row after the last one of each part

    def __len__(self) -> int:
        """Count the rows."""
        return int(self.table.num_rows)

    @cached_property
    def part_of(self) -> Ints:
        """Index into `parts` of every row, (n,) int64."""
        return np.searchsorted(np.asarray(self.ends), np.arange(len(self)), side="right").astype(np.int64)

    def part(self, row: int) -> str:
        """Path of the part that a row stands in."""
        return self.parts[int(self.part_of[row])]

    def key(self, row: int) -> str:
        """Name a row, e.g. ``"nav_id=U_Mall_0-3f0c51d2a9be"`` or ``"object_id=3 anchor_id=0"``."""
        names = _NAMED_BY.get(self.name) or tuple(k for k in self.spec.key if k != "scene")
        return " ".join(f"{name}={self.table.column(name)[row].as_py()}" for name in names)

    def floats(self, *names: str) -> Floats:
        """Columns as (n,) float64, or (n, k) of several; null is NaN."""
        columns = [self.table.column(name).to_numpy(zero_copy_only=False).astype(np.float64) for name in names]
        return columns[0] if len(names) == 1 else np.column_stack(columns)

    def ints(self, name: str) -> Ints:
        """Return a whole-number column as (n,) int64; null is -1."""
        return pc.fill_null(self.table.column(name), -1).to_numpy(zero_copy_only=False).astype(np.int64)

    def texts(self, name: str) -> list[str | None]:
        """Return a column of words as a list; null is None."""
        return list(self.table.column(name).to_pylist())

    def column(self, name: str) -> pa.Array:
        """Return a column in one piece."""
        column = self.table.column(name).combine_chunks()
        return column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column

    def find(self, name: str, keys: pa.Array) -> Ints:
        """First row of each wanted value of a column, -1 if there is none; (len(wanted),) int64."""
        found = pc.index_in(keys, value_set=self.column(name))
        return pc.fill_null(found, -1).to_numpy(zero_copy_only=False).astype(np.int64)


def pose_text(pose: ArrayLike) -> str:
    """Write a pose, x, y, z in metres and yaw in radians."""
    x, y, z, yaw = np.asarray(pose, dtype=np.float64).tolist()
    return f"({x:.6g}, {y:.6g}, {z:.6g}) m, {yaw:.6g} rad"


def place_text(place: Floats, digits: int = 3) -> str:
    """Write a place, x, y, z in metres."""
    return "(" + ", ".join(f"{value:.{digits}f}" for value in place.tolist()) + ") m"


def repeated(keys: Iterable[Hashable]) -> Iterator[tuple[int, int]]:
    """Rows whose key an earlier row has, each with the first that has it."""
    first: dict[Hashable, int] = {}
    for row, key in enumerate(keys):
        if first.setdefault(key, row) != row:
            yield row, first[key]


def unequal(a: pa.Array, b: pa.Array) -> Mask:
    """Where two columns differ, (n,) bool; null equals null."""
    equal = pc.fill_null(pc.equal(a, b), False)
    both_null = pc.and_(pc.is_null(a), pc.is_null(b))
    return np.asarray(pc.invert(pc.or_(equal, both_null)).to_numpy(zero_copy_only=False), dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class Paths:
    """Poses of the routes whose lists fit together, as flat arrays."""

    rows: Ints  # Rows of `routes` that they belong to; rows with unequal lists or less than two poses are left out
    first: Ints  # (n + 1,) int64; where each route's poses begin
    xyz: Floats  # (m, 3) float64; positions, metres, world frame
    yaw: Floats  # (m,) float64; radians
    action: Ints  # (m,) int64; what is done at every pose

    def of(self, k: int) -> slice:
        """Poses of the k-th route."""
        return slice(int(self.first[k]), int(self.first[k + 1]))

    @cached_property
    def starts(self) -> Floats:
        """First poses, (n, 4) float64: metres and radians."""
        return np.column_stack([self.xyz[self.first[:-1]], self.yaw[self.first[:-1]]])

    @cached_property
    def ends(self) -> Floats:
        """Last poses, (n, 4) float64: metres and radians."""
        return np.column_stack([self.xyz[self.first[1:] - 1], self.yaw[self.first[1:] - 1]])

    @cached_property
    def length_m(self) -> Floats:
        """Lengths recomputed from the positions, (n,) float64, metres."""
        if not len(self.rows):
            return np.empty(0)
        steps = np.zeros(len(self.xyz))
        steps[:-1] = np.linalg.norm(np.diff(self.xyz, axis=0), axis=1)
        steps[self.first[1:] - 1] = 0.0  # from one route's end to the next one's start nobody flies
        return np.asarray(np.add.reduceat(steps, self.first[:-1]))

    @cached_property
    def euclidean_m(self) -> Floats:
        """Straight distances from first to last position, (n,) float64, metres."""
        return np.asarray(np.linalg.norm(self.ends[:, :3] - self.starts[:, :3], axis=1))


def list_lengths(routes: Rows) -> NDArray[np.int64]:
    """Count the elements of the five lists, (n, 5) int64; a null list has none."""
    counts = [pc.fill_null(pc.list_value_length(routes.column(name)), 0) for name in LISTS]
    return np.column_stack([np.asarray(c.to_numpy(zero_copy_only=False), dtype=np.int64) for c in counts])


def paths_of(routes: Rows) -> Paths:
    """Lay out the poses of a scene's routes."""
    lengths = list_lengths(routes)
    comparable = (lengths == lengths[:, :1]).all(axis=1) & (lengths[:, 0] >= 2)
    table = routes.table.filter(pa.array(comparable)) if not comparable.all() else routes.table
    flat = {}
    for name in LISTS:
        values = pc.list_flatten(table.column(name))
        flat[name] = values.to_numpy(zero_copy_only=False) if len(values) else np.empty(0)
    rows = np.flatnonzero(comparable).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(lengths[comparable, 0])]).astype(np.int64)
    xyz = np.column_stack([flat[name] for name in LISTS[:3]]).astype(np.float64)
    action = np.nan_to_num(flat["action"], nan=-1).astype(np.int64)
    return Paths(rows, first, xyz, flat["yaw_rad"].astype(np.float64), action)


@dataclass(eq=False)
class SceneData:
    """One scene of a release, as the checks get it."""

    scene: str  # Name
    release: Release  # Where the release lies
    pipeline: Pipeline
    tables: Mapping[str, Rows]
    meshes: Path | None = None  # Folder of the meshes; None for where the `scenes` table says, beside the release
    use_meshes: bool = True  # False leaves everything that needs a mesh unchecked
    sample: int | None = None  # How many routes FCL checks; None for all
    pictures: int | None = None  # How many reference images are rendered again; None for all
    faulty: dict[tuple[str, str], Mask] = field(default_factory=dict)
    cache: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Rows:
        """Return a table's rows."""
        return self.tables[name]

    @cached_property
    def paths(self) -> Paths:
        """Poses of the routes."""
        return paths_of(self.tables["routes"])

    def flagged(self, table: str, checks: Sequence[str]) -> Mask:
        """Rows of a table that one of these checks found fault with, (n,) bool."""
        mask = np.zeros(len(self.tables[table]), dtype=np.bool_)
        for name in checks:
            if (table, name) in self.faulty:
                mask |= self.faulty[table, name]
        return mask

    def cached(self, name: str, make: Callable[[], T]) -> T:
        """Return what one check has made for all others, made now where none has."""
        if name not in self.cache:
            self.cache[name] = make()
        value: T = self.cache[name]
        return value

    def sampled_routes(self, *faults: str) -> Iterator[tuple[int, int]]:
        """Sampled routes without any of these faults: their places in `paths`, and their rows."""
        skip = self.flagged("routes", faults)
        for k in self.sampled.tolist():
            if not skip[row := int(self.paths.rows[k])]:
                yield k, row

    @cached_property
    def sampled(self) -> Ints:
        """Places in `paths` of the routes that FCL checks: all, or so many by a draw from their ids."""
        rows = self.paths.rows
        if self.sample is None or self.sample >= len(rows):
            return np.arange(len(rows))
        nav_ids = self["routes"].texts("nav_id")
        order = sorted(range(len(rows)), key=lambda k: rank(0, "validate", nav_ids[int(rows[k])]))
        return np.sort(np.array(order[: self.sample], dtype=np.int64))

    @cached_property
    def sampled_objects(self) -> Ints:
        """Rows of `objects` whose pictures are rendered again: all, or so many by a draw from their ids."""
        ids = self["objects"].ints("object_id").tolist()
        order = sorted(range(len(ids)), key=lambda row: rank(0, "validate", self.scene, ids[row]))
        return np.sort(np.array(order[: self.pictures], dtype=np.int64))

    def sampled_rows(self, table: str) -> Ints:
        """Rows of `routes` or `objects` that a check judges which looks at a sample."""
        return self.sampled_objects if table == "objects" else self.paths.rows[self.sampled]

    @cached_property
    def route_of_task(self) -> Ints:
        """Row of `routes` of every task, -1 if there is none."""
        return self["routes"].find("nav_id", self["tasks"].column("nav_id"))

    @cached_property
    def target_of_route(self) -> Ints:
        """Row of `objects` of every route's target, -1 if there is none."""
        return self["objects"].find("object_id", self["routes"].column("target_object_id"))

    @cached_property
    def selected_of_object(self) -> dict[int, int]:
        """Row of `anchors` of every object's selected anchor; without objects that have none or several."""
        anchors = self["anchors"]
        rows = np.flatnonzero(anchors.floats("selected") == 1.0)
        ids = anchors.ints("object_id")[rows]
        values, first, counts = np.unique(ids, return_index=True, return_counts=True)
        return {int(v): int(rows[f]) for v, f, c in zip(values, first, counts, strict=True) if c == 1}

    @cached_property
    def goal_of_route(self) -> Ints:
        """Row of `anchors` of the selected anchor of every route's target, -1 if there is none."""
        targets = self["routes"].ints("target_object_id").tolist()
        return np.array([self.selected_of_object.get(t, -1) for t in targets], dtype=np.int64)

    @cached_property
    def start_of_route(self) -> Ints:
        """Row of `anchors` of every route's start anchor, -1 if there is none."""
        anchors, routes = self["anchors"], self["routes"]
        known = zip(anchors.ints("object_id").tolist(), anchors.ints("anchor_id").tolist(), strict=True)
        rows = {key: row for row, key in enumerate(known)}
        keys = zip(routes.ints("start_object_id").tolist(), routes.ints("start_anchor_id").tolist(), strict=True)
        return np.array([rows.get(key, -1) for key in keys], dtype=np.int64)
