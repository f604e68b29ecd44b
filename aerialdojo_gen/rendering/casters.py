"""Ray casts in a scene: its context's one Embree scene, and whether objects are visible from positions."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.geometry.arrays import Flags, Floats
from aerialdojo_gen.geometry.rays import RayCaster, TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene


def triangle_caster(scene: Scene) -> TriangleRayCaster:
    """Return the scene's one Embree scene: the triangles of its instances in their order, and that of their parts."""
    return context_of(scene).part("triangle caster", lambda: TriangleRayCaster(*soup(scene.instances)))


def ray_caster(scene: Scene) -> RayCaster:
    """Return the scene's ray caster, over its one Embree scene."""
    return context_of(scene).part("ray caster", lambda: RayCaster(scene, triangle_caster(scene)))


# A target of which only 0.4 % is visible is found by chance; most visible ones are hit by the first few rays.
_POINTS = 256
_ROUNDS = (0, 1, 4, 16, _POINTS)
_RAYS_AT_ONCE = 1 << 18


def in_sight(scene: Scene, node: str, position: ArrayLike) -> bool:
    """Whether a straight line from a position, world metres, reaches an object before any other surface."""
    return bool(all_in_sight(scene, [node], np.asarray(position, dtype=np.float64)[None])[0])


def all_in_sight(scene: Scene, nodes: Sequence[str], positions: Floats) -> Flags:
    """For n nodes and positions (n, 3), world metres: whether each is in sight; (n,) bool."""
    seen = np.zeros(len(nodes), dtype=np.bool_)
    if not len(nodes):
        return seen
    names, which = np.unique(np.asarray(nodes), return_inverse=True)
    targets = [_target_points(scene, str(name)) for name in names]
    points, owners = np.stack([drawn for drawn, _ in targets]), np.array([k for _, k in targets], dtype=np.int32)
    rays = ray_caster(scene)
    # Sort rays by object, for memory locality.
    order = np.argsort(which, kind="stable")
    for begin, end in itertools.pairwise(_ROUNDS):
        left = order[~seen[order]]
        step = _RAYS_AT_ONCE // (end - begin)
        for rows in (left[k : k + step] for k in range(0, len(left), step)):
            ends = points[which[rows], begin:end]
            origins = np.broadcast_to(positions[rows, None], ends.shape)
            owner = np.repeat(owners[which[rows]], end - begin)
            met = rays.visible(origins.reshape(-1, 3), ends.reshape(-1, 3), owner)
            seen[rows] = met.reshape(len(rows), -1).any(axis=1)
    return seen


def _target_points(scene: Scene, node: str) -> tuple[Floats, int]:
    """Draw points of an object's surface in random order, the same in every process."""
    cached: dict[str, tuple[Floats, int]] = context_of(scene).part("points to see", dict)
    if node not in cached:
        if node not in scene:
            raise StoreError(f"{scene.name} has no node {node!r}: its mesh and the release do not match")
        draws = rng.generator(0, "in-sight", node)
        points = Surface.of(scene[node]).sample(_POINTS, draws)
        index = next(k for k, instance in enumerate(scene.instances) if instance.node == node)
        cached[node] = (draws.permutation(points), index)
    return cached[node]
