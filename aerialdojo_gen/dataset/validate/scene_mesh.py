"""The scene's mesh, as the checks that need it get it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from aerialdojo_gen.dataset.validate.registry import ALWAYS_AFTER, UncheckedError
from aerialdojo_gen.dataset.validate.rows import SceneData
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.planning.collision import CollisionWorld, collision_world
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.scenes.context import open_scene
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.root import LocalRoot

# Without these nothing else of the mesh can be checked.
MESH_CHECKS = ("mesh_outside", "mesh_missing", "mesh_digest", "mesh_damaged")


@dataclass(frozen=True)
class SceneMesh:
    """A scene's mesh, and what questions to it are put to: parts of its context, built on first use."""

    scene: Scene

    @property
    def world(self) -> CollisionWorld:
        """FCL's world."""
        return collision_world(self.scene)

    @property
    def rays(self) -> RayCaster:
        """For first hits."""
        return ray_caster(self.scene)


def mesh_place(data: SceneData) -> str:
    """Where the scene's mesh should lie, for messages."""
    stored_path = str(data["scenes"].texts("mesh_path")[0])
    return str(data.meshes / Path(stored_path).name) if data.meshes is not None else data.release.root.at(stored_path)


def mesh_path(data: SceneData) -> Path:
    """Return the scene's mesh on this machine; FileNotFoundError where it is not there."""
    stored_path = str(data["scenes"].texts("mesh_path")[0])
    if data.meshes is None:
        return data.release.root.local_copy(stored_path)
    return LocalRoot(data.meshes).local_copy(Path(stored_path).name)


def require_meshes(data: SceneData) -> None:
    """Raise `UncheckedError` where meshes are to be left alone, or the scene's row is not one row."""
    if not data.use_meshes:
        raise UncheckedError("--no-meshes was given")
    if "scenes" not in data.tables or len(data["scenes"]) != 1:
        raise UncheckedError("scenes has not one row of it")
    if data.flagged("scenes", ALWAYS_AFTER).any():
        raise UncheckedError("the scene's row is at fault")


def scene_mesh(data: SceneData) -> SceneMesh:
    """Return the scene's mesh, read once."""
    require_meshes(data)
    if data.flagged("scenes", MESH_CHECKS).any():
        raise UncheckedError("no mesh")
    digest = str(data["scenes"].texts("mesh_sha256")[0])
    return data.cached("mesh", lambda: SceneMesh(open_scene(mesh_path(data), digest).scene))
