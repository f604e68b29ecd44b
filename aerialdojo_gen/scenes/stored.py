"""Meshes of a data root."""

from __future__ import annotations

import os
from pathlib import Path

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.root import DataRoot, Where, is_outside, open_root


def mesh_copy(where: Where, mesh_path: str) -> Path:
    """Return the local copy of a release's mesh; FileNotFoundError where it is missing."""
    root = open_root(where)
    if is_outside(root, mesh_path):
        raise AssetError(f"release/scenes: mesh_path {mesh_path!r} points outside {root}")
    path = root.local_copy(mesh_path)
    if not path.is_file():
        raise FileNotFoundError(2, os.strerror(2), str(path))
    return path


def mesh_file(data: DataRoot, relative: str) -> Path:
    """Return the local copy of a built scene's mesh; an `AssetError` names the command that makes it."""
    try:
        return data.local_copy(relative)
    except FileNotFoundError:
        missing = (
            f"{data.at(relative)}: cannot be read ({os.strerror(2)}); "
            f"run {command('build-scenes', scene=Path(relative).stem)}"
        )
        raise AssetError(missing) from None


def read_scene_mesh(data: DataRoot, relative: str, sha256: str) -> Scene:
    """Read the mesh that a row of `scenes` names: its ``mesh_path``, and its ``mesh_sha256``."""
    return read_glb(mesh_file(data, relative), sha256)
