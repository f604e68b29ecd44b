"""The ray casters of a scene: its context has one Embree scene, and all rays are cast at that."""

from __future__ import annotations

from aerialdojo_gen.geometry.rays import RayCaster, TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene


def triangle_caster(scene: Scene) -> TriangleRayCaster:
    """Return the scene's one Embree scene: the triangles of its instances in their order, and that of their parts."""
    return context_of(scene).part("triangle caster", lambda: TriangleRayCaster(*soup(scene.instances)))


def ray_caster(scene: Scene) -> RayCaster:
    """Return the scene's ray caster, over its one Embree scene."""
    return context_of(scene).part("ray caster", lambda: RayCaster(scene, triangle_caster(scene)))
