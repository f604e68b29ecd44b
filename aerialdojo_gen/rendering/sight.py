"""Whether an object can be seen from a place, by rays: the same answer for whoever asks."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]

# A target whose one sliver of 0.4 % shows is found by chance; most that can be seen is met by the first few rays.
_POINTS = 256
_ROUNDS = (0, 1, 4, 16, _POINTS)
_RAYS_AT_ONCE = 1 << 18


def in_sight(scene: Scene, node: str, position: ArrayLike) -> bool:
    """Whether a straight line from a position, world metres, reaches an object before any other surface."""
    return bool(all_in_sight(scene, [node], np.asarray(position, dtype=np.float64)[None])[0])


def all_in_sight(scene: Scene, nodes: Sequence[str], positions: Floats) -> NDArray[np.bool_]:
    """For n nodes and positions (n, 3), world metres: whether each is in sight; (n,) bool."""
    seen = np.zeros(len(nodes), dtype=np.bool_)
    if not len(nodes):
        return seen
    names, which = np.unique(np.asarray(nodes), return_inverse=True)
    aims = [_aims(scene, str(name)) for name in names]
    points, own = np.stack([drawn for drawn, _ in aims]), np.array([index for _, index in aims], dtype=np.int32)
    rays = ray_caster(scene)
    # Rays at one object one after the other: they go through the same memory.
    order = np.argsort(which, kind="stable")
    for begin, end in itertools.pairwise(_ROUNDS):
        left = order[~seen[order]]
        step = _RAYS_AT_ONCE // (end - begin)
        for some in (left[k : k + step] for k in range(0, len(left), step)):
            there = points[which[some], begin:end]
            origins = np.broadcast_to(positions[some, None], there.shape)
            owner = np.repeat(own[which[some]], end - begin)
            met = rays.visible(origins.reshape(-1, 3), there.reshape(-1, 3), owner)
            seen[some] = met.reshape(len(some), -1).any(axis=1)
    return seen


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
