"""The valid viewpoints of targets, and whether an episode ended at one of them with the target in sight (SR-view).

The paper's rule knows one viewpoint of a target, its goal anchor: who stops before another side of the object
has failed, and who stops behind a wall has not. SR-view is an explicit Stop, without collision, within the
budget, at most the success radius from any valid viewpoint of the target, and with the target in sight: a
straight line from the body's centre reaches a point of its surface before any other surface. A goal is a
viewpoint of its target in any case, so that every success by the paper's rule with the target in sight is one
by this rule too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.planning.flight_space import Point
from aerialdojo_gen.rendering.casters import in_sight
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

Floats = NDArray[np.float64]

_TABLE = "release/viewpoints"
_COLUMNS = ("object_id", "x_m", "y_m", "z_m")


@dataclass(frozen=True)
class View:
    """A body's distance to a target's viewpoints, and the target's visibility."""

    viewpoint_distance_m: float  # To the nearest valid viewpoint of the target, its goal included, metres
    target_in_sight: bool  # A straight line reaches the target unobstructed


def viewpoints_content(root: DataRoot, scene: str) -> list[str]:
    """Content digests of a scene's viewpoints; empty if an older release has none."""
    return store.content(root, _TABLE, scene) if store.shards(root, _TABLE, scene) else []


def no_viewpoints_message(scenes: Sequence[str], of: int) -> str:
    """Name the scenes whose episodes get no SR-view."""
    which = "the release has" if len(scenes) == of else f"{', '.join(scenes)}: the release has"
    return f"{which} no viewpoints/, which an older version did not write: SR-view stays empty"


@lru_cache(maxsize=64)
def viewpoints_of(root: DataRoot, scene: str) -> dict[int, Floats] | None:
    """Read the valid viewpoints of a scene's objects, (n, 3) world metres by ``object_id``.

    None where the release has none.
    """
    if not store.shards(root, _TABLE, scene):
        return None
    table = store.read_scene(root, _TABLE, scene, _COLUMNS)
    ids = table["object_id"].to_numpy()
    xyz = np.column_stack([table[column].to_numpy() for column in _COLUMNS[1:]])
    return {int(k): xyz[ids == k] for k in np.unique(ids)}


@lru_cache(maxsize=64)
def nodes_of(root: DataRoot, scene: str) -> dict[int, str]:
    """Mesh nodes of a scene's objects, by ``object_id``."""
    table = store.read_scene(root, "release/objects", scene, ("object_id", "mesh_node"))
    return dict(zip(table["object_id"].to_pylist(), table["mesh_node"].to_pylist(), strict=True))


def view_of(scene: Scene, node: str, viewpoints: Floats, goal: Point, position: Point) -> View:
    """Distance to the nearest viewpoint, world metres, and whether the target is in sight from a position."""
    nearest = math.dist(position, goal)
    if len(viewpoints):
        nearest = min(nearest, float(np.linalg.norm(viewpoints - np.array(position), axis=1).min()))
    return View(nearest, in_sight(scene, node, position))
