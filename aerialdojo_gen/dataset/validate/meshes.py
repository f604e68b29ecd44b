"""Checks of the scenes' meshes, of what the tables say of them, and that nothing in them hovers.

Contact is measured on the mesh alone, on its triangles and by FCL. A thing rests where its points that have something
within 5 cm below them, or are sunk into something, surround its middle: that of its feet, or that of its surface. One
that does not rest may hang, as signs do on walls: then it touches the rest, and has half a metre of air below.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import MESH_CHECKS, Floats, Ints, Rows, SceneData, place_text
from aerialdojo_gen.geometry.columns import ColumnIndex
from aerialdojo_gen.pipeline.stages.work.build_scenes import scene_row
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.store.root import LocalRoot

_SAME_M = 1e-4
_AIR_M = 0.05  # a gap that the eye does not see
_FOOT_M = 0.03  # feet are so near to the lowest point
_HANGS_M = 0.5  # with less air below, a thing was meant to stand
_ASIDE_M = 0.1  # so far aside of what it rests on may its middle be


@check("scenes")
def mesh_outside(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A mesh's path stays in the data directory."""
    stored_path = data.stored_mesh()
    away = Path(stored_path).is_absolute() or ".." in Path(stored_path).parts
    # A folder that the user names may be a link to anywhere, the release's own path may not.
    if data.meshes is None and isinstance(data.release.root, LocalRoot):
        root = data.release.root.path.resolve()
        away = away or not (root / stored_path).resolve().is_relative_to(root)
    if away:
        yield Finding(0, f"mesh_path = {stored_path!r}", "a path below the data directory")


@check("scenes", after=("mesh_outside",))
def mesh_missing(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """Every scene's mesh is there."""
    name = data.stored_mesh()
    if data.flagged("scenes", ("mesh_outside",)).any():
        return
    with contextlib.suppress(FileNotFoundError):
        if data.mesh_path().is_file():
            return
    place = data.release.root.at(name) if data.meshes is None else data.meshes / Path(name).name
    yield Finding(0, f"no file {place}", "the mesh (elsewhere: --meshes DIR; none: --no-meshes)")


@check("scenes", after=("mesh_outside", "mesh_missing"))
def mesh_digest(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A mesh's bytes have the SHA-256 of its scene."""
    data.stored_mesh()
    if data.flagged("scenes", ("mesh_outside", "mesh_missing")).any():
        return
    with data.mesh_path().open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if digest != (stored := data.scene_row["mesh_sha256"]):
        yield Finding(0, f"SHA-256 {digest}", stored)


@check("scenes", after=("mesh_outside", "mesh_missing", "mesh_digest"))
def mesh_damaged(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A mesh is a scene file that can be read."""
    try:
        _ = data.mesh
    except AssetError as error:
        yield Finding(0, str(error), "a scene that build-scenes wrote")


@check("scenes", after=MESH_CHECKS)
def scene_of_mesh(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """What the scene's row says is so in its mesh."""
    stored = data.scene_row
    expected = scene_row(data.mesh, stored["mesh_path"], stored["mesh_sha256"])
    for name, value in expected.items():
        own = stored[name]
        same = abs(own - value) <= _SAME_M if isinstance(value, float) else own == value
        if not same:
            yield Finding(0, f"{name} = {own}", str(value))


@check("objects")
def object_node(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's node exists in the mesh."""
    yield from _unknown_nodes(data, rows)


@check("landmarks")
def landmark_node(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A landmark's node exists in the mesh."""
    yield from _unknown_nodes(data, rows)


@check("objects", after=("object_node",))
def object_box(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's centre and size are those of its node's box."""
    yield from _other_box(data, rows, rows.floats("size_x_m", "size_y_m", "size_z_m"))


@check("objects", after=("object_node",))
def object_category(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's category is its node's."""
    yield from _unlike_node(data, rows, "category")


@check("objects", after=("object_node",))
def object_shape(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's shape is its node's."""
    yield from _unlike_node(data, rows, "shape")


@check("landmarks", after=("landmark_node",))
def landmark_box(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A landmark's centre is that of its node's box."""
    yield from _other_box(data, rows, None)


def _unknown_nodes(data: SceneData, rows: Rows) -> Iterator[Finding]:
    scene = data.mesh
    for row, node in enumerate(rows.texts("mesh_node")):
        if node not in scene:
            yield Finding(row, f"mesh_node = {node!r}", "a node of the mesh")


def _unlike_node(data: SceneData, rows: Rows, name: str) -> Iterator[Finding]:
    """Rows whose value of a column is not their node's attribute of that name."""
    scene = data.mesh
    for row, (node, stored) in enumerate(zip(rows.texts("mesh_node"), rows.texts(name), strict=True)):
        if node in scene and stored is not None and (own := getattr(scene[str(node)], name)) != stored:
            yield Finding(row, repr(stored), repr(own))


def _other_box(data: SceneData, rows: Rows, size: np.ndarray | None) -> Iterator[Finding]:
    scene = data.mesh
    centre = rows.floats("x_m", "y_m", "z_m")
    for row, node in enumerate(rows.texts("mesh_node")):
        if node not in scene:
            continue
        low, high = scene[str(node)].bounds
        if np.abs(centre[row] - (low + high) / 2).max() > _SAME_M:
            yield Finding(row, f"centre {place_text(centre[row], 4)}", place_text((low + high) / 2, 4))
        elif size is not None and np.abs(size[row] - (high - low)).max() > _SAME_M:
            yield Finding(row, f"size {place_text(size[row], 4)}", place_text(high - low, 4))


@check("scenes", after=MESH_CHECKS)
def thing_hovers(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """Nothing hovers: all that is in a scene touches the rest of it, and its things rest on something or hang."""
    scene = data.mesh
    if scene.imported:
        return  # Its pieces are as its author cut them.
    apart, air = _apart(data), _Air(scene)
    for k, thing in enumerate(scene.instances):
        at = f"{thing.node} at {place_text(thing.centroid)}"
        if apart[k]:
            yield Finding(0, f"{at} touches nothing that stands", "contact within 0.05 m")
        elif thing.shape and (gap := air.under(k, thing)) > _AIR_M:
            yield Finding(0, f"{at} has {gap:.2f} m of air below", "support under its middle within 0.05 m")


def _apart(data: SceneData) -> list[bool]:
    """Whether each instance has no way from contact to contact to the widest one, which is the ground."""
    boxes = np.array([i.bounds for i in data.mesh.instances])
    low, high = boxes[:, 0] - _AIR_M, boxes[:, 1]
    close = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    group, world = np.arange(len(boxes)), data.world
    for a, b in zip(*np.nonzero(np.triu(close, 1)), strict=True):
        if group[a] != group[b] and world.within(int(a), int(b), _AIR_M):
            group[group == group[b]] = group[a]
    widest = int(np.argmax(np.prod(np.ptp(boxes[:, :, :2], axis=1), axis=1)))
    return [bool(own != group[widest]) for own in group]


class _Air:
    """Gaps below the things of a scene."""

    def __init__(self, scene: Scene) -> None:
        corners = np.concatenate([i.vertices[i.faces] for i in scene.instances])
        self._index = ColumnIndex.of(corners.reshape(-1, 9))
        counts = [len(i.faces) for i in scene.instances]
        self._owner = np.repeat(np.arange(len(counts)), counts)

    def under(self, k: int, thing: Instance) -> float:
        """Air below the side of a thing that nothing bears, metres; 0 where it rests or hangs."""
        triangles = thing.vertices[thing.faces]
        size = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
        middle = (triangles.mean(axis=1) * size[:, None]).sum(axis=0) / size.sum()
        feet = thing.vertices[_feet(thing.vertices)]
        middles = shapely.multipoints([feet[:, :2].mean(axis=0), middle[:2]])
        gaps = self._gaps(k, thing, feet, _HANGS_M)
        if _surround(feet[gaps <= _AIR_M], middles) or gaps.min() > _HANGS_M:
            return 0.0
        every = np.concatenate([np.unique(thing.vertices, axis=0), triangles.mean(axis=1)])
        if _surround(every[self._gaps(k, thing, every, float(np.ptp(thing.bounds[:, 2]))) <= _AIR_M], middles):
            return 0.0
        return float(gaps[np.isfinite(gaps)].max())

    def _gaps(self, k: int, thing: Instance, points: Floats, deep_m: float) -> Floats:
        # A hair inwards: points on the edge of what bears them have it below.
        inwards = points + (thing.centroid - points) * np.array([1e-3, 1e-3, 0.0])
        return self._index.gaps_m(inwards, k, self._owner, deep_m)


def _surround(points: Floats, middles: shapely.MultiPoint) -> bool:
    """Whether points seen from above surround one of two middles, or nearly so."""
    return len(points) > 0 and shapely.multipoints(points[:, :2]).convex_hull.distance(middles) <= _ASIDE_M


def _feet(vertices: Floats) -> Ints:
    """Indices of the outermost of a thing's lowest vertices, in sixteen directions."""
    low = np.flatnonzero(vertices[:, 2] <= vertices[:, 2].min() + _FOOT_M)
    turns = np.arange(16) * (math.pi / 8.0)
    reach = vertices[low, :1] * np.cos(turns) + vertices[low, 1:2] * np.sin(turns)
    return np.unique(low[np.argmax(reach, axis=0)])
