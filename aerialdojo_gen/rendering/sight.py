"""Whether an object can be seen from a place, by rays: the same answer for whoever asks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.common import rng
from aerialdojo_gen.errors import StoreError
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]

# A target whose one sliver of 0.4 % shows is found by chance; most that can be seen is met by the first few rays.
_POINTS = 256
_FIRST = 16


def in_sight(scene: Scene, node: str, position: ArrayLike) -> bool:
    """Tell whether a straight line from a place reaches an object, before any other surface.

    Parameters
    ----------
    scene : Scene
    node : str
        The object's node name.
    position : (3,) array_like of float
        Metres, world frame.

    Raises
    ------
    StoreError
        The scene has no such node.
    """
    points, index = _aims(scene, node)
    rays = ray_caster(scene)
    return any(bool(rays.visible(position, some, index).any()) for some in (points[:_FIRST], points[_FIRST:]))


def _aims(scene: Scene, node: str) -> tuple[Floats, int]:
    """Draw points of an object's surface, the same in every process, in an order that goes all over it."""
    known: dict[str, tuple[Floats, int]] = context_of(scene).part("points to see", dict)
    if node not in known:
        if node not in scene:
            raise StoreError(f"{scene.name} has no node {node!r}: its mesh and the release do not belong together")
        draws = rng.generator(0, "in-sight", node)
        points = Surface.of(scene[node]).sample(_POINTS, draws)
        index = next(k for k, instance in enumerate(scene.instances) if instance.node == node)
        known[node] = (draws.permutation(points), index)
    return known[node]
