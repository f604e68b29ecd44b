"""Scenes as GLB files: one named node an instance, one primitive a material, textures embedded.

The file is glTF 2.0, so that any viewer shows it: a root node turns the world's z up to glTF's y up, and below it the
coordinates are the world's own, in float32. The model's v points up and glTF's down, hence the sign of v.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.scenes.glb_materials import linear_colours, material_entry, read_material, srgb_colours
from aerialdojo_gen.scenes.light import WEATHERS
from aerialdojo_gen.scenes.model import BACKDROPS, SURFACES, Instance, Material, Part, Scene, parse_anatomy

_MAGIC, _JSON, _BIN = b"glTF", 0x4E4F534A, 0x004E4942
_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_ARRAY_BUFFER, _INDEX_BUFFER = 34962, 34963
_DTYPES: dict[int, np.dtype[Any]] = {_FLOAT: np.dtype("<f4"), _UINT16: np.dtype("<u2"), _UINT32: np.dtype("<u4")}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
# Quaternion (x, y, z, w) of a quarter turn about x: z up becomes y up.
_Z_UP_TO_Y_UP = [-0.7071067811865476, 0.0, 0.0, 0.7071067811865476]
_VERSION = 1


def write_glb(scene: Scene, path: Path) -> None:
    """Write a scene in place; the same scene always makes the same bytes.

    Its coordinates and texture coordinates must be exact in float32, as those of built scenes are.
    """
    writer = _Writer()
    shown = (*scene.instances, *scene.backdrop)
    names = sorted({p.material for i in shown for p in i.parts})
    for name in names:
        writer.material(scene.materials[name])
    index = {name: k for k, name in enumerate(names)}
    for instance in shown:
        writer.instance(instance, index)
    document = writer.document(scene)
    head = json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    head += b" " * (-len(head) % 4)
    body = b"".join(writer.data)
    with path.open("wb") as file:
        file.write(struct.pack("<4sII", _MAGIC, 2, 12 + 8 + len(head) + 8 + len(body)))
        file.write(struct.pack("<II", len(head), _JSON))
        file.write(head)
        file.write(struct.pack("<II", len(body), _BIN))
        file.write(body)


def read_glb(path: Path, sha256: str = "") -> Scene:
    """Read a scene that `write_glb` wrote; it equals the written one to the last bit.

    Its digest must be `sha256`, a row's ``mesh_sha256``, where one is given. An `AssetError` says that the file is
    missing, cut short or no scene of this program (import other meshes by ``add-scene``), or has another digest.
    """
    try:
        raw = path.read_bytes()
        if sha256 and hashlib.sha256(raw).hexdigest() != sha256:
            raise AssetError(
                f"{path} is not the mesh that the tables were made from: run {command('split', scene=path.stem)}"
            )
        document, data = _chunks(raw)
        extras = document["extras"]["aerialdojo"]
        if extras["version"] != _VERSION:
            raise AssetError(
                f"{path}: scene format {extras['version']} is not {_VERSION}; "
                f"run {command('build-scenes', scene=path.stem)}"
            )

        def image(texture: int) -> memoryview:
            found = document["images"][document["textures"][texture]["source"]]
            return _view_bytes(found["bufferView"], document, data)

        materials = [read_material(m, image) for m in document["materials"]]
        names = [m.name for m in materials]
        instances = tuple(
            _read_instance(document["nodes"][k], document, data, names) for k in document["nodes"][0]["children"]
        )
        scene = Scene(
            name=extras["name"],
            instances=tuple(i for i in instances if i.surface not in BACKDROPS),
            materials={m.name: m for m in materials},
            bounds=np.array(extras["bounds_m"], dtype=np.float64),
            sky=tuple(extras["sky"]),
            sun=tuple(extras["sun"]),
            weather=extras.get("weather", WEATHERS[0]),
            imported=bool(extras.get("imported", False)),
            backdrop=tuple(i for i in instances if i.surface in BACKDROPS),
            attribution=str(document["asset"].get("copyright", "")),
        )
        _check(scene)
        return scene
    except OSError as error:
        raise AssetError(
            f"{path}: cannot be read ({error.strerror}); run {command('build-scenes', scene=path.stem)}"
        ) from error
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError, struct.error) as error:
        raise AssetError(
            f"{path}: is no scene file of this program or is damaged; run {command('build-scenes', scene=path.stem)}"
        ) from error


class _Writer:
    """Collects the glTF document and its binary chunk."""

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self._size = 0
        self._tables: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)

    def _add(self, table: str, entry: dict[str, Any]) -> int:
        self._tables[table].append(entry)
        return len(self._tables[table]) - 1

    def material(self, material: Material) -> None:
        self._add("materials", material_entry(material, self._image))

    def _image(self, file: bytes, media_type: str) -> int:
        return self._add("images", {"mimeType": media_type, "bufferView": self._view(file, None)})

    def instance(self, instance: Instance, materials: dict[str, int]) -> None:
        primitives = []
        for part in instance.parts:
            v = part.vertices.astype("<f4")
            uv = part.uv.astype("<f4") * np.array([1, -1], dtype="<f4")
            kind = _UINT16 if len(v) < 65536 else _UINT32
            attributes = {
                "POSITION": self._accessor(v, _FLOAT, "VEC3", _ARRAY_BUFFER, bounds=True),
                "TEXCOORD_0": self._accessor(uv, _FLOAT, "VEC2", _ARRAY_BUFFER),
            }
            if part.colours is not None:
                stored = self._accessor(linear_colours(part.colours), _UINT16, "VEC4", _ARRAY_BUFFER)
                self._tables["accessors"][stored]["normalized"] = True
                attributes["COLOR_0"] = stored
            indices = self._accessor(part.faces.reshape(-1).astype(_DTYPES[kind]), kind, "SCALAR", _INDEX_BUFFER)
            primitives.append({"attributes": attributes, "indices": indices, "material": materials[part.material]})
        extras = {
            "category": instance.category,
            "variant": instance.variant,
            "attributes": instance.attributes,
            **({"surface": instance.surface} if instance.surface else {}),
            **({"shape": instance.shape} if instance.shape else {}),
            **({"held_out": True} if instance.held_out else {}),
            **({} if instance.anatomy is None else {"anatomy": instance.anatomy.to_json()}),
        }
        mesh = self._add("meshes", {"primitives": primitives})
        self._add("nodes", {"name": instance.node, "mesh": mesh, "extras": extras})

    def document(self, scene: Scene) -> dict[str, Any]:
        own = {
            "version": _VERSION,
            "name": scene.name,
            "bounds_m": scene.bounds.tolist(),
            "sky": list(scene.sky),
            "sun": list(scene.sun),
            **({} if scene.weather == WEATHERS[0] else {"weather": scene.weather}),
            **({"imported": True} if scene.imported else {}),
        }
        tables = self._tables
        children = list(range(1, len(tables["nodes"]) + 1))
        root = {"name": scene.name, "rotation": _Z_UP_TO_Y_UP, "children": children}
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "aerialdojo-gen"}
            | ({"copyright": scene.attribution} if scene.attribution else {}),
            "extras": {"aerialdojo": own},
            "scene": 0,
            "scenes": [{"name": scene.name, "nodes": [0]}],
            "nodes": [root, *tables["nodes"]],
            **{table: tables[table] for table in ("meshes", "materials", "accessors", "bufferViews")},
            "buffers": [{"byteLength": self._size}],
        }
        used = sorted({name for entry in tables["materials"] for name in entry.get("extensions", {})})
        if used:
            document["extensionsUsed"] = used
        if images := tables["images"]:
            document["images"] = images
            document["samplers"] = [{"wrapS": 10497, "wrapT": 10497, "magFilter": 9729, "minFilter": 9987}]
            document["textures"] = [{"source": k, "sampler": 0} for k in range(len(images))]
        return document

    def _accessor(self, values: NDArray[Any], component: int, kind: str, target: int, bounds: bool = False) -> int:
        entry: dict[str, Any] = {
            "bufferView": self._view(values.tobytes(), target),
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if bounds:
            entry |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self._add("accessors", entry)

    def _view(self, raw: bytes, target: int | None) -> int:
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": len(raw)}
        padding = b"\0" * (-len(raw) % 4)
        self.data += [raw, padding]
        self._size += len(raw) + len(padding)
        return self._add("bufferViews", view if target is None else view | {"target": target})


def _chunks(whole: bytes) -> tuple[dict[str, Any], memoryview]:
    raw = memoryview(whole)
    magic, version, length = struct.unpack_from("<4sII", raw)
    if magic != _MAGIC or version != 2 or length != len(raw):
        raise ValueError("no whole GLB 2 file")
    head, kind = struct.unpack_from("<II", raw, 12)
    body, kind2 = struct.unpack_from("<II", raw, 20 + head)
    if kind != _JSON or kind2 != _BIN or 28 + head + body != length:
        raise ValueError("chunks do not fit")
    document = loads_json(bytes(raw[20 : 20 + head]))
    return document, raw[28 + head :]


def _check(scene: Scene) -> None:
    """Raise ValueError for values that no scene has, though they are valid JSON."""
    if not scene.instances:
        raise ValueError("a scene shows at least one instance")
    shown = (*scene.instances, *scene.backdrop)
    if not all(i.surface in ("", *SURFACES) for i in shown):
        raise ValueError("unknown kind of surface")
    texts = [scene.name, *(t for i in shown for t in (i.node, i.category, i.variant))]
    words = [w for i in shown for pair in i.attributes.items() for w in pair]
    if not all(isinstance(text, str) for text in (*texts, *words, *scene.materials)):
        raise ValueError("a name must be text")
    for colour in (scene.sky, *(m.colour for m in scene.materials.values())):
        if len(colour) != 3 or not all(type(c) is int and 0 <= c <= 255 for c in colour):
            raise ValueError("a colour is none")
    if scene.weather not in WEATHERS:
        raise ValueError("unknown kind of weather")
    numbers = [*scene.sun, *(m.tile_m for m in scene.materials.values())]
    if len(scene.sun) != 3 or not all(isinstance(n, int | float) and abs(n) < 1e9 for n in numbers):
        raise ValueError("sun or tiles are no numbers")
    arrays = [scene.bounds, *(a for i in shown for p in i.parts for a in (p.vertices, p.uv))]
    if scene.bounds.shape != (2, 3) or not all(np.isfinite(a).all() for a in arrays):
        raise ValueError("a coordinate is no finite number")
    if not all(i.parts and all(len(p.faces) and len(p.uv) == len(p.vertices) for p in i.parts) for i in shown):
        raise ValueError("a node has no triangle")


def _read_instance(
    node: dict[str, Any], document: dict[str, Any], data: memoryview, materials: list[str]
) -> Instance:
    parts = []
    for primitive in document["meshes"][node["mesh"]]["primitives"]:
        v = _array(primitive["attributes"]["POSITION"], document, data).astype(np.float64)
        uv = _array(primitive["attributes"]["TEXCOORD_0"], document, data) * np.array([1, -1], dtype=np.float32)
        faces = _array(primitive["indices"], document, data).astype(np.int32).reshape(-1, 3)
        if len(faces) and int(faces.max()) >= len(v):
            raise ValueError("face beyond the vertices")
        colours = None
        if "COLOR_0" in primitive["attributes"]:
            colours = srgb_colours(_array(primitive["attributes"]["COLOR_0"], document, data))
            if len(colours) != len(v):
                raise ValueError("as many colours as vertices")
        parts.append(Part(v, faces, uv.astype(np.float32), materials[primitive["material"]], colours))
    extras = node["extras"]
    anatomy = parse_anatomy(extras["anatomy"], [len(p.faces) for p in parts]) if "anatomy" in extras else None
    words = dict(extras["attributes"])
    return Instance(
        node["name"], extras["category"], extras["variant"], words, tuple(parts), anatomy, extras.get("surface", ""),
        str(extras.get("shape", "")), bool(extras.get("held_out", False)),
    )  # fmt: skip


def _array(accessor: int, document: dict[str, Any], data: memoryview) -> NDArray[Any]:
    entry = document["accessors"][accessor]
    width, dtype = _WIDTHS[entry["type"]], _DTYPES[entry["componentType"]]
    raw = _view_bytes(entry["bufferView"], document, data)
    flat = np.frombuffer(raw, dtype=dtype, count=entry["count"] * width)
    return flat.reshape(-1, width) if width > 1 else flat


def _view_bytes(view: int, document: dict[str, Any], data: memoryview) -> memoryview:
    entry = document["bufferViews"][view]
    start, size = entry["byteOffset"], entry["byteLength"]
    if start + size > len(data):
        raise ValueError("buffer view beyond the data")
    return data[start : start + size]
