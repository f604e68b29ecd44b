"""What the checks see of a release: one scene's tables and mesh, and the poses of its routes as flat arrays."""

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

from aerialdojo_gen.base.cached import cached_method
from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.rng import rank
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.planning.collision import CollisionWorld, collision_world
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.scenes.context import open_scene
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.root import LocalRoot
from aerialdojo_gen.store.schemas import TableSpec

if TYPE_CHECKING:
    from aerialdojo_gen.dataset.validate.parts import Release

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
Texts = NDArray[np.object_]
T = TypeVar("T")

POSE = ("x_m", "y_m", "z_m", "yaw_rad")
LISTS = (*POSE, "action")
START = tuple(f"start_{name}" for name in POSE)  # of `tasks`
# A row with a missing or impossible value is reported once; checks that depend on the value skip it.
ALWAYS_AFTER = ("null_value", "not_finite", "unknown_word", "wrong_part")
# Without these nothing else of the mesh can be checked.
MESH_CHECKS = ("mesh_outside", "mesh_missing", "mesh_digest", "mesh_damaged")
# What names a row to a person, where it is not the table's key without the scene.
_NAMED_BY = {"tasks": ("task_id",), "scenes": ("scene",)}


class UncheckedError(Exception):
    """Why a check cannot be made."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one table of a scene, from all of its parts."""

    name: str  # Name of the table
    spec: TableSpec  # Its schema and key
    table: pa.Table  # The rows, parts one after the other
    parts: tuple[str, ...]  # Paths of the parts, relative to the release
    ends: tuple[int, ...]  # Row after the last one of each part
    left_out: Mask | None = None  # Rows that a check passes over, for others found fault with them; None for none

    def __len__(self) -> int:
        """Count the rows."""
        return int(self.table.num_rows)

    @property
    def judged(self) -> Mask:
        """Rows that a check judges, (n,) bool."""
        return np.ones(len(self), dtype=np.bool_) if self.left_out is None else ~self.left_out

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

    def texts(self, name: str) -> Texts:
        """Return a column of words, (n,) of str; null is None."""
        return np.array(self.table.column(name).to_pylist(), dtype=object)

    def valid(self, name: str) -> Mask:
        """Where a column is not null, (n,) bool."""
        return np.asarray(self.column(name).is_valid().to_numpy(zero_copy_only=False), dtype=np.bool_)

    def column(self, name: str) -> pa.Array:
        """Return a column in one piece."""
        column = self.table.column(name).combine_chunks()
        return column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column

    def take(self, name: str, rows: Ints) -> pa.Array:
        """Return a column's values at rows, null where a row is -1."""
        return self.column(name).take(pa.array(rows, mask=rows < 0))

    def find(self, name: str, keys: pa.Array) -> Ints:
        """First row of each wanted value of a column, -1 if there is none; (len(wanted),) int64."""
        found = pc.index_in(keys, value_set=self.column(name))
        return pc.fill_null(found, -1).to_numpy(zero_copy_only=False).astype(np.int64)

    def pairs(self) -> list[str]:
        """Start anchor and target of every route, as ids are made from them."""
        columns = (self.ints(name).tolist() for name in ("start_object_id", "start_anchor_id", "target_object_id"))
        return [f"{start}_{anchor}__{target}" for start, anchor, target in zip(*columns, strict=True)]

    def list_lengths(self) -> Ints:
        """Count the elements of the five lists of every route, (n, 5) int64; a null list has none."""
        counts = [pc.fill_null(pc.list_value_length(self.column(name)), 0) for name in LISTS]
        return np.column_stack([np.asarray(c.to_numpy(zero_copy_only=False), dtype=np.int64) for c in counts])


def pose_text(pose: ArrayLike) -> str:
    """Write a pose, x, y, z in metres and yaw in radians."""
    x, y, z, yaw = np.asarray(pose, dtype=np.float64).tolist()
    return f"({x:.6g}, {y:.6g}, {z:.6g}) m, {yaw:.6g} rad"


def place_text(place: Floats, digits: int = 3) -> str:
    """Write a place, x, y, z in metres."""
    return "(" + ", ".join(f"{value:.{digits}f}" for value in place.tolist()) + ") m"


def at(values: NDArray[Any], rows: Ints) -> NDArray[Any]:
    """Values at rows; NaN, or -1 of whole numbers, where a row is -1."""
    gap = np.full((1, *values.shape[1:]), np.nan if values.dtype.kind == "f" else -1)
    return np.concatenate([values, gap])[rows]


def repeated(keys: Iterable[Hashable]) -> Iterator[tuple[int, int]]:
    """Rows whose key an earlier row has, each with the first that has it."""
    first: dict[Hashable, int] = {}
    for row, key in enumerate(keys):
        if first.setdefault(key, row) != row:
            yield row, first[key]


def differing(own: pa.Array, theirs: pa.Array, fit: Mask) -> Iterator[tuple[int, Any, Any]]:
    """Rows that fit in which two columns differ, with both values; null equals null."""
    equal = pc.fill_null(pc.equal(own, theirs), False)
    both_null = pc.and_(pc.is_null(own), pc.is_null(theirs))
    unequal = pc.invert(pc.or_(equal, both_null)).to_numpy(zero_copy_only=False)
    for row in np.flatnonzero(unequal & fit).tolist():
        yield row, own[row].as_py(), theirs[row].as_py()


@dataclass(frozen=True, eq=False)
class Paths:
    """Poses of a scene's routes as flat arrays, metres, radians; a route whose lists do not fit together has none."""

    fit: Mask  # (n,); whether a route has lists of one length, of two poses or more
    first: Ints  # (n + 1,) int64; where each route's poses begin
    pose: Floats  # (m, 4) float64; positions, world frame, and yaw
    action: Ints  # (m,) int64; what is done at every pose

    @cached_property
    def xyz(self) -> Floats:
        """Positions, (m, 3) float64."""
        return np.ascontiguousarray(self.pose[:, :3])

    def of(self, row: int) -> slice:
        """Where a route's poses lie."""
        return slice(int(self.first[row]), int(self.first[row + 1]))

    def poses(self, row: int) -> Floats:
        """Poses of a route, (k, 4) float64."""
        return self.pose[self.of(row)]

    def route_of(self, poses: Ints) -> Ints:
        """Rows of the routes that poses belong to."""
        return np.searchsorted(self.first, poses, side="right") - 1

    def _spread(self, values: Floats) -> Floats:
        """Values of the routes that fit, by row; NaN of the others."""
        spread = np.full((len(self.fit), *values.shape[1:]), np.nan)
        spread[self.fit] = values
        return spread

    @cached_property
    def starts(self) -> Floats:
        """First poses, (n, 4) float64."""
        return self._spread(self.pose[self.first[:-1][self.fit]])

    @cached_property
    def ends(self) -> Floats:
        """Last poses, (n, 4) float64."""
        return self._spread(self.pose[self.first[1:][self.fit] - 1])

    def sums(self, values: Floats) -> Floats:
        """Add up what each pose has, (m,), by route, (n,)."""
        return self._spread(np.add.reduceat(values, self.first[:-1][self.fit]) if len(values) else values)

    @cached_property
    def length_m(self) -> Floats:
        """Lengths recomputed from the positions, (n,) float64, metres."""
        steps = np.zeros(len(self.xyz))
        steps[:-1] = np.linalg.norm(np.diff(self.xyz, axis=0), axis=1)
        steps[self.first[1:][self.fit] - 1] = 0.0  # from one route's end to the next one's start nobody flies
        return self.sums(steps)

    @cached_property
    def euclidean_m(self) -> Floats:
        """Straight distances from first to last position, (n,) float64, metres."""
        return np.asarray(np.linalg.norm(self.ends[:, :3] - self.starts[:, :3], axis=1))


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
        """Return a table's rows; `UncheckedError` where they cannot be read."""
        if name not in self.tables:
            raise UncheckedError(f"{name} cannot be read")
        return self.tables[name]

    @cached_property
    def paths(self) -> Paths:
        """Poses of the routes."""
        lengths = self["routes"].list_lengths()
        fit = (lengths == lengths[:, :1]).all(axis=1) & (lengths[:, 0] >= 2)
        table = self["routes"].table.filter(pa.array(fit))
        lists = [pc.list_flatten(table.column(name)) for name in LISTS]
        *pose, action = (part.to_numpy(zero_copy_only=False) if len(part) else np.empty(0) for part in lists)
        first = np.concatenate([[0], np.cumsum(np.where(fit, lengths[:, 0], 0))]).astype(np.int64)
        actions = np.nan_to_num(action, nan=-1).astype(np.int64)
        return Paths(fit, first, np.column_stack(pose).astype(np.float64), actions)

    def flagged(self, table: str, checks: Sequence[str]) -> Mask:
        """Rows of a table that one of these checks found fault with, (n,) bool."""
        mask = np.zeros(len(self[table]), dtype=np.bool_)
        for name in checks:
            if (table, name) in self.faulty:
                mask |= self.faulty[table, name]
        return mask

    def comparable(self, table: str, rows: Ints) -> Mask:
        """Whether looked-up rows of a table exist and are fit to compare with, (n,) bool."""
        good = ~self.flagged(table, (*ALWAYS_AFTER, "duplicate_key"))
        return (rows >= 0) & np.append(good, False)[rows]

    def cached(self, name: str, make: Callable[[], T]) -> T:
        """Return what one check has made for all others, made now where none has."""
        if name not in self.cache:
            self.cache[name] = make()
        value: T = self.cache[name]
        return value

    @property
    def scene_row(self) -> dict[str, Any]:
        """The row of `scenes`; `UncheckedError` where it is not one row, or at fault."""
        if len(self["scenes"]) != 1:
            raise UncheckedError("scenes has not one row of it")
        if self.flagged("scenes", ALWAYS_AFTER).any():
            raise UncheckedError("the scene's row is at fault")
        return dict(self["scenes"].table.to_pylist()[0])

    def stored_mesh(self) -> str:
        """Return where the scene's mesh is said to lie; `UncheckedError` where meshes are to be left alone."""
        if not self.use_meshes:
            raise UncheckedError("--no-meshes was given")
        return str(self.scene_row["mesh_path"])

    def mesh_path(self) -> Path:
        """Return the scene's mesh on this machine; FileNotFoundError where it is not there."""
        if self.meshes is None:
            return self.release.root.local_copy(self.stored_mesh())
        return LocalRoot(self.meshes).local_copy(Path(self.stored_mesh()).name)

    @property
    def mesh(self) -> Scene:
        """The scene's mesh, read once; `UncheckedError` where there is none to check by."""
        self.stored_mesh()
        if self.flagged("scenes", MESH_CHECKS).any():
            raise UncheckedError("no mesh")
        return self.cached("mesh", lambda: open_scene(self.mesh_path(), self.scene_row["mesh_sha256"]).scene)

    @property
    def world(self) -> CollisionWorld:
        """The mesh as FCL has it."""
        return collision_world(self.mesh)

    @property
    def rays(self) -> RayCaster:
        """The mesh for first hits."""
        return ray_caster(self.mesh)

    def sampled(self, rows: Rows) -> Ints:
        """Judged rows to check at length, all or so many by a draw from ids: routes with FCL, objects' pictures."""
        drawn = self._drawn(rows.name)
        return drawn[rows.judged[drawn]]

    @cached_method
    def _drawn(self, table: str) -> Ints:
        keys: list[tuple[Any, ...]]
        if table == "routes":
            fit, most, keys = np.flatnonzero(self.paths.fit), self.sample, [(k,) for k in self[table].texts("nav_id")]
        else:
            keys = [(self.scene, k) for k in self[table].ints("object_id").tolist()]
            fit, most = np.arange(len(keys)), self.pictures
        order = sorted(fit.tolist(), key=lambda row: rank(0, "validate", *keys[row]))
        return np.sort(np.array(order[:most], dtype=np.int64))

    @cached_property
    def route_of_task(self) -> Ints:
        """Row of `routes` of every task, -1 if there is none."""
        return self["routes"].find("nav_id", self["tasks"].column("nav_id"))

    @cached_property
    def target_of_route(self) -> Ints:
        """Row of `objects` of every route's target, -1 if there is none."""
        return self["objects"].find("object_id", self["routes"].column("target_object_id"))

    @cached_property
    def target_of_task(self) -> Ints:
        """Row of `objects` of every task's target, -1 if there is none."""
        return at(self.target_of_route, self.route_of_task)

    def objects_of(self, rows: Rows) -> Ints:
        """Row of `objects` of every anchor's or viewpoint's object, -1 if there is none."""
        return self["objects"].find("object_id", rows.column("object_id"))

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
