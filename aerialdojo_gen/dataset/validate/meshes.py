"""Checks of the scenes' meshes, and of what the tables say of them: nodes, boxes, categories."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Rows, SceneData, place_text
from aerialdojo_gen.pipeline.stages.work.build_scenes import scene_row
from aerialdojo_gen.store.root import LocalRoot

_SAME_M = 1e-4


@check("scenes", needs=("mesh",))
def mesh_outside(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A mesh's path stays in the data directory."""
    data.require_meshes()
    stored_path = str(rows.texts("mesh_path")[0])
    away = Path(stored_path).is_absolute() or ".." in Path(stored_path).parts
    # A folder that the user names may be a link to anywhere, the release's own path may not.
    if data.meshes is None and isinstance(data.release.root, LocalRoot):
        root = data.release.root.path.resolve()
        away = away or not (root / stored_path).resolve().is_relative_to(root)
    if away:
        yield Finding(0, f"mesh_path = {stored_path!r}", "a path below the data directory")


@check("scenes", needs=("mesh",), after=("mesh_outside",))
def mesh_missing(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Every scene's mesh is there."""
    data.require_meshes()
    if data.flagged("scenes", ("mesh_outside",)).any():
        return
    with contextlib.suppress(FileNotFoundError):
        if data.mesh_path().is_file():
            return
    name = str(rows.texts("mesh_path")[0])
    place = data.release.root.at(name) if data.meshes is None else data.meshes / Path(name).name
    yield Finding(0, f"no file {place}", "the mesh (elsewhere: --meshes DIR; none: --no-meshes)")


@check("scenes", needs=("mesh",), after=("mesh_outside", "mesh_missing"))
def mesh_digest(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A mesh's bytes have the SHA-256 of its scene."""
    data.require_meshes()
    if data.flagged("scenes", ("mesh_outside", "mesh_missing")).any():
        return
    with data.mesh_path().open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if digest != rows.texts("mesh_sha256")[0]:
        yield Finding(0, f"SHA-256 {digest}", str(rows.texts("mesh_sha256")[0]))


@check("scenes", needs=("mesh",), after=("mesh_outside", "mesh_missing", "mesh_digest"))
def mesh_damaged(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A mesh is a scene file that can be read."""
    try:
        _ = data.mesh
    except AssetError as error:
        yield Finding(0, str(error), "a scene that build-scenes wrote")


@check("scenes", needs=("mesh",), after=("mesh_outside", "mesh_missing", "mesh_digest", "mesh_damaged"))
def scene_of_mesh(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """What the scene's row says is so in its mesh."""
    stored = rows.table.to_pylist()[0]
    expected = scene_row(data.mesh, stored["mesh_path"], stored["mesh_sha256"])
    for name, value in expected.items():
        own = stored[name]
        same = abs(own - value) <= _SAME_M if isinstance(value, float) else own == value
        if not same:
            yield Finding(0, f"{name} = {own}", str(value))


@check("objects", needs=("mesh",))
def object_node(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's node exists in the mesh."""
    yield from _unknown_nodes(data, rows)


@check("landmarks", needs=("mesh",))
def landmark_node(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A landmark's node exists in the mesh."""
    yield from _unknown_nodes(data, rows)


@check("objects", needs=("mesh",), after=("object_node",))
def object_box(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's centre and size are those of its node's box."""
    yield from _other_box(data, rows, rows.floats("size_x_m", "size_y_m", "size_z_m"))


@check("objects", needs=("mesh",), after=("object_node",))
def object_category(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's category is its node's."""
    yield from _unlike_node(data, rows, "category")


@check("objects", needs=("mesh",), after=("object_node",))
def object_shape(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's shape is its node's."""
    yield from _unlike_node(data, rows, "shape")


@check("landmarks", needs=("mesh",), after=("landmark_node",))
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
