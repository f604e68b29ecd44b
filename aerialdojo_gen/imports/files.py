"""Read mesh files: glTF, OBJ, STL, PLY (by trimesh), 3DS, Collada and FBX (by Assimp).

Files are untrusted: they are read in a child process with limits on memory and time, GLB files are checked before
any array is allocated, and references are resolved in the file's own folder only.
"""

from __future__ import annotations

import json
import re
import warnings
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerialdojo_gen.base.environment_errors import is_out_of_memory
from aerialdojo_gen.base.errors import AssetError, check_regular
from aerialdojo_gen.imports.gltf import MAX_TRIANGLES, read_gltf
from aerialdojo_gen.imports.pictures import TEXTURE_PX, SourceMaterial, decode_surfaces
from aerialdojo_gen.imports.raw import RawNode, RawSurface, default_colours, empty_corners, merge_nodes
from aerialdojo_gen.imports.untrusted import MAX_MEMORY_BYTES, SiblingFiles, exit_status, mismatch, read_in_sandbox
from aerialdojo_gen.store.staging import scratch_folder

SUFFIXES = (".glb", ".gltf", ".obj", ".stl", ".ply", ".3ds", ".dae", ".fbx")
MAX_FILE_BYTES = 1 << 30


def read_mesh(path: Path, max_memory_bytes: int = MAX_MEMORY_BYTES, texture_px: int = TEXTURE_PX) -> list[RawNode]:
    """Read the nodes of a mesh file that have triangles, transforms applied, in bounded memory and time."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise AssetError(f"{path}: meshes are read from {', '.join(s[1:].upper() for s in SUFFIXES)} files")
    try:
        check_regular(path)
        size, fault = path.stat().st_size, mismatch(path, SUFFIXES)
    except OSError as error:
        raise AssetError(f"{path}: {error.strerror}") from None
    if size > MAX_FILE_BYTES:
        most = f"the maximum is {MAX_FILE_BYTES >> 20}: simplify or split the mesh"
        raise AssetError(f"{path}: {size >> 20} MiB, {most}")
    if fault:
        raise AssetError(f"{path}: {fault}")
    with scratch_folder() as folder:
        out = folder / "nodes.npz"
        args = [str(out), str(texture_px)]
        read_in_sandbox(__name__, path, args, max_memory_bytes, "simplify or split the mesh")
        return unpack_nodes(out)


def read_into(path: Path, out: Path, texture_px: int = TEXTURE_PX) -> str:
    """Read a mesh file in the sandboxed child process; returns the error message, or an empty string."""
    # Reader warnings are irrelevant: faults are repaired and reported later.
    warnings.simplefilter("ignore")
    try:
        nodes = [n for n in _read(path, texture_px) if len(n.faces)]
        total = sum(len(n.faces) for n in nodes)
        if not nodes:
            return "holds no triangles"
        if total > MAX_TRIANGLES:
            return f"{total:,} triangles, the maximum is {MAX_TRIANGLES:,}: simplify or split the mesh"
        _pack(nodes, out)
    except AssetError as error:
        return str(error)
    except Exception as error:  # untrusted files can make a reader fail in any way: report it
        if isinstance(error, MemoryError) or is_out_of_memory(str(error)):
            raise MemoryError from None
        first = (str(error).splitlines() or [""])[0]
        return f"cannot be read ({type(error).__name__}{': ' + first[:120] if first else ''})"
    return ""


def _read(path: Path, texture_px: int) -> list[RawNode]:
    suffix = path.suffix.lower()
    if suffix == ".3ds":
        from aerialdojo_gen.imports.three_ds import read_3ds

        return read_3ds(path.read_bytes())
    if suffix in (".glb", ".gltf"):
        return read_gltf(path.read_bytes(), suffix[1:].upper(), SiblingFiles(path).get, texture_px)
    if suffix in (".dae", ".fbx"):
        from aerialdojo_gen.imports.assimp import read_assimp

        return read_assimp(path, SiblingFiles(path).get, texture_px)
    import trimesh

    # References are resolved within the mesh's folder only.
    siblings: Any = SiblingFiles(path)
    scene = trimesh.load_scene(
        path, file_type=suffix[1:], resolver=siblings, process=False, split_objects=True, group_material=True,
        maintain_order=False,
    )  # fmt: skip
    named = _objects_of(path) if suffix == ".obj" else {}
    nodes, shown = [], []
    for name in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[name]
        body = scene.geometry[geometry]
        if isinstance(body, trimesh.Trimesh):
            vertices = trimesh.transform_points(np.asarray(body.vertices, dtype=np.float64), transform)
            faces = np.asarray(body.faces, dtype=np.int64)
            label = "" if suffix in (".stl", ".ply") else _object_of(str(name), named, path)
            shown.append(body)
            nodes.append(RawNode(label, vertices, faces, default_colours(len(faces))))
    several: dict[str, list[RawNode]] = {}
    for node in _add_materials(nodes, shown, siblings, texture_px):
        several.setdefault(node.name, []).append(node)
    return [bodies[0] if len(bodies) == 1 else merge_nodes(name, bodies) for name, bodies in several.items()]


def _objects_of(path: Path) -> dict[str, str]:
    """Map trimesh's mesh names to the objects of an OBJ file."""
    named, thing, material = {}, "", ""
    for key, value in re.findall(rb"^(o|usemtl)[ \t]+(.*?)[ \t\r]*$", path.read_bytes(), re.MULTILINE):
        if key == b"o":
            thing = value.decode("utf-8", "replace")
        else:
            material = value.decode("utf-8", "replace")
        named["_".join(word for word in (thing, material) if word)] = thing
    return named


def _object_of(name: str, named: Mapping[str, str], path: Path) -> str:
    """Return the object that a trimesh mesh belongs to."""
    stem = re.sub(r"_\d+$", "", name)
    objects = set(named.values())
    # With no more than one material, trimesh numbers the pieces of an object, and names unnamed
    # ones by the file's path.
    other = stem if name not in objects and stem in objects else "" if path.name in name else name
    return named.get(name, other)


def _add_materials(
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


def _pack(nodes: list[RawNode], out: Path) -> None:
    arrays: dict[str, Any] = {}

    def packed(key: str, one: RawNode | RawSurface) -> dict[str, Any]:
        """Keep the arrays of a node or a surface, and return its other values."""
        values = {field.name: getattr(one, field.name) for field in fields(one) if field.name != "surfaces"}
        for name, value in list(values.items()):
            if isinstance(value, np.ndarray | bytes):
                arrays[f"{key}.{name}"] = (
                    np.frombuffer(values.pop(name), np.uint8) if name == "jpeg" else values.pop(name)
                )
        return values

    place = {surfaces: n for n, surfaces in enumerate(dict.fromkeys(node.surfaces for node in nodes))}
    head = {
        "surfaces": [[packed(f"{n}-{k}", s) for k, s in enumerate(surfaces)] for surfaces, n in place.items()],
        "nodes": [(place[node.surfaces], packed(str(k), node)) for k, node in enumerate(nodes)],
    }
    np.savez(out, head=np.frombuffer(json.dumps(head).encode(), np.uint8), **arrays)


def unpack_nodes(path: Path) -> list[RawNode]:
    """Load the nodes that `read_into` wrote."""
    arrays: defaultdict[str, dict[str, Any]] = defaultdict(dict)
    with np.load(path, allow_pickle=False) as file:
        for name in file.files:
            key, _, field = name.partition(".")
            arrays[key][field] = file[name]
    head = json.loads(arrays["head"][""].tobytes())

    def surface(key: str, row: dict[str, Any]) -> RawSurface:
        more = {"colour": tuple(row["colour"]), "notes": tuple(row["notes"]), "jpeg": arrays[key]["jpeg"].tobytes()}
        return RawSurface(**row | arrays[key] | more)

    surfaces = [
        tuple(surface(f"{n}-{k}", row) for k, row in enumerate(several)) for n, several in enumerate(head["surfaces"])
    ]
    return [RawNode(**row, **arrays[str(k)], surfaces=surfaces[n]) for k, (n, row) in enumerate(head["nodes"])]


if __name__ == "__main__":
    raise SystemExit(exit_status(lambda args: read_into(Path(args[0]), Path(args[1]), int(args[2]))))
