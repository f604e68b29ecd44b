"""What trimesh tells of a mesh's colours, materials and texture coordinates (OBJ with MTL, PLY, STL)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.imports.pictures import Paint, surfaces_of
from aerialdojo_gen.imports.raw import RawSurface, no_corners, plain
from aerialdojo_gen.imports.untrusted import SiblingFiles


@dataclass(frozen=True, eq=False)
class Skin:
    """What the faces of a mesh look like; see `aerialdojo_gen.imports.raw.RawNode`."""

    colours: NDArray[np.uint8]
    surface: NDArray[np.int32] | None
    corners: NDArray[np.float32] | None
    surfaces: tuple[RawSurface, ...]


def mesh_materials(bodies: Sequence[Any], beside: SiblingFiles, texture_px: int) -> list[Skin]:
    """Describe the materials of the meshes of one file."""
    materials: dict[int, Any] = {}
    for body in bodies:
        material = getattr(body.visual, "material", None)
        if material is not None and body.visual.kind not in ("face", "vertex"):
            materials[id(material)] = material
    lost = tuple(
        RawSurface(notes=(f"{name} is not there: drawn in one grey, or in the colours of its vertices",))
        for name in beside.missing
        if name.lower().endswith(".mtl") or not materials
    )
    maps = _maps(beside)
    surfaces, index = surfaces_of([_paint(m, maps, beside) for m in materials.values()], texture_px)
    surfaces += lost
    place = dict(zip(materials, index, strict=True))
    return [_skin(body, place, surfaces) for body in bodies]


def _skin(body: Any, place: dict[int, int], surfaces: tuple[RawSurface, ...]) -> Skin:
    n, visual = len(body.faces), body.visual
    if visual.kind == "face":
        return Skin(np.asarray(visual.face_colors[:, :3], dtype=np.uint8), None, None, surfaces)
    if visual.kind == "vertex":
        corners = no_corners(n)
        own = np.asarray(visual.vertex_colors[:, :3], dtype=np.float32)[body.faces]
        corners[..., 2:] = own
        return Skin(np.rint(own.mean(axis=1)).astype(np.uint8), None, corners, surfaces)
    material = getattr(visual, "material", None)
    if material is None:
        return Skin(plain(n), None, None, surfaces)
    k = place[id(material)]
    corners = no_corners(n)
    uv = getattr(visual, "uv", None)
    if uv is not None and len(uv) == len(body.vertices) and surfaces[k].texture is not None:
        corners[..., :2] = np.nan_to_num(np.asarray(uv, dtype=np.float32)[:, :2])[body.faces]
    colours = np.tile(np.array(surfaces[k].colour, dtype=np.uint8), (n, 1))
    return Skin(colours, np.full(n, k, dtype=np.int32), corners, surfaces)


def _paint(material: Any, maps: dict[str, dict[str, str]], beside: SiblingFiles) -> Paint:
    """Read a material of an MTL file, or of a PLY that names a picture."""
    name = str(getattr(material, "name", "") or "")
    told = maps.get(name, {})
    file, missing = _asked(told.get("map_kd", ""), beside)
    if getattr(material, "image", None) is not None and not told:
        file = next(iter(beside.given.values()), None)
    mask, _ = _asked(told.get("map_d", ""), beside)
    red, green, blue = (float(c) / 255.0 for c in np.asarray(material.main_color)[:3])
    # Where there is a picture, writers leave any number as its colour, and few programs multiply by it.
    factor = (1.0, 1.0, 1.0) if file is not None else (red, green, blue)
    return Paint(name, factor, file, missing, alpha="blend" if mask is None else "mask", mask=mask)


def _maps(beside: SiblingFiles) -> dict[str, dict[str, str]]:
    """Read which pictures the MTL files name, by material."""
    out: dict[str, dict[str, str]] = {}
    for name, data in list(beside.given.items()):
        own: dict[str, str] = {}
        for line in data.decode("utf-8", "replace").splitlines() if name.lower().endswith(".mtl") else ():
            key, _, rest = line.strip().partition(" ")
            if key.lower() == "newmtl":
                own = out[" ".join(rest.split())] = {}
            elif key.lower() in ("map_kd", "map_d"):
                own[key.lower()] = rest.strip()
    return out


def _asked(name: str, beside: SiblingFiles) -> tuple[bytes | None, str]:
    try:
        return (beside.get(name) if name else None), ""
    except FileNotFoundError:
        return None, name[-80:]
