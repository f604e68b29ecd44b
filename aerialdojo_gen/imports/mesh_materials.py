"""Colours, materials and texture coordinates from trimesh (OBJ with MTL, PLY, STL)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aerialdojo_gen.imports.pictures import SourceMaterial, decode_surfaces
from aerialdojo_gen.imports.raw import RawNode, RawSurface, empty_corners
from aerialdojo_gen.imports.untrusted import SiblingFiles


def add_materials(
    nodes: Sequence[RawNode], bodies: Sequence[Any], siblings: SiblingFiles, texture_px: int
) -> list[RawNode]:
    """Give nodes the materials of the meshes of one file."""
    materials: dict[int, Any] = {}
    for body in bodies:
        material = getattr(body.visual, "material", None)
        if material is not None and body.visual.kind not in ("face", "vertex"):
            materials[id(material)] = material
    missing = tuple(
        RawSurface(notes=(f"{name} is missing: drawn in grey or in vertex colours",))
        for name in siblings.missing
        if name.lower().endswith(".mtl") or not materials
    )
    maps = _maps(siblings)
    surfaces, index = decode_surfaces([_source_material(m, maps, siblings) for m in materials.values()], texture_px)
    surfaces += missing
    place = dict(zip(materials, index, strict=True))
    return [_paint(node, body, place, surfaces) for node, body in zip(nodes, bodies, strict=True)]


def _paint(node: RawNode, body: Any, place: dict[int, int], surfaces: tuple[RawSurface, ...]) -> RawNode:
    n, visual, node = len(body.faces), body.visual, replace(node, surfaces=surfaces)
    painted = {"face": n, "vertex": len(body.vertices)}.get(visual.kind)
    if painted is not None and len(getattr(visual, f"{visual.kind}_colors")) != painted:
        # A damaged file, or one whose polygons were cut into triangles without their colours.
        note = f"its colours do not match its {'faces' if visual.kind == 'face' else 'vertices'}: drawn in grey"
        return replace(node, surfaces=(*surfaces, RawSurface(notes=(note,))))
    if visual.kind == "face":
        return replace(node, colours=np.asarray(visual.face_colors[:, :3], dtype=np.uint8))
    corners = empty_corners(n)
    if visual.kind == "vertex":
        own = np.asarray(visual.vertex_colors[:, :3], dtype=np.float32)[body.faces]
        corners[..., 2:] = own
        return replace(node, colours=np.rint(own.mean(axis=1)).astype(np.uint8), corners=corners)
    material = getattr(visual, "material", None)
    if material is None:
        return node
    k = place[id(material)]
    uv = getattr(visual, "uv", None)
    if uv is not None and len(uv) == len(body.vertices) and surfaces[k].texture is not None:
        corners[..., :2] = np.nan_to_num(np.asarray(uv, dtype=np.float32)[:, :2])[body.faces]
    colours = np.tile(np.array(surfaces[k].colour, dtype=np.uint8), (n, 1))
    return replace(node, colours=colours, surface=np.full(n, k, dtype=np.int32), corners=corners)


def _source_material(material: Any, maps: dict[str, dict[str, str]], siblings: SiblingFiles) -> SourceMaterial:
    """Convert a material of an MTL file, or of a PLY with a texture."""
    name = str(getattr(material, "name", "") or "")
    textures = maps.get(name, {})
    file, missing = _read_texture(textures.get("map_kd", ""), siblings)
    if getattr(material, "image", None) is not None and not textures:
        file = next(iter(siblings.loaded.values()), None)
    mask, _ = _read_texture(textures.get("map_d", ""), siblings)
    red, green, blue = (float(c) / 255.0 for c in np.asarray(material.main_color)[:3])
    # Writers leave arbitrary colours next to a texture, and few programs multiply by them.
    factor = (1.0, 1.0, 1.0) if file is not None else (red, green, blue)
    return SourceMaterial(name, factor, file, missing, alpha="blend" if mask is None else "mask", mask=mask)


def _maps(siblings: SiblingFiles) -> dict[str, dict[str, str]]:
    """Read the texture files of each material from the MTL files."""
    out: dict[str, dict[str, str]] = {}
    for name, data in list(siblings.loaded.items()):
        own: dict[str, str] = {}
        for line in data.decode("utf-8", "replace").splitlines() if name.lower().endswith(".mtl") else ():
            key, _, rest = line.strip().partition(" ")
            if key.lower() == "newmtl":
                own = out[" ".join(rest.split())] = {}
            elif key.lower() in ("map_kd", "map_d"):
                own[key.lower()] = rest.strip()
    return out


def _read_texture(name: str, siblings: SiblingFiles) -> tuple[bytes | None, str]:
    try:
        return (siblings.get(name) if name else None), ""
    except FileNotFoundError:
        return None, name[-80:]
