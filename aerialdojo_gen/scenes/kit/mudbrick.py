"""Mud-brick houses with roof terraces, and crumbling walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString

from aerialdojo_gen.geometry.portable import power
from aerialdojo_gen.scenes.grammar_frames import Frame, Parts
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.mesh import Mesh, posed, rotated, rotation
from aerialdojo_gen.scenes.plans.values import At, Line, Material, Number
from aerialdojo_gen.scenes.shapes import box, cylinder
from aerialdojo_gen.scenes.shapes_extruded import profile
from aerialdojo_gen.scenes.site import Site

_PARAPET_M = 0.45
_Side = Annotated[Number, Field(ge=2, le=100)]


@dataclass(frozen=True)
class MudbrickHouse:
    """A house with a flat roof."""

    at: At
    name: str  # Of its random stream
    yaw_deg: Number = 0.0  # Where its door looks
    size_m: tuple[_Side, _Side, _Side] = (6.0, 7.0, 3.4)  # Depth, width and height
    wall: Material = "plaster:#c2966a"


@site_builder
def mudbrick_houses(site: Site, *, houses: list[MudbrickHouse]) -> list[float]:
    """Put up houses with a parapet, small windows, beam ends, and steps to the roof; gives the roofs' heights."""
    return [_mudbrick_house(site, house) for house in houses]


def _mudbrick_house(site: Site, house: MudbrickHouse) -> float:
    (depth, width, height), yaw_deg, wall = house.size_m, house.yaw_deg, house.wall
    frame = Frame(*house.at, yaw_deg)
    plan, terrace = _plan(frame, depth, width, 0.0), _plan(frame, depth, width, -0.3)
    z = min(site.ground_z(float(x), float(y)) for x, y in shapely.get_coordinates(plan))
    rng = site.rng_for("house", house.name)
    top = z + height
    parts: Parts = [
        (wall, slab(plan, z - 0.5, top)),
        (wall, slab(plan.difference(terrace), top, top + _PARAPET_M)),
        ("dirt:#b08a5e", slab(terrace.buffer(-0.01), top - 0.02, top + 0.01)),
    ]
    front = depth / 2 + 0.02

    def put(body: Mesh, u: float, v: float, up: float) -> Mesh:
        return posed(body, rotation(0.0, 0.0, yaw_deg), (*frame.at(u, v), z + up))

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
    parts += [(wall, put(box(size=(0.8, 0.45, 0.45)), a, b, height + _PARAPET_M))
              for a, b in ((depth / 2 - 0.4, width / 2 - 0.23), (depth / 2 - 0.4, 0.23 - width / 2))]  # fmt: skip
    steps = int(height / 0.32)
    for k in range(steps):
        u = -depth / 2 + 0.3 + k * 0.3
        if u < depth / 2 - 0.3:
            parts.append((wall, put(box(size=(0.3, 0.9, 0.32 * (k + 1))), u, width / 2 + 0.46, 0.0)))
    footprint = plan.union(_stair_plan(frame, depth, width))
    site.add(None, "mudbrick_house", parts, footprint=footprint.buffer(0.1))
    return top + 0.01


@dataclass(frozen=True)
class CrumblingWall:
    """What is left of a wall."""

    line: Line
    height_m: Annotated[Number, Field(gt=0, le=100)] = 3.0  # Where it still stands
    decay: Annotated[Number, Field(ge=0, le=1)] = 0.6  # How much of its height is lost at the worst places
    thickness_m: Annotated[Number, Field(gt=0)] = 0.7


@site_builder
def crumbling_walls(site: Site, *, walls: list[CrumblingWall], material: Material) -> None:
    """Put up ruined walls, whose tops rise and fall in steps, as courses break off."""
    for k, wall in enumerate(walls):
        _crumbling_wall(site, wall, material, site.rng_for("wall", k))


def _crumbling_wall(site: Site, wall: CrumblingWall, material: str, rng: np.random.Generator) -> None:
    parts: Parts = []
    for (ax, ay), (bx, by) in pairwise(wall.line):
        length = float(np.hypot(bx - ax, by - ay))
        n = max(int(length / 1.1), 2)
        left = wall.height_m * (1.0 - wall.decay * power(rng.random(n + 1), 1.5))
        foot = min(site.ground_z(ax + (bx - ax) * t, ay + (by - ay) * t) for t in np.linspace(0, 1, n + 1)) - 0.5
        base = [site.ground_z(ax + (bx - ax) * t, ay + (by - ay) * t) for t in np.linspace(0, 1, n + 1)]
        crest: list[tuple[float, float]] = []
        for k in range(n):
            h = max(base[k], base[k + 1]) + float(left[k]) - foot
            crest += [(length * k / n, h), (length * (k + 0.96) / n, h)]
        outline = [(0.0, 0.0), (length, 0.0), (length, crest[-1][1]), *crest[::-1]]
        body = profile(points=outline, width=wall.thickness_m)
        yaw = math.degrees(math.atan2(by - ay, bx - ax))
        parts.append((material, posed(body, rotation(0.0, 0.0, yaw), (ax, ay, foot))))
    area = LineString(wall.line).buffer(wall.thickness_m / 2 + 0.2, cap_style="flat")
    site.add(None, "ruin_wall", parts, footprint=area)


def _plan(frame: Frame, depth: float, width: float, out_m: float) -> shapely.Polygon:
    u, v = depth / 2 + out_m, width / 2 + out_m
    return shapely.Polygon([frame.at(a, b) for a, b in ((-u, -v), (u, -v), (u, v), (-u, v))])


def _stair_plan(frame: Frame, depth: float, width: float) -> shapely.Polygon:
    half = rectangle(-depth / 2, width / 2, depth / 2, width / 2 + 1.0)
    return shapely.Polygon([frame.at(float(u), float(v)) for u, v in shapely.get_coordinates(half)])
