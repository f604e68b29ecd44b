"""Checks of the scenes' meshes, and of what the tables say of them: boxes, nodes, anchors."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from aerialdojo_gen.errors import AssetError
from aerialdojo_gen.geometry.frames import wrap_angle_rad, yaw_towards
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.release.validate.links import sound
from aerialdojo_gen.release.validate.registry import Finding, check
from aerialdojo_gen.release.validate.rows import Rows, SceneData
from aerialdojo_gen.release.validate.scene_mesh import mesh_path, scene_mesh, want_meshes
from aerialdojo_gen.stages.anchor_choice import SLACK_M
from aerialdojo_gen.stages.build_scenes import scene_row

_SAME_M = 1e-4
_SAME_RAD = 1e-6
# Anchors are marched to the wanted distance to a tenth of a millimetre; this is what a definition of 1 m bears.
_STANDOFF_M = 1e-3


@check("scenes", needs=("mesh",))
def mesh_outside(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A mesh's path stays in the data directory."""
    want_meshes(data)
    told = str(rows.texts("mesh_path")[0])
    root = data.release.parent.resolve()
    away = Path(told).is_absolute() or ".." in Path(told).parts
    # A folder that the user names may be a link to anywhere, the release's own path may not.
    if away or (data.meshes is None and not (root / told).resolve().is_relative_to(root)):
        yield Finding(0, f"mesh_path = {told!r}", "a path below the data directory")


@check("scenes", needs=("mesh",), after=("mesh_outside",))
def mesh_missing(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """Every scene's mesh is there."""
    want_meshes(data)
    if not mesh_path(data).is_file():
        yield Finding(0, f"no file {mesh_path(data)}", "the mesh (elsewhere: --meshes DIR; none: --no-meshes)")


@check("scenes", needs=("mesh",), after=("mesh_outside", "mesh_missing"))
def mesh_digest(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A mesh's bytes have the SHA-256 of its scene."""
    want_meshes(data)
    if data.flagged("scenes", ("mesh_outside", "mesh_missing")).any():
        return
    with mesh_path(data).open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if digest != rows.texts("mesh_sha256")[0]:
        yield Finding(0, f"SHA-256 {digest}", str(rows.texts("mesh_sha256")[0]))


@check("scenes", needs=("mesh",), after=("mesh_outside", "mesh_missing", "mesh_digest"))
def mesh_damaged(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A mesh is a scene file that can be read."""
    try:
        scene_mesh(data)
    except AssetError as error:
        yield Finding(0, str(error), "a scene that build-scenes wrote")


@check("scenes", needs=("mesh",), after=("mesh_outside", "mesh_missing", "mesh_digest", "mesh_damaged"))
def scene_of_mesh(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """What the scene's row says is so in its mesh."""
    stored = rows.table.to_pylist()[0]
    wanted = scene_row(scene_mesh(data).scene, stored["mesh_path"], stored["mesh_sha256"])
    for name, value in wanted.items():
        own = stored[name]
        same = abs(own - value) <= _SAME_M if isinstance(value, float) else own == value
        if not same:
            yield Finding(0, f"{name} = {own}", str(value))


@check("objects", needs=("mesh",))
def object_node(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's node stands in the mesh."""
    yield from _unknown_nodes(data, rows)


@check("landmarks", needs=("mesh",))
def landmark_node(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A landmark's node stands in the mesh."""
    yield from _unknown_nodes(data, rows)


@check("objects", needs=("mesh",), after=("object_node",))
def object_box(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's centre and size are those of its node's box."""
    yield from _other_box(data, rows, rows.floats("size_x_m", "size_y_m", "size_z_m"))


@check("landmarks", needs=("mesh",), after=("landmark_node",))
def landmark_box(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A landmark's centre is that of its node's box."""
    yield from _other_box(data, rows, None)


@check("anchors", needs=("objects",), after=("unknown_object",))
def anchor_yaw(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor faces its object's centre, unless a person placed it."""
    objects = data["objects"]
    item = objects.find("object_id", rows.column("object_id"))
    by_hand = np.asarray(rows.texts("selected_by"), dtype=object) == "human"
    fit = np.flatnonzero(sound(data, "objects", item) & ~by_hand)
    centre = objects.floats("x_m", "y_m", "z_m")[item[fit]]
    yaw = yaw_towards(rows.floats("x_m", "y_m", "z_m")[fit], centre)
    off = np.abs(wrap_angle_rad(rows.floats("yaw_rad")[fit] - yaw))
    for k in np.flatnonzero(off > _SAME_RAD):
        yield Finding(int(fit[k]), f"{rows.floats('yaw_rad')[fit[k]]:.6f} rad", f"{yaw[k]:.6f} rad")


@check("anchors", needs=("objects", "mesh"), after=("unknown_object",))
def anchor_surface(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor is 1 m from its object's surface (about that, where a person placed it), and says how far."""
    scene = scene_mesh(data).scene
    by_hand = np.asarray(rows.texts("selected_by"), dtype=object) == "human"
    slack = np.where(by_hand, SLACK_M + _SAME_M, _STANDOFF_M)
    wanted = data.pipeline.anchor_sample.standoff_m
    nodes = data["objects"].texts("mesh_node")
    item = data["objects"].find("object_id", rows.column("object_id"))
    place, stored = rows.floats("x_m", "y_m", "z_m"), rows.floats("surface_distance_m")
    for k in np.unique(item[item >= 0]).tolist():
        if nodes[k] not in scene:
            continue
        own = np.flatnonzero((item == k) & np.isfinite(place).all(axis=1))
        found = Surface.of(scene[str(nodes[k])]).distance_m(place[own]) if len(own) else np.empty(0)
        for row, distance in zip(own.tolist(), found.tolist(), strict=True):
            if abs(distance - wanted) > slack[row]:
                yield Finding(row, f"{distance:.4f} m from the object's surface", f"{wanted:g} m")
            elif abs(distance - stored[row]) > _SAME_M:
                yield Finding(row, f"surface_distance_m = {stored[row]:.6g}", f"{distance:.6g}")


@check("anchors", needs=("mesh",), after=("anchor_surface",))
def anchor_clearance(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor is free of collision, and says how far the nearest surface is."""
    world, radius = scene_mesh(data).world, data.pipeline.embodiment.radius_m
    stored = rows.floats("clearance_m")
    for row, place in enumerate(rows.floats("x_m", "y_m", "z_m")):
        distance = world.distance_m(place) if np.isfinite(place).all() else np.nan
        if distance <= radius:
            yield Finding(row, f"a surface at {distance:.4f} m", f"more than the body's radius, {radius:g} m")
        elif abs(distance - stored[row]) > _STANDOFF_M:
            yield Finding(row, f"clearance_m = {stored[row]:.6g}", f"{distance:.6g}")


def _unknown_nodes(data: SceneData, rows: Rows) -> Iterator[Finding]:
    scene = scene_mesh(data).scene
    for row, node in enumerate(rows.texts("mesh_node")):
        if node not in scene:
            yield Finding(row, f"mesh_node = {node!r}", "a node of the mesh")


def _other_box(data: SceneData, rows: Rows, size: np.ndarray | None) -> Iterator[Finding]:
    scene = scene_mesh(data).scene
    centre = rows.floats("x_m", "y_m", "z_m")
    for row, node in enumerate(rows.texts("mesh_node")):
        if node not in scene:
            continue
        low, high = scene[str(node)].bounds
        if np.abs(centre[row] - (low + high) / 2).max() > _SAME_M:
            yield Finding(row, f"centre {_triple(centre[row])}", _triple((low + high) / 2))
        elif size is not None and np.abs(size[row] - (high - low)).max() > _SAME_M:
            yield Finding(row, f"size {_triple(size[row])}", _triple(high - low))


def _triple(v: np.ndarray) -> str:
    return "({:.4f}, {:.4f}, {:.4f}) m".format(*v.tolist())
