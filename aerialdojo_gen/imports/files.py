"""Read a mesh file of a foreign make: GLB, OBJ, STL, PLY (by trimesh) or 3DS.

Files are hostile until shown otherwise: they are read in a process of their own that may take neither more memory
nor more time than it is given, GLB files are looked over before an array of theirs is made, and what a file refers
to is read from beside it or not at all.
"""

from __future__ import annotations

import re
import resource
import struct
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.common.bounded import loads_json
from aerialdojo_gen.errors import AssetError
from aerialdojo_gen.imports.raw import RawNode, joined, plain
from aerialdojo_gen.imports.sniffing import mismatch
from aerialdojo_gen.store.staging import scratch_folder

SUFFIXES = (".glb", ".obj", ".stl", ".ply", ".3ds")
MAX_FILE_BYTES = 1 << 30
MAX_TRIANGLES = 4_000_000
MAX_MEMORY_BYTES = 6 << 30
MAX_SECONDS = 300
_MAX_SIDE_FILE = 64 << 20


def read_mesh(path: Path, max_memory_bytes: int = MAX_MEMORY_BYTES) -> list[RawNode]:
    """Read a mesh file's nodes, in bounded memory and time.

    Parameters
    ----------
    path : Path
        A file with one of `SUFFIXES`.
    max_memory_bytes : int
        Most address space of the reading process.

    Returns
    -------
    list of RawNode
        Nodes with at least one triangle, in the order of the file; transformations are applied.

    Raises
    ------
    AssetError
        The file is missing, of another kind, too large, damaged, empty, or needs too much memory or time.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise AssetError(f"{path}: meshes are read from {', '.join(s[1:].upper() for s in SUFFIXES)} files")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise AssetError(f"{path}: {error.strerror}") from None
    if size > MAX_FILE_BYTES:
        raise AssetError(f"{path}: {size >> 20} MiB, the most is {MAX_FILE_BYTES >> 20}: simplify or split the mesh")
    if unlike := _unlike(path):
        raise AssetError(f"{path}: {unlike}")
    with scratch_folder() as folder:
        out = folder / "nodes.npz"
        # Not multiprocessing, which would run a caller's unguarded script a second time.
        command = [sys.executable, "-m", __name__, str(path.resolve()), str(out), str(max_memory_bytes)]
        try:
            ended = subprocess.run(command, capture_output=True, text=True, timeout=MAX_SECONDS, check=False)
        except subprocess.TimeoutExpired:
            raise AssetError(f"{path}: reading takes more than {MAX_SECONDS} s: simplify or split the mesh") from None
        if ended.returncode:
            said = ended.stdout.strip().splitlines()
            raise AssetError(f"{path}: {said[-1] if said else 'its reader crashed: damaged, or too large'}")
        return unpacked(out)


def _unlike(path: Path) -> str:
    try:
        return mismatch(path, SUFFIXES)
    except OSError as error:
        return str(error.strerror)


def read_into(path: Path, out: Path) -> str:
    """Read a mesh file without bounds on memory and time: for a process of its own that has them.

    Parameters
    ----------
    path : Path
        The mesh file.
    out : Path
        Where the nodes go; `read_mesh` reads them from there.

    Returns
    -------
    str
        What is wrong with the file; empty where nothing is.
    """
    # What readers grumble about is repaired and reported later.
    warnings.simplefilter("ignore")
    try:
        nodes = [n for n in _read(path) if len(n.faces)]
        total = sum(len(n.faces) for n in nodes)
        if not nodes:
            return "holds no triangles"
        if total > MAX_TRIANGLES:
            return f"{total:,} triangles, the most is {MAX_TRIANGLES:,}: simplify or split the mesh"
        _pack(nodes, out)
    except AssetError as error:
        return str(error)
    except (MemoryError, ImportError):
        most = resource.getrlimit(resource.RLIMIT_AS)[0] >> 20
        return f"needs more than {most} MiB to read: simplify or split the mesh"
    except Exception as error:  # a foreign file may make a reader fail in any way: it is named, never let through
        first = (str(error).splitlines() or [""])[0]
        return f"cannot be read ({type(error).__name__}{': ' + first[:120] if first else ''})"
    return ""


def _read(path: Path) -> list[RawNode]:
    suffix = path.suffix.lower()
    if suffix == ".3ds":
        from aerialdojo_gen.imports.three_ds import read_3ds

        return read_3ds(path.read_bytes())
    if suffix == ".glb":
        look_over_glb(path)
    import trimesh

    # What the file refers to comes through a resolver that stays in its folder.
    scene = trimesh.load_scene(
        path, file_type=suffix[1:], resolver=_beside(path), process=False, split_objects=True, group_material=False,
        maintain_order=True,
    )  # fmt: skip
    nodes: dict[str, list[RawNode]] = {}
    for name in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[name]
        body = scene.geometry[geometry]
        if not isinstance(body, trimesh.Trimesh):
            continue
        vertices = trimesh.transform_points(np.asarray(body.vertices, dtype=np.float64), transform)
        faces = np.asarray(body.faces, dtype=np.int64)
        owner = _owner(scene, str(name)) if suffix == ".glb" else str(name)
        label = "" if suffix in (".stl", ".ply") else owner
        nodes.setdefault(owner, []).append(RawNode(label, vertices, faces, _colours(body)))
    return [bodies[0] if len(bodies) == 1 else joined(bodies[0].name, bodies) for bodies in nodes.values()]


def _owner(scene: Any, name: str) -> str:
    """Name the file's node that a node of trimesh's belongs to.

    Where a node has several primitives (materials), trimesh makes a node of each and names it by the file's node and
    six random hexadecimal digits: another name in every run.
    """
    parent = scene.graph.transforms.parents.get(name)
    if parent is not None and re.fullmatch(rf"{re.escape(str(parent))}_[0-9a-f]{{6}}", name):
        return str(parent)
    return name


def _beside(path: Path) -> Any:
    import trimesh

    folder = path.resolve().parent

    class Beside(trimesh.resolvers.Resolver):
        """Gives files of the mesh's own folder and below, and no other."""

        def __init__(self) -> None:
            pass

        def get(self, name: str) -> bytes:
            wanted = (folder / name.strip()).resolve()
            if not wanted.is_relative_to(folder) or not wanted.is_file():
                raise FileNotFoundError(name)
            if wanted.stat().st_size > _MAX_SIDE_FILE:
                raise FileNotFoundError(name)
            return wanted.read_bytes()

        def keys(self) -> list[str]:
            return []

        def namespaced(self, namespace: str) -> Any:
            return self

        def write(self, name: str, data: bytes) -> None:
            raise PermissionError(name)

    return Beside()


def _colours(body: Any) -> NDArray[np.uint8]:
    """Colour a mesh's faces: by face or vertex colours, else by its material's colour or its texture's mean."""
    n = len(body.faces)
    visual = body.visual
    if visual.kind in ("face", "vertex"):
        return np.asarray(visual.face_colors[:, :3], dtype=np.uint8)
    material = getattr(visual, "material", None)
    if material is None:
        return plain(n)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if image is not None and image.width * image.height <= 16 << 20:
        mean = np.asarray(image.convert("RGB").resize((1, 1), 4), dtype=np.uint8).reshape(3)
        return np.tile(mean, (n, 1))
    colour = np.asarray(material.main_color, dtype=np.uint8)[:3]
    return np.tile(colour, (n, 1))


def look_over_glb(path: Path) -> None:
    """Refuse a GLB whose arrays would be far larger than the file, before any of them is made.

    An accessor without a buffer view is all zeros and costs the file nothing, and several nodes may show one mesh: a
    few hundred bytes can ask for terabytes.

    Raises
    ------
    AssetError
        It is no GLB 2 file, or it asks for more triangles or numbers than `MAX_TRIANGLES` allows.
    """
    with path.open("rb") as file:
        head = file.read(20)
        if len(head) < 20 or head[:4] != b"glTF":
            raise AssetError("is no GLB file")
        version, _, length, kind = struct.unpack("<IIII", head[4:])
        if version != 2 or kind != 0x4E4F534A or length > MAX_FILE_BYTES // 4:
            raise AssetError("is no GLB 2 file")
        try:
            document = loads_json(file.read(length), finite=False)
            accessors = document.get("accessors", [])
            counts = [int(a["count"]) for a in accessors]
            shown = sum(
                (counts[p["indices"]] if "indices" in p else counts[p["attributes"]["POSITION"]]) // 3
                for node in document.get("nodes", [])
                if "mesh" in node
                for p in document["meshes"][node["mesh"]]["primitives"]
            )
        except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
            raise AssetError("is a damaged GLB file") from error
    if min(counts, default=0) < 0 or sum(counts) > 6 * MAX_TRIANGLES or shown > MAX_TRIANGLES:
        raise AssetError(
            f"asks for {max(shown, sum(counts) // 3):,} triangles, the most is {MAX_TRIANGLES:,}: "
            "simplify or split the mesh"
        )
    required = set(document.get("extensionsRequired", []))
    packed = required & {"KHR_draco_mesh_compression", "EXT_meshopt_compression"}
    if packed:
        raise AssetError(f"is compressed ({', '.join(sorted(packed))}): export it without compression")


def _pack(nodes: list[RawNode], out: Path) -> None:
    arrays: dict[str, Any] = {"names": np.array([n.name for n in nodes], dtype=np.str_)}
    for k, node in enumerate(nodes):
        arrays |= {f"v{k}": node.vertices, f"f{k}": node.faces, f"c{k}": node.colours}
    np.savez(out, **arrays)


def unpacked(path: Path) -> list[RawNode]:
    """Return the nodes that `read_into` wrote."""
    with np.load(path, allow_pickle=False) as file:
        return [
            RawNode(str(name), file[f"v{k}"], file[f"f{k}"], file[f"c{k}"]) for k, name in enumerate(file["names"])
        ]


if __name__ == "__main__":
    memory = int(sys.argv[3])
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_SECONDS, MAX_SECONDS))
    fault = read_into(Path(sys.argv[1]), Path(sys.argv[2]))
    print(fault)
    raise SystemExit(1 if fault else 0)
