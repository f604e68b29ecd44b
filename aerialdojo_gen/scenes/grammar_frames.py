"""Grammar of layouts: frames on the ground, in which buildings and groups of things are made."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from shapely.affinity import rotate, translate
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.mesh import Mesh, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes import box

Parts = list[tuple[str, Mesh]]


@dataclass(frozen=True)
class Frame:
    """A frame on the ground: origin in metres, direction of its u axis in degrees counter-clockwise from +x."""

    x: float
    y: float
    yaw_deg: float = 0.0

    def at(self, u: float, v: float) -> tuple[float, float]:
        """World coordinates of a point, metres."""
        c, s = float(np.cos(np.radians(self.yaw_deg))), float(np.sin(np.radians(self.yaw_deg)))
        return self.x + c * u - s * v, self.y + s * u + c * v

    def pose(self, u: float, v: float, yaw_deg: float = 0.0) -> Pose:
        """World pose of a point that looks along `yaw_deg` from the u axis."""
        return Pose(*self.at(u, v), self.yaw_deg + yaw_deg)

    def path(self, points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
        """World coordinates of a polyline."""
        return [self.at(u, v) for u, v in points]

    def area(self, area: BaseGeometry) -> BaseGeometry:
        """World coordinates of an area."""
        return translate(rotate(area, self.yaw_deg, origin=(0, 0)), self.x, self.y)

    def parts(self, parts: Parts, z_m: float = 0.0) -> Parts:
        """World coordinates of meshes whose z starts at `z_m`."""
        turn = rotation(0.0, 0.0, self.yaw_deg)
        return [(material, translated(rotated(m, turn), (self.x, self.y, z_m))) for material, m in parts]


def block(x0: float, y0: float, x1: float, y1: float, z0: float, z1: float) -> Mesh:
    """Make an axis-parallel box between two corners, metres."""
    return translated(box(size=(x1 - x0, y1 - y0, z1 - z0)), ((x0 + x1) / 2, (y0 + y1) / 2, z0))
