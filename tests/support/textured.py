"""Textured meshes that nobody here made, written as glTF, for the tests of materials."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from support.foreign import glb


def checkerboard(squares: int = 8, px: int = 32) -> NDArray[np.uint8]:
    """Draw red and white squares, with a blue one at the top left (u = 0, v = 1): (n, n, 3) uint8."""
    k = np.arange(squares * px) // px
    white = (k[:, None] + k[None, :]) % 2 == 1
    board = np.where(white[..., None], np.array([235, 235, 235]), np.array([190, 40, 30])).astype(np.uint8)
    board[:px, :px] = (20, 40, 200)
    return board


def photograph(side: int = 256, seed: int = 3) -> NDArray[np.uint8]:
    """Draw something like a photograph of a wall: patches of all colours, (side, side, 3) uint8."""
    coarse = np.random.default_rng(seed).integers(30, 230, (8, 8, 3)).astype(np.uint8)
    return np.asarray(cv2.resize(coarse, (side, side), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def picture_file(image: NDArray[np.uint8], suffix: str = ".png") -> bytes:
    """Encode a picture, RGB or RGBA."""
    order = [2, 1, 0, 3][: image.shape[2]]
    return bytes(cv2.imencode(suffix, np.ascontiguousarray(image[..., order]))[1])


@dataclass
class Gltf:
    """A glTF document in the making; z is up, which the format does not forbid."""

    data: bytearray = field(default_factory=bytearray)
    document: dict[str, Any] = field(default_factory=lambda: {"asset": {"version": "2.0"}, "scene": 0})

    def view(self, raw: bytes) -> int:
        views = self.document.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)})
        self.data += raw + b"\0" * (-len(raw) % 4)
        return len(views) - 1

    def accessor(self, values: NDArray[Any], normalized: bool = False) -> int:
        kinds = {"float32": 5126, "uint32": 5125, "uint16": 5123, "uint8": 5121}
        width = 1 if values.ndim == 1 else values.shape[1]
        entry = {
            "bufferView": self.view(values.tobytes()), "componentType": kinds[str(values.dtype)],
            "count": len(values), "type": "SCALAR" if width == 1 else f"VEC{width}",
        }  # fmt: skip
        if normalized:
            entry["normalized"] = True
        self.document.setdefault("accessors", []).append(entry)
        return len(self.document["accessors"]) - 1

    def material(self, image: bytes | None = None, **told: Any) -> int:
        surface: dict[str, Any] = {"baseColorFactor": told.pop("factor", [1, 1, 1, 1])}
        if image is not None:
            images = self.document.setdefault("images", [])
            images.append({"bufferView": self.view(image), "mimeType": "image/png"})
            self.document.setdefault("textures", []).append({"source": len(images) - 1})
            surface["baseColorTexture"] = {"index": len(images) - 1}
        materials = self.document.setdefault("materials", [])
        materials.append({"name": f"m{len(materials)}", "pbrMetallicRoughness": surface, **told})
        return len(materials) - 1

    def node(
        self, name: str, vertices: Any, faces: Any, material: int | None = None, uv: Any = None, colours: Any = None
    ) -> None:
        attributes = {"POSITION": self.accessor(np.asarray(vertices, dtype=np.float32))}
        if uv is not None:
            down = np.asarray(uv, dtype=np.float32) * [1, -1] + [0, 1]
            attributes["TEXCOORD_0"] = self.accessor(down.astype(np.float32))
        if colours is not None:
            attributes["COLOR_0"] = self.accessor(
                np.asarray(colours), normalized=np.asarray(colours).dtype.kind == "u"
            )
        primitive = {"attributes": attributes, "indices": self.accessor(np.asarray(faces, dtype=np.uint32).ravel())}
        if material is not None:
            primitive["material"] = material
        meshes = self.document.setdefault("meshes", [])
        meshes.append({"primitives": [primitive]})
        nodes = self.document.setdefault("nodes", [])
        nodes.append({"name": name, "mesh": len(meshes) - 1})
        self.document["scenes"] = [{"nodes": list(range(len(nodes)))}]

    def write(self, path: Path) -> Path:
        self.document["buffers"] = [{"byteLength": len(self.data)}]
        path.write_bytes(glb(json.dumps(self.document).encode(), bytes(self.data)))
        return path


# A wall in the plane y = 0, 8 m wide and 8 m high, that faces south; u runs east, v up.
WALL = np.array([[-4.0, 0, 0], [4, 0, 0], [4, 0, 8], [-4, 0, 8]])
WALL_FACES = np.array([[0, 1, 2], [0, 2, 3]])
WALL_UV = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])


def box(low: Any, high: Any) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """A closed box whose every side shows the whole texture: vertices, faces, texture coordinates."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    vertices, faces, uv = [], [], []
    for axis in range(3):
        a, b = [k for k in range(3) if k != axis]
        for side in (0, 1):
            corners = np.tile(low, (4, 1))
            corners[:, axis] = (low, high)[side][axis]
            corners[[1, 2], a] = high[a]
            corners[[2, 3], b] = high[b]
            out = (axis == 1) == (side == 0)
            n = len(vertices) * 4
            vertices.append(corners)
            faces += [[n, n + 1, n + 2], [n, n + 2, n + 3]] if out else [[n, n + 2, n + 1], [n, n + 3, n + 2]]
            uv.append([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    return np.concatenate(vertices), np.array(faces), np.concatenate(uv)


def yard(path: Path) -> Path:
    """Write a yard: a photographed wall, a truck blue and white, a hedge of leaves with holes, painted stones."""
    out = Gltf()
    wall = out.material(picture_file(photograph()), doubleSided=True)
    out.node("Wall", WALL, WALL_FACES, wall, WALL_UV)
    halves = np.zeros((64, 64, 3), dtype=np.uint8)
    halves[:32], halves[32:] = (240, 240, 240), (30, 60, 200)
    vertices, faces, uv = box([-9, -8, 0], [-6, -2, 3])
    out.node("Truck", vertices, faces, out.material(picture_file(halves)), uv)
    leaves = np.zeros((64, 64, 4), dtype=np.uint8)
    leaves[..., :3] = (40, 140, 50)
    leaves[16:48, 16:48, 3] = 255
    hedge = out.material(picture_file(leaves), alphaMode="MASK", doubleSided=True)
    out.node("Hedge", WALL / 2 + [8, -4, 0], WALL_FACES, hedge, WALL_UV)
    stone = box([6, -10, 0], [8, -8, 2])
    paint = np.where(stone[0][:, 2:] > 1, [230, 200, 40, 255], [120, 30, 120, 255]).astype(np.uint8)
    out.document["asset"]["generator"] = "trimesh"  # whose colours are sRGB
    out.node("Stone", stone[0], stone[1], None, None, paint)
    ground = np.array([[-15.0, -15, 0], [15, -15, 0], [15, 15, 0], [-15, 15, 0]])
    out.node("Ground", ground, WALL_FACES, out.material(factor=[0.2, 0.25, 0.15, 1]))
    return out.write(path)


def scan(path: Path, cells: int = 40, texture_px: int = 512, jpeg: bool = True) -> Path:
    """Write what a photogrammetry program writes: one open surface of 2 cells² triangles in one atlas, an OBJ.

    Ground of 60 x 60 m with houses pulled out of it; the atlas is a photograph from above.
    """
    step = 60.0 / cells
    k = np.arange(cells + 1)
    x, y = np.meshgrid(-30 + step * k, -30 + step * k)
    z = 0.4 * np.sin(x / 7) * np.cos(y / 9)
    for cx, cy, high in ((-15, -12, 6), (10, 8, 9), (14, -14, 5), (-12, 14, 7)):
        z = np.where((abs(x - cx) < 5) & (abs(y - cy) < 4), high, z)
    photo = photograph(texture_px, seed=5)
    picture = path.with_suffix(".jpg" if jpeg else ".png")
    picture.write_bytes(picture_file(photo, picture.suffix))
    path.with_suffix(".mtl").write_text(f"newmtl atlas\nKd 0.2 0.2 0.2\nmap_Kd {picture.name}\n")
    v = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    vt = np.column_stack([(x.ravel() + 30) / 60, (y.ravel() + 30) / 60])
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)[None]).ravel() + 1
    b, c, d = a + 1, a + cells + 2, a + cells + 1
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    with path.open("w") as file:
        file.write(f"mtllib {path.with_suffix('.mtl').name}\n")
        file.write(("v %.4f %.4f %.4f\n" * len(v)) % tuple(v.ravel().tolist()))
        file.write(("vt %.6f %.6f\n" * len(vt)) % tuple(vt.ravel().tolist()))
        file.write("usemtl atlas\n")
        file.write(("f %d/%d %d/%d %d/%d\n" * len(faces)) % tuple(np.repeat(faces.ravel(), 2).tolist()))
    return path
