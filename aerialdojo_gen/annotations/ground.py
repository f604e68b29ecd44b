"""A scene's ground: its triangles, and which parts of things lie below it or below water."""

from __future__ import annotations

from fnmatch import fnmatchcase
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from aerialdojo_gen.scenes.appearances import Appearance
from aerialdojo_gen.scenes.model import Instance, Scene

Floats = NDArray[np.float64]

GROUND = ("ground", "terrain", "river")
# A body that stands on the ground touches it.
_TOUCH_M = 0.01
_MAX_HIDDEN = 0.5


class Surface:
    """The upper surface of a scene's ground and water."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._last: tuple[Instance, NDArray[np.bool_], Floats] | None = None

    @cached_property
    def _triangles(self) -> tuple[shapely.STRtree, Floats]:
        return ground_triangles(self._scene, "*")

    def hidden(self, instance: Instance, faces: NDArray[np.int64]) -> float:
        """Share, 0 to 1, of the area of `faces` (indices into the instance's faces) that lies below the surface."""
        under, areas = self._under(instance)
        return float(areas[faces][under[faces]].sum() / max(areas[faces].sum(), 1e-12))

    def _under(self, instance: Instance) -> tuple[NDArray[np.bool_], Floats]:
        """Return which face centres lie below the surface, and the faces' areas."""
        if self._last is None or self._last[0] is not instance:
            corners = instance.vertices[instance.faces]
            a, b, c = np.moveaxis(corners, 1, 0)
            middles = corners.mean(axis=1)
            tree, ground = self._triangles
            points, over = tree.query(shapely.points(middles[:, :2]), predicate="intersects")
            heights = _heights(ground[over], middles[points, :2])
            below = (heights > middles[points, 2] + _TOUCH_M) & (heights < instance.bounds[1, 2])
            under = np.zeros(len(middles), bool)
            under[points[below]] = True
            self._last = instance, under, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
        return self._last[1:]

    def shows(self, appearance: Appearance, instance: Instance) -> bool:
        """Whether at least half of each part that a phrase mentions, and of each counted copy, is visible."""
        pieces = [faces for name in appearance.count for faces in instance.copies_of(name)]
        pieces += [faces for name in appearance.parts if len(faces := instance.faces_of(name))]
        return all(self.hidden(instance, faces) <= _MAX_HIDDEN for faces in pieces)


def ground_triangles(scene: Scene, pattern: str) -> tuple[shapely.STRtree, Floats]:
    """Ground triangles of materials that match, from above as a tree, and their corners, (n, 3, 3)."""
    found = [
        part.vertices[part.faces]
        for thing in scene.instances
        if thing.category in GROUND
        for part in thing.parts
        if any(fnmatchcase(part.material, one) for one in pattern.split("|"))
    ]
    corners = np.concatenate(found) if found else np.zeros((0, 3, 3))
    shapes = shapely.polygons(corners[:, :, :2])
    solid = shapely.area(shapes) > 1e-6
    return shapely.STRtree(shapes[solid]), corners[solid]


def _heights(triangles: Floats, points: Floats) -> Floats:
    """Height of each triangle's plane, (n, 3, 3), over a point of the plane, (n, 2)."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    away = points - triangles[:, 0, :2]
    return np.asarray(triangles[:, 0, 2] - (normals[:, :2] * away).sum(axis=1) / normals[:, 2])
