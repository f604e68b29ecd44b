"""The paper's scenes, each built once a session."""

from __future__ import annotations

import fcntl
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import pytest
from support.layout_checks import catalogue, recipe_of

from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.glb import read_glb, write_glb
from aerialdojo_gen.scenes.model import Scene


@pytest.fixture(scope="session")
def mesh_of(shared: Path) -> Callable[[str], Path]:
    """Name of a scene to its GLB: the first test process that asks builds it from its recipe, the others wait."""
    folder = shared / "scenes"
    folder.mkdir(exist_ok=True)

    def mesh(name: str) -> Path:
        path = folder / f"{name}.glb"
        with (folder / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                write_glb(build_scene(recipe_of(name), catalogue()), path)
        return path

    return mesh


@pytest.fixture(scope="session")
def scene_of(mesh_of: Callable[[str], Path]) -> Callable[[str], Scene]:
    """Name of a scene to the scene, as its GLB has it."""
    return lru_cache(maxsize=4)(lambda name: read_glb(mesh_of(name)))
