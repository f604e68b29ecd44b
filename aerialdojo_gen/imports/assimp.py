"""Collada and FBX by Assimp (the extra ``formats``)."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError, first_line, no_package
from aerialdojo_gen.imports.pictures import TEXTURE_PX, SourceMaterial, decode_surfaces
from aerialdojo_gen.imports.raw import GREY, RawNode, empty_corners, merge_nodes


def read_assimp(path: Path, resolve: Callable[[str], bytes], texture_px: int = TEXTURE_PX) -> list[RawNode]:
    """Read a Collada or FBX file: one RawNode per mesh node, in tree order, transforms applied."""
    try:
        assimp: Any = importlib.import_module("assimp_py")
    except ImportError:
        who = path.suffix[1:].upper()
        raise AssetError(f"{no_package(who, 'assimp_py', 'formats')}, or export the mesh as GLB") from None
    try:
        scene = assimp.import_file(str(path), assimp.Process_Triangulate | assimp.Process_SortByPType)
    except (RuntimeError, ValueError, OSError) as error:
        raise AssetError(f"Assimp cannot read it ({first_line(error)})") from None
    diffuse = int(assimp.TextureType_DIFFUSE)
    surfaces, index = decode_surfaces([_source_material(m, diffuse, resolve) for m in scene.materials], texture_px)
    meshes = [_mesh(mesh) for mesh in scene.meshes]
    out: list[RawNode] = []
    stack = [(scene.root_node, np.eye(4))]
    while stack:
        node, parent = stack.pop()
        world = parent @ np.array(node.transformation, dtype=np.float64).reshape(4, 4)
        bodies = []
        for k in node.mesh_indices:
            vertices, faces, corners = meshes[k]
            if not len(faces):
                continue
            surface = index[scene.meshes[k].material_index] if index else -1
            colour = surfaces[surface].colour if index else GREY
            turned = faces[:, ::-1] if np.linalg.det(world[:3, :3]) < 0 else faces
            bodies.append(RawNode(
                node.name, vertices @ world[:3, :3].T + world[:3, 3], turned,
                np.tile(np.array(colour, dtype=np.uint8), (len(faces), 1)),
                np.full(len(faces), surface, dtype=np.int32), corners[turned], surfaces,
            ))  # fmt: skip
        if bodies:
            out.append(bodies[0] if len(bodies) == 1 else merge_nodes(node.name, bodies))
        stack += [(child, world) for child in reversed(node.children)]
    return out


def _mesh(mesh: Any) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float32]]:
    """Vertices (n, 3), faces (m, 3), and corner attributes at each vertex, (n, 5)."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    flat = np.asarray(mesh.indices, dtype=np.int64).ravel()
    # Lines and points are separate meshes without triangles.
    faces = flat.reshape(-1, 3) if len(flat) == 3 * mesh.num_faces else np.zeros((0, 3), dtype=np.int64)
    corners = empty_corners(len(vertices))[:, 0]
    if mesh.texcoords:
        uv = np.asarray(mesh.texcoords[0], dtype=np.float32).reshape(len(vertices), -1)[:, :2]
        corners[:, :2] = np.nan_to_num(uv)
    if mesh.colors:
        rgb = np.asarray(mesh.colors[0], dtype=np.float32).reshape(len(vertices), -1)[:, :3]
        if (rgb < 0.998).any():
            corners[:, 2:] = np.rint(255.0 * np.clip(np.nan_to_num(rgb), 0.0, 1.0))
    return vertices, faces, corners


def _source_material(material: dict[str, Any], diffuse: int, resolve: Callable[[str], bytes]) -> SourceMaterial:
    name = str(material.get("NAME", ""))
    diffuse_colour = material.get("COLOR_DIFFUSE") or material.get("BASE_COLOR") or (0.66, 0.64, 0.61)
    red, green, blue = (float(c) for c in list(diffuse_colour)[:3])
    files = (material.get("TEXTURES") or {}).get(diffuse) or []
    image, missing = None, ""
    if files:
        try:
            image = resolve(str(files[0]))
        except FileNotFoundError:
            missing = str(files[0])[-80:]
    return SourceMaterial(
        name, (1.0, 1.0, 1.0) if image is not None else (red, green, blue), image, missing, alpha="blend",
        double_sided=bool(material.get("TWOSIDED", 0)),
    )  # fmt: skip
