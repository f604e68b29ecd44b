"""How far an instance stands from ground of some material: water, a road, a path."""

from __future__ import annotations

from fnmatch import fnmatchcase

import numpy as np
import shapely

from aerialdojo_gen.annotations.relations import SceneGeometry

GROUND = ("ground", "terrain", "river")
_RISE_M = 3.0


class Grounds:
    """The surfaces of a scene's ground."""

    def __init__(self, geometry: SceneGeometry) -> None:
        self._geometry = geometry
        self._trees: dict[str, tuple[shapely.STRtree, np.ndarray]] = {}

    def within(self, i: int, pattern: str, most_m: float) -> bool:
        """Whether ground of a material comes within `most_m` metres of an instance's outline."""
        tree, heights = self._tree(pattern)
        hits = tree.query(self._geometry.outline(i), predicate="dwithin", distance=most_m)
        low = float(self._geometry.boxes[i, 0, 2])
        return bool((np.abs(heights[hits] - low) <= _RISE_M).any())

    def _tree(self, pattern: str) -> tuple[shapely.STRtree, np.ndarray]:
        if pattern not in self._trees:
            found = [
                part.vertices[part.faces]
                for thing in self._geometry.scene.instances
                if thing.category in GROUND
                for part in thing.parts
                if any(fnmatchcase(part.material, one) for one in pattern.split("|"))
            ]
            corners = np.concatenate(found) if found else np.zeros((0, 3, 3))
            shapes = shapely.polygons(corners[:, :, :2])
            solid = shapely.area(shapes) > 1e-6
            self._trees[pattern] = shapely.STRtree(shapes[solid]), corners[solid, :, 2].mean(axis=1)
        return self._trees[pattern]
