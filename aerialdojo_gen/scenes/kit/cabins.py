"""Cabins of cold country: raised on stilts with a porch, or with a gable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import Polygon

from aerialdojo_gen.scenes import grammar_buildings
from aerialdojo_gen.scenes.grammar_frames import Frame, Parts
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.mesh import translated
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.shapes import box, cylinder
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

_STILT_M, _RAIL_M, _SNOW_M = 1.3, 1.0, 0.16
_Side = Annotated[Number, Field(ge=2, le=100)]


@dataclass(frozen=True)
class Cabin:
    """A cabin of one storey."""

    at: At
    wall: Material
    yaw_deg: Number = 0.0  # Where its front looks
    size_m: tuple[_Side, _Side, _Side] = (4.2, 9.0, 2.8)  # Depth, width and height

    @property
    def frame(self) -> Frame:
        """Frame of its middle."""
        return Frame(*self.at, self.yaw_deg)

    def plan(self, ahead_m: float = 0.0) -> Polygon:
        """Plan with so much before the front, world frame, metres."""
        u, v = self.size_m[0] / 2, self.size_m[1] / 2
        return Polygon([self.frame.at(a, b) for a, b in ((-u, -v), (u + ahead_m, -v), (u + ahead_m, v), (-u, v))])

    def ground_m(self, site: Site, ahead_m: float = 0.0) -> list[float]:
        """Heights of the ground at the corners of the plan."""
        return [site.ground_z(float(x), float(y)) for x, y in shapely.get_coordinates(self.plan(ahead_m))]


@site_builder
def gable_cabins(site: Site, *, cabins: list[Cabin], roof: Material = "snow") -> None:
    """Put up cabins with a steep gable roof, each on its lowest corner's ground."""
    for cabin in cabins:
        (depth, width, height), z = cabin.size_m, min(cabin.ground_m(site))
        form = grammar_buildings.Roof(roof, "gable", 0.32 * min(depth, width), overhang_m=0.7)
        extra = cabin.frame.parts(_front(depth, width), z)
        grammar_buildings.building(site, cabin.plan(), cabin.wall, form, height, z=z, category="hut", extra=extra)


@site_builder
def raised_cabins(site: Site, *, cabins: list[Cabin], roof: Material = "snow") -> list[float]:
    """Put up cabins on stilts, with a porch and steps before the front; gives the heights of their flat roofs."""
    return [_raised_cabin(site, cabin, roof) for cabin in cabins]


def _raised_cabin(site: Site, cabin: Cabin, roof: str) -> float:
    depth, width, height = cabin.size_m
    floor = max(cabin.ground_m(site, 2.4)) + _STILT_M
    u, v = depth / 2, width / 2
    parts: Parts = [
        (cabin.wall, slab(rectangle(-u, -v, u, v), 0.0, height)),
        (roof, slab(rectangle(-u - 0.15, -v - 0.15, u + 0.15, v + 0.15), height, height + _SNOW_M)),
        ("steel", slab(rectangle(-u, -v, u + 2.4, v), -0.16, 0.0)),
    ]
    stilt = cylinder(radius=0.1, height=_STILT_M + 0.8, segments=6)
    for a in (-u + 0.3, 0.0, u - 0.3, u + 2.2):
        for b in np.linspace(-v + 0.4, v - 0.4, max(int(width // 3), 2)):
            parts.append(("steel", translated(stilt, (a, float(b), -_STILT_M - 0.8))))
    rail = [(u, -v, _RAIL_M), (u + 2.35, -v, _RAIL_M), (u + 2.35, v - 1.4, _RAIL_M)]
    parts.append(("#e9b52a", sweep(path=rail, radius=0.04, sides=5)))
    for x, y, _ in (*rail, (u + 2.35, 0.0, 0.0), (u + 2.35, v, 0.0)):
        parts.append(("#e9b52a", translated(cylinder(radius=0.035, height=_RAIL_M, segments=5), (x, y, 0.0))))
    for k in range(5):
        at = (u + 2.55 + 0.28 * k, v - 0.7, -0.26 * (k + 1))
        parts.append(("steel", translated(box(size=(0.28, 1.2, 0.06)), at)))
    parts += _front(depth, width)
    site.add(None, "hut", cabin.frame.parts(parts, floor), footprint=cabin.plan(4.2))
    return floor + height + _SNOW_M


def _front(depth: float, width: float) -> Parts:
    """Door and windows on the front, windows at the back."""
    u = depth / 2
    parts: Parts = [("#3a4650", translated(box(size=(0.08, 1.0, 2.0)), (u, width * 0.28, 0.02)))]
    for v in np.arange(-width / 2 + 1.0, width * 0.28 - 1.0, 1.9):
        for side in (-1.0, 1.0):
            parts.append(("#e9e7de", translated(box(size=(0.08, 1.12, 0.92)), (side * u, float(v), 1.04))))
            parts.append(("window", translated(box(size=(0.12, 0.95, 0.75)), (side * u, float(v), 1.12))))
    return parts
