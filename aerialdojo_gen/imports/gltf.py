"""glTF 2.0: nodes, triangles and materials, from .glb or .gltf files.

Own code, because general readers ignore normalised integers, second texture coordinates, texture transforms and
unlit materials, and rename nodes in every run.
"""

from __future__ import annotations

import base64
import struct
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.imports.pictures import CUTOFF, TEXTURE_PX, SourceMaterial, decode_surfaces, to_srgb
from aerialdojo_gen.imports.raw import RawNode, default_colours, empty_corners, merge_nodes

Floats = NDArray[np.float64]
Resolve = Callable[[str], bytes]

_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
MAX_TRIANGLES = 4_000_000
_MAX_JSON_BYTES = 1 << 28
# Writers that store sRGB in vertex colours, which should be linear.
_SRGB_WRITERS = ("trimesh", "meshlab", "open3d")


def read_gltf(raw: bytes, kind: str, resolve: Resolve, texture_px: int = TEXTURE_PX) -> list[RawNode]:
    """Read the bytes of a file, ``"GLB"`` or ``"GLTF"``: one RawNode per mesh node, transforms applied."""
    return _File(raw, kind, resolve, texture_px).nodes()


class _File:
    def __init__(self, raw: bytes, kind: str, resolve: Resolve, texture_px: int) -> None:
        self._resolve = resolve
        self._document, self._own = _parse(raw, kind)
        self._buffers: dict[int, memoryview] = {}
        writer = str(self._document.get("asset", {}).get("generator", "")).lower()
        self._srgb_colours = any(word in writer for word in _SRGB_WRITERS)
        materials = self._document.get("materials", [])
        surfaces, index = decode_surfaces([self._source_material(m, k) for k, m in enumerate(materials)], texture_px)
        self._surfaces, self._index = surfaces, index

    def nodes(self) -> list[RawNode]:
        """Return the mesh nodes, in tree order."""
        document, out = self._document, []
        for k, world in self._world_transforms():
            node = document["nodes"][k]
            if "mesh" not in node:
                continue
            mesh = document["meshes"][node["mesh"]]
            name = str(node.get("name") or mesh.get("name") or "")
            bodies = [b for p in mesh["primitives"] for b in [self._primitive(p, name, world)] if len(b.faces)]
            if bodies:
                out.append(bodies[0] if len(bodies) == 1 else merge_nodes(name, bodies))
        return out

    def _world_transforms(self) -> Iterator[tuple[int, Floats]]:
        nodes = self._document.get("nodes", [])
        scenes = self._document.get("scenes", [])
        if scenes:
            roots = scenes[self._document.get("scene", 0)].get("nodes", [])
        else:
            children = {c for n in nodes for c in n.get("children", ())}
            roots = [k for k in range(len(nodes)) if k not in children]
        stack, visited = [(int(k), np.eye(4)) for k in reversed(roots)], set()
        while stack:
            k, parent = stack.pop()
            if k in visited or not 0 <= k < len(nodes):
                continue
            visited.add(k)
            world = parent @ _local(nodes[k])
            yield k, world
            stack += [(int(child), world) for child in reversed(nodes[k].get("children", ()))]

    def _primitive(self, primitive: dict[str, Any], name: str, world: Floats) -> RawNode:
        attributes = primitive["attributes"]
        local = self._attribute(attributes, "POSITION", 3)
        with np.errstate(invalid="ignore", over="ignore"):
            vertices = local @ world[:3, :3].T + world[:3, 3]
        faces = self._faces(primitive, len(vertices))
        if np.linalg.det(world[:3, :3]) < 0:
            faces = faces[:, ::-1]
        m = len(faces)
        if m and (int(faces.max()) >= len(vertices) or int(faces.min()) < 0):
            raise AssetError("is a damaged glTF file: a triangle beyond its vertices")
        material = primitive.get("material")
        surface = np.full(m, -1 if material is None else self._index[material], dtype=np.int32)
        colours, corners = default_colours(m), empty_corners(m)
        if material is not None:
            shown = self._surfaces[self._index[material]]
            colours = np.tile(np.array(shown.colour, dtype=np.uint8), (m, 1))
            uv = self._texture_coordinates(self._document["materials"][material], attributes, len(vertices))
            if shown.texture is not None and uv is not None:
                corners[..., :2] = uv[faces]
        if "COLOR_0" in attributes:
            light = self._attribute(attributes, "COLOR_0", 3, len(vertices))
            factor = self._factor(material)
            if factor is not None:
                light = light * factor
            own = 255.0 * (np.clip(light, 0.0, 1.0) if self._srgb_colours else to_srgb(light))
            if (own < 254.5).any():
                corners[..., 2:] = np.rint(own[faces])
                colours = np.rint(own[faces].mean(axis=1)).astype(np.uint8)
        return RawNode(name, vertices, faces, colours, surface, corners, self._surfaces)

    def _factor(self, material: int | None) -> Floats | None:
        """Return the factor of vertex colours, linear; None for white."""
        if material is None:
            return None
        factor = np.array(_base_colour(self._document["materials"][material])[0][:3], dtype=np.float64)
        if (factor == 1.0).all():
            return None
        return to_srgb(factor) if self._srgb_colours else factor

    def _faces(self, primitive: dict[str, Any], n: int) -> NDArray[np.int64]:
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in (_TRIANGLES, _STRIP, _FAN):
            return np.zeros((0, 3), dtype=np.int64)
        flat = self._array(primitive["indices"]).ravel() if "indices" in primitive else np.arange(n)
        flat = flat.astype(np.int64)
        if mode == _TRIANGLES:
            return flat[: len(flat) // 3 * 3].reshape(-1, 3)
        if len(flat) < 3:
            return np.zeros((0, 3), dtype=np.int64)
        if mode == _FAN:
            return np.column_stack([np.full(len(flat) - 2, flat[0]), flat[1:-1], flat[2:]])
        out = np.column_stack([flat[:-2], flat[1:-1], flat[2:]])
        out[1::2] = out[1::2, ::-1]
        return out

    def _texture_coordinates(
        self, material: dict[str, Any], attributes: dict[str, int], n: int
    ) -> NDArray[np.float32] | None:
        source = _base_colour(material)[1]
        if source is None:
            return None
        moved = source.get("extensions", {}).get("KHR_texture_transform", {})
        which = f"TEXCOORD_{moved.get('texCoord', source.get('texCoord', 0))}"
        if which not in attributes:
            return None
        uv = self._attribute(attributes, which, 2, n)
        if moved:
            angle = float(moved.get("rotation", 0.0))
            c, s = np.cos(angle), np.sin(angle)
            uv = uv * np.array(moved.get("scale", (1.0, 1.0)), dtype=np.float64)
            uv = uv @ np.array([[c, s], [-s, c]]).T + np.array(moved.get("offset", (0.0, 0.0)), dtype=np.float64)
        uv[~np.isfinite(uv)] = 0.0
        # glTF's v axis points down.
        return np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]).astype(np.float32)

    def _source_material(self, material: dict[str, Any], k: int) -> SourceMaterial:
        factor, source = _base_colour(material)
        extensions = material.get("extensions", {})
        image, missing = (None, "") if source is None else self._image(source["index"])
        red, green, blue = to_srgb(np.array(factor[:3], dtype=np.float64)).tolist()
        return SourceMaterial(
            str(material.get("name") or f"material {k}"), (red, green, blue), image, missing,
            alpha=str(material.get("alphaMode", "OPAQUE")).lower(),
            cutoff=float(material.get("alphaCutoff", CUTOFF)) if material.get("alphaMode") == "MASK" else CUTOFF,
            double_sided=bool(material.get("doubleSided", False)), unlit="KHR_materials_unlit" in extensions,
        )  # fmt: skip

    def _image(self, texture: int) -> tuple[bytes | None, str]:
        entry = self._document["textures"][texture]
        source = entry.get("source")
        if source is None:
            sources = [e["source"] for e in entry.get("extensions", {}).values() if "source" in e]
            if not sources:
                return None, "without an image"
            source = sources[0]
        image = self._document["images"][source]
        if "bufferView" in image:
            return bytes(self._view(image["bufferView"])), ""
        uri = str(image["uri"])
        try:
            return self._fetch(uri), ""
        except FileNotFoundError:
            return None, unquote(uri)[:80]

    def _fetch(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return self._resolve(unquote(uri))

    def _attribute(self, attributes: dict[str, int], name: str, width: int, n: int | None = None) -> Floats:
        """Return the first `width` numbers of an attribute of `n` vertices."""
        values = self._array(attributes[name])
        if values.shape[1] < width or (n is not None and len(values) != n):
            has = f"{values.shape[1]} numbers for {len(values)} vertices"
            raise AssetError(f"is a damaged glTF file: {name} has {has}")
        return values[:, :width].astype(np.float64)

    def _array(self, accessor: int) -> NDArray[Any]:
        """Return an accessor's values, (n, width); normalised integers as 0-1."""
        entry = self._document["accessors"][accessor]
        count, width = int(entry["count"]), _WIDTHS[entry["type"]]
        dtype = np.dtype(_DTYPES[entry["componentType"]])
        if "bufferView" in entry:
            values = self._strided(entry["bufferView"], int(entry.get("byteOffset", 0)), dtype, count, width)
        else:
            values = np.zeros((count, width), dtype=dtype)
        if "sparse" in entry:
            sparse, n = entry["sparse"], int(entry["sparse"]["count"])
            part = sparse["indices"]
            kind = np.dtype(_DTYPES[part["componentType"]])
            rows = self._strided(part["bufferView"], int(part.get("byteOffset", 0)), kind, n, 1).ravel()
            part = sparse["values"]
            values = values.copy()
            values[rows] = self._strided(part["bufferView"], int(part.get("byteOffset", 0)), dtype, n, width)
        if entry.get("normalized") and dtype.kind in "iu":
            return np.maximum(values.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        return values

    def _strided(self, view: int, offset: int, dtype: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        data = self._view(view)
        stride = int(self._document["bufferViews"][view].get("byteStride", 0)) or width * dtype.itemsize
        last = offset + (count - 1) * stride + width * dtype.itemsize
        if count < 0 or offset < 0 or (count and last > len(data)):
            raise AssetError("is a damaged glTF file: an array beyond its data")
        if not count:
            return np.zeros((0, width), dtype=dtype)
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def _view(self, view: int) -> memoryview:
        entry = self._document["bufferViews"][view]
        data = self._buffer(int(entry["buffer"]))
        start, size = int(entry.get("byteOffset", 0)), int(entry["byteLength"])
        if start < 0 or size < 0 or start + size > len(data):
            raise AssetError("is a damaged glTF file: cut short")
        return data[start : start + size]

    def _buffer(self, k: int) -> memoryview:
        if k not in self._buffers:
            entry = self._document["buffers"][k]
            if "uri" in entry:
                try:
                    self._buffers[k] = memoryview(self._fetch(str(entry["uri"])))
                except FileNotFoundError:
                    raise AssetError(f"refers to {str(entry['uri'])[:80]}, which is not beside it") from None
            else:
                self._buffers[k] = self._own
        return self._buffers[k]


def _parse(raw: bytes, kind: str) -> tuple[dict[str, Any], memoryview]:
    """Return the document and the own data of a file; one whose arrays would be far larger than it is refused."""
    text, rest = memoryview(raw), memoryview(b"")
    if kind == "GLB":
        if len(raw) < 20 or raw[:4] != b"glTF":
            raise AssetError("is not a GLB file")
        version, _, length, chunk = struct.unpack_from("<IIII", raw, 4)
        if version != 2 or chunk != 0x4E4F534A or length > _MAX_JSON_BYTES:
            raise AssetError("is not a GLB 2 file")
        text, rest = text[20 : 20 + length], text[20 + length :]
    try:
        document = loads_json(bytes(text[:_MAX_JSON_BYTES]), finite=False)
        accessors = document.get("accessors", [])
        counts = [int(a["count"]) for a in accessors]
        # An accessor without a buffer view costs the file nothing, and several nodes may show one mesh.
        shown = sum(
            (counts[p["indices"]] if "indices" in p else counts[p["attributes"]["POSITION"]]) // 3
            for node in document.get("nodes", [])
            if "mesh" in node
            for p in document["meshes"][node["mesh"]]["primitives"]
        )
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise AssetError(f"is a damaged {kind} file") from error
    if min(counts, default=0) < 0:
        raise AssetError(f"is a damaged {kind} file: an array of {min(counts):,} numbers")
    if sum(counts) > 6 * MAX_TRIANGLES or shown > MAX_TRIANGLES:
        raise AssetError(
            f"asks for {max(shown, sum(counts) // 3):,} triangles, the maximum is {MAX_TRIANGLES:,}: "
            "simplify or split the mesh"
        )
    packed = {"KHR_draco_mesh_compression", "EXT_meshopt_compression"} & {*document.get("extensionsRequired", ())}
    if packed:
        raise AssetError(f"is compressed ({', '.join(sorted(packed))}): export it without compression")
    size = struct.unpack_from("<I", rest)[0] if len(rest) >= 8 else 0
    return document, rest[8 : 8 + size]


def _base_colour(material: dict[str, Any]) -> tuple[list[float], dict[str, Any] | None]:
    """Return a material's base colour (linear) and texture."""
    old = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
    if old is not None:
        return list(old.get("diffuseFactor", (1.0, 1.0, 1.0, 1.0))), old.get("diffuseTexture")
    surface = material.get("pbrMetallicRoughness", {})
    return list(surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))), surface.get("baseColorTexture")


def _local(node: dict[str, Any]) -> Floats:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = (float(c) for c in node.get("rotation", (0, 0, 0, 1)))
    out = np.eye(4)
    out[:3, :3] = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]) * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)  # fmt: skip
    out[:3, 3] = node.get("translation", (0, 0, 0))
    return out
