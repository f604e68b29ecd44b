"""Mud-brick houses with roof terraces, and the walls of ruins: what stands in dry country."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import shapely
from pydantic import BaseModel, ConfigDict, Field
from shapely.geometry import LineString

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.layouts.natural.parts.groups import Deck
from aerialdojo_gen.scenes.mesh import Mesh, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes import box, cylinder
from aerialdojo_gen.scenes.shapes_extruded import profile
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.values import At, Degrees, Length, Line

_PARAPET_M = 0.45
_Side = Annotated[float, Field(ge=2, le=100)]


class House(BaseModel):
    """A flat-roofed house, as a recipe gives it; groups stand on its roof by its name.

    Attributes
    ----------
    name : str
        Its own among the scene's houses.
    at : (float, float)
        Middle, world frame, metres.
    size_m : (float, float, float)
        Depth along its front's direction, width and height, metres.
    yaw_deg : float
        Where its door looks.
    wall : str
        Material.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    at: At
    size_m: tuple[_Side, _Side, _Side] = (6.0, 7.0, 3.4)
    yaw_deg: Degrees = 0.0
    wall: str = "plaster:#c2966a"

    def area(self) -> shapely.Polygon:
        """Plan, world frame, metres."""
        return self._around(0.0)

    def roof(self) -> shapely.Polygon:
        """Plan of the terrace within the parapet."""
        return self._around(-0.3)

    def _around(self, out_m: float) -> shapely.Polygon:
        u, v = self.size_m[0] / 2 + out_m, self.size_m[1] / 2 + out_m
        frame = Frame(*self.at, self.yaw_deg)
        return shapely.Polygon([frame.at(a, b) for a, b in ((-u, -v), (u, -v), (u, v), (-u, v))])


class Wall(BaseModel):
    """A ruined wall with a ragged top, as a recipe gives it.

    Attributes
    ----------
    path : tuple of (float, float)
        Middle line, world frame, metres.
    height_m, thickness_m : float
        Height where it still stands, and thickness, metres.
    decay : float
        How much of its height is lost at the worst places, 0 to 1.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: Line
    height_m: Length = 3.0
    thickness_m: Length = 0.7
    decay: Annotated[float, Field(ge=0, le=1)] = 0.6


def build_house(site: Site, house: House) -> Deck:
    """Put up a house: battered parapet, door, small windows, beam ends, and steps to the roof."""
    depth, width, height = house.size_m
    frame = Frame(*house.at, house.yaw_deg)
    plan, terrace = house.area(), house.roof()
    z = min(site.ground_z(float(x), float(y)) for x, y in shapely.get_coordinates(plan))
    rng = site.rng_for("house", house.name)
    top = z + height
    parts: list[tuple[str, Mesh]] = [
        (house.wall, slab(plan, z - 0.5, top)),
        (house.wall, slab(plan.difference(terrace), top, top + _PARAPET_M)),
        ("dirt:#b08a5e", slab(terrace.buffer(-0.01), top - 0.02, top + 0.01)),
    ]
    front = depth / 2 + 0.02

    def put(body: Mesh, u: float, v: float, up: float) -> Mesh:
        return translated(rotated(body, rotation(0.0, 0.0, house.yaw_deg)), (*frame.at(u, v), z + up))

    door = float(rng.choice(["-1", "1"])) * 0.18 * width
    paint = str(rng.choice(["planks:#6a4a30", "planks:#2f6a78", "planks:#7a3c2c"]))
    parts += [
        (paint, put(box(size=(0.08, 1.1, 2.0)), front, door, 0.0)),
        ("wood:#6b4a30", put(box(size=(0.24, 1.7, 0.2)), front, door, 2.0)),
    ]
    for v in np.linspace(-0.38, 0.38, max(int(width // 2.2), 2)) * width:
        if abs(v - door) > 1.1:
            parts.append(("#3a2c20", put(box(size=(0.06, 0.55, 0.7)), front, float(v), 1.2)))
            parts.append(("wood:#6b4a30", put(box(size=(0.12, 0.85, 0.12)), front, float(v), 1.9)))
            if height > 5.0:
                parts.append(("#3a2c20", put(box(size=(0.06, 0.55, 0.8)), front, float(v), 4.1)))
    for v in np.arange(-width / 2 + 0.6, width / 2 - 0.4, 0.9):
        beam = rotated(cylinder(radius=0.1, height=0.55, segments=6), rotation(0.0, 90.0, 0.0))
        parts.append(("wood:#7a5838", put(beam, front - 0.1, float(v), height - 0.45)))
    parts += [(house.wall, put(box(size=(0.8, 0.45, 0.45)), a, b, height + _PARAPET_M))
              for a, b in ((depth / 2 - 0.4, width / 2 - 0.23), (depth / 2 - 0.4, 0.23 - width / 2))]  # fmt: skip
    steps = int(height / 0.32)
    for k in range(steps):
        u = -depth / 2 + 0.3 + k * 0.3
        if u < depth / 2 - 0.3:
            parts.append((house.wall, put(box(size=(0.3, 0.9, 0.32 * (k + 1))), u, width / 2 + 0.46, 0.0)))
    footprint = plan.union(_stair_plan(frame, depth, width))
    site.add(None, "mudbrick_house", parts, footprint=footprint.buffer(0.1))
    return Deck(terrace, top + 0.01)


def build_wall(site: Site, wall: Wall, material: str, key: int) -> None:
    """Put up a ruined wall: what is left of it rises and falls along its way."""
    rng = site.rng_for("wall", key)
    parts: list[tuple[str, Mesh]] = []
    for (ax, ay), (bx, by) in zip(wall.path[:-1], wall.path[1:], strict=True):
        length = float(np.hypot(bx - ax, by - ay))
        n = max(int(length / 1.1), 2)
        left = wall.height_m * (1.0 - wall.decay * rng.random(n + 1) ** 1.5)
        foot = min(site.ground_z(ax + (bx - ax) * t, ay + (by - ay) * t) for t in np.linspace(0, 1, n + 1)) - 0.5
        base = [site.ground_z(ax + (bx - ax) * t, ay + (by - ay) * t) for t in np.linspace(0, 1, n + 1)]
        crest: list[tuple[float, float]] = []
        for k in range(n):
            # Courses break off in steps.
            h = max(base[k], base[k + 1]) + float(left[k]) - foot
            crest += [(length * k / n, h), (length * (k + 0.96) / n, h)]
        outline = [(0.0, 0.0), (length, 0.0), (length, crest[-1][1]), *crest[::-1]]
        body = profile(points=outline, width=wall.thickness_m)
        yaw = float(np.degrees(np.arctan2(by - ay, bx - ax)))
        parts.append((material, translated(rotated(body, rotation(0.0, 0.0, yaw)), (ax, ay, foot))))
    area = LineString(wall.path).buffer(wall.thickness_m / 2 + 0.2, cap_style="flat")
    site.add(None, "ruin_wall", parts, footprint=area)


def wall_area(wall: Wall) -> shapely.Polygon:
    """Plan of a ruined wall, world frame, metres."""
    return LineString(wall.path).buffer(wall.thickness_m / 2 + 0.2, cap_style="square")


def _stair_plan(frame: Frame, depth: float, width: float) -> shapely.Polygon:
    half = rectangle(-depth / 2, width / 2, depth / 2, width / 2 + 1.0)
    return shapely.Polygon([frame.at(float(u), float(v)) for u, v in shapely.get_coordinates(half)])
