"""Huts: thatched ones on stilts, boathouses, racks for fish; cabins of cold country; mud-brick houses and ruins."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.geometry.portable import power
from aerialdojo_gen.scenes.grammar import Frame, leg, slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.buildings import Roof, pitched_roof, put_up_building
from aerialdojo_gen.scenes.kit.quays import bars
from aerialdojo_gen.scenes.kit.structures import block, columns, stairs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import At, Line, Material, Materials, Number, Positive
from aerialdojo_gen.scenes.shapes import box, cylinder, profile, sweep
from aerialdojo_gen.scenes.site import Site

_Pose = tuple[Number, Number, Number]


@site_builder
def stilt_huts(
    site: Site, *, at: list[_Pose], walls: Materials, on: Number | None = None, width_m: Number = 5.0,
    depth_m: Number = 4.4, porch_m: Number = 1.8, roof: Material = "thatch", trim: Material = "#e9dcc0",
    steps: bool = True,
) -> None:  # fmt: skip
    """Put up thatched huts on stilts, each with a porch in front and steps down from it, of the walls in turn.

    `at` gives the middle of the room and where the door looks; the floor is at `on`, or 0.9 m above the ground.
    """
    d, w, front = depth_m / 2, width_m / 2, depth_m / 2 + porch_m
    for number, (x, y, yaw_deg) in enumerate(at):
        frame, wall = Frame(x, y, yaw_deg), walls[number % len(walls)]
        floor = site.ground_z(x, y) + 0.9 if on is None else on
        ground = min(site.ground_z(*frame.at(u, v)) for u in (-d, front) for v in (-w, w))
        feet = [(u, v) for u in (-d + 0.2, 0.0, d, front - 0.15) for v in (-w + 0.2, w - 0.2)]
        parts: Parts = [
            ("boards:#b0956a", block(-d - 0.1, -w - 0.1, front, w + 0.1, floor - 0.16, floor)),
            ("logs:#7a6248", columns(feet, ground - 0.8, floor - 0.16, 0.13, 7)),
            *_room(d, w, front, floor, wall, roof, trim),
        ]
        plan = rectangle(-d - 0.2, -w - 0.2, front + 0.1, w + 0.2)
        if steps:
            foot = front + 0.9 * (floor - ground) + 0.3
            base = site.ground_z(*frame.at(foot, 0.0))
            parts += stairs((foot, 0.0), 180.0, 1.3, floor - base, foot - front, z_m=base, tread="planks",
                            stringer="wood")  # fmt: skip
            plan = plan.union(rectangle(front, -0.8, foot, 0.8))
        site.add(None, "thatched_hut", frame.parts(parts), footprint=frame.area(plan))


def _room(d: float, w: float, front: float, z: float, wall: str, roof: str, trim: str) -> Parts:
    head = z + 2.3
    parts: Parts = [
        (wall, block(-d, -w, d, w, z, head)),
        ("planks:#6f5238", block(d, -0.5, d + 0.06, 0.5, z, z + 1.95)),
        (trim, block(d - 0.02, -0.62, d + 0.04, 0.62, z, z + 2.08)),
        ("logs:#7a6248", columns([(front - 0.15, -w + 0.2), (front - 0.15, w - 0.2)], z, head + 0.1, 0.07, 6)),
    ]
    u = -0.4 * d
    shutters = [block(u - 0.55, s * w - 0.05, u + 0.55, s * w + 0.05, z + 0.85, z + 1.75) for s in (-1, 1)]
    shutters += [
        block(d - 0.02, s * 0.62 * w - 0.45, d + 0.05, s * 0.62 * w + 0.45, z + 0.85, z + 1.75) for s in (-1, 1)
    ]
    parts.append(("window", merge(shutters)))
    parts += pitched_roof(rectangle(-d, -w, front, w), head, 1.9, wall, roof, hip=True, overhang_m=0.6)
    parts += bars([(front - 0.06, -w), (front - 0.06, -0.8)], z, "wood", 0.85)
    parts += bars([(front - 0.06, 0.8), (front - 0.06, w)], z, "wood", 0.85)
    for s in (-1, 1):
        parts += bars([(d + 0.1, s * w), (front - 0.06, s * w)], z, "wood", 0.85)
    return parts


@site_builder
def boathouses(
    site: Site, *, at: list[_Pose], walls: Materials, on: Number, width_m: Number = 4.6, depth_m: Number = 7.0,
    roof: Material = "shingles:#55504c", trim: Material = "#efe9dc",
) -> None:  # fmt: skip
    """Put up boathouses whose open fronts look over the water: three walls, a gable roof, posts below the floor."""
    d, w, head = depth_m / 2, width_m / 2, on + 2.6
    for number, pose in enumerate(at):
        frame, wall = Frame(*pose), walls[number % len(walls)]
        ground = min(site.ground_z(*frame.at(u, v)) for u in (-d, d) for v in (-w, w))
        feet = [(u, v) for u in (-d + 0.2, 0.0, d + 0.5) for v in (-w + 0.2, w - 0.2)]
        sides = (-1, 1)
        parts: Parts = [
            ("boards:#8c7a60", block(-d, -w, d + 0.8, w, on - 0.18, on)),
            ("logs:#5f4f3e", columns(feet, min(ground, 0.0) - 0.8, on - 0.18, 0.15, 7)),
            (wall, merge([block(-d, -w, d, -w + 0.14, on, head), block(-d, w - 0.14, d, w, on, head),
                          block(-d, -w + 0.14, -d + 0.14, w - 0.14, on, head)])),
            (trim, merge([block(d - 0.1, s * w - 0.1, d + 0.06, s * w + 0.1, on, head) for s in sides])),
            (trim, merge([block(-0.6, s * w - 0.04, 0.6, s * w + 0.04, on + 0.9, on + 1.9) for s in sides])),
            ("window", merge([block(-0.5, s * w - 0.06, 0.5, s * w + 0.06, on + 1.0, on + 1.8) for s in sides])),
        ]  # fmt: skip
        parts += pitched_roof(rectangle(-d, -w, d, w), head, 1.8, wall, roof, overhang_m=0.4)
        plan = rectangle(-d, -w, d + 0.8, w)
        site.add(None, "boathouse", frame.parts(parts), footprint=frame.area(plan))


@site_builder
def drying_racks(
    site: Site, *, at: list[_Pose], length_m: Annotated[Number, Field(ge=0.8, le=100)], fish: Material = "#b8a58a"
) -> None:
    """Put up racks of trestles and poles, 3 m high, with fish hung up to dry; one can fly through below."""
    half, high = length_m / 2, 2.9
    wood = [sweep(path=[(u, s * 1.2, -0.3), (u, -s * 0.15, high + 0.2)], radius=0.06, sides=5)
            for u in (-half, 0.0, half) for s in (-1, 1)]  # fmt: skip
    wood += [sweep(path=[(-half - 0.4, v, h), (half + 0.4, v, h)], radius=0.045, sides=5)
             for v, h in ((0.0, high), (-0.45, 2.1), (0.45, 2.1))]  # fmt: skip
    hung = [
        translated(box(size=(0.05, 0.14, 0.42), taper=(1.0, 0.4)), (-half + (k + 0.5) * 0.4, v, 2.1 - 0.44))
        for k in range(int(length_m / 0.4))
        for v in (-0.45, 0.45)
    ]
    parts: Parts = [("wood:#8d8171", merge(wood)), (fish, merge(hung))]
    plan = rectangle(-half - 0.4, -1.3, half + 0.4, 1.3)
    for pose in at:
        frame = Frame(*pose)
        z = site.ground_z(frame.x, frame.y)
        site.add(None, "drying_rack", frame.parts(parts, z), footprint=frame.area(plan))


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
        form = Roof(roof, "gable", 0.32 * min(depth, width), overhang_m=0.7)
        extra = cabin.frame.parts(_front(depth, width), z)
        put_up_building(site, cabin.plan(), cabin.wall, form, height, z=z, category="hut", extra=extra)


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
    across = np.linspace(-v + 0.4, v - 0.4, max(int(width // 3), 2)).tolist()
    feet = [(a, b) for a in (-u + 0.3, 0.0, u - 0.3, u + 2.2) for b in across]
    parts.append(("steel", columns(feet, -_STILT_M - 0.8, 0.0, 0.1, 6)))
    rail = [(u, -v, _RAIL_M), (u + 2.35, -v, _RAIL_M), (u + 2.35, v - 1.4, _RAIL_M)]
    parts.append(("#e9b52a", sweep(path=rail, radius=0.04, sides=5)))
    posts = [*((x, y) for x, y, _ in rail), (u + 2.35, 0.0), (u + 2.35, v)]
    parts.append(("#e9b52a", columns(posts, 0.0, _RAIL_M, 0.035, 5)))
    step = box(size=(0.28, 1.2, 0.06))
    parts += [("steel", translated(step, (u + 2.55 + 0.28 * k, v - 0.7, -0.26 * (k + 1)))) for k in range(5)]
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


_PARAPET_M = 0.45


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
    deep, wide = depth / 2, width / 2
    plan, terrace, stair = (
        Polygon([frame.at(a, b) for a, b in ((-x, low), (x, low), (x, high), (-x, high))])
        for x, low, high in ((deep, -wide, wide), (deep - 0.3, 0.3 - wide, wide - 0.3), (deep, wide, wide + 1.0))
    )
    z = min(site.ground_z(float(x), float(y)) for x, y in shapely.get_coordinates(plan))
    rng = site.rng_for("house", house.name)
    top = z + height
    parts: Parts = [
        (wall, slab(plan, z - 0.5, top)),
        (wall, slab(plan.difference(terrace), top, top + _PARAPET_M)),
        ("dirt:#b08a5e", slab(terrace.buffer(-0.01), top - 0.02, top + 0.01)),
    ]
    front = depth / 2 + 0.02

    def placed(body: Mesh, u: float, v: float, up: float) -> Mesh:
        return posed(body, rotation(0.0, 0.0, yaw_deg), (*frame.at(u, v), z + up))

    door = float(rng.choice(["-1", "1"])) * 0.18 * width
    paint = str(rng.choice(["planks:#6a4a30", "planks:#2f6a78", "planks:#7a3c2c"]))
    parts += [
        (paint, placed(box(size=(0.08, 1.1, 2.0)), front, door, 0.0)),
        ("wood:#6b4a30", placed(box(size=(0.24, 1.7, 0.2)), front, door, 2.0)),
    ]
    for v in np.linspace(-0.38, 0.38, max(int(width // 2.2), 2)) * width:
        if abs(v - door) > 1.1:
            parts.append(("#3a2c20", placed(box(size=(0.06, 0.55, 0.7)), front, float(v), 1.2)))
            parts.append(("wood:#6b4a30", placed(box(size=(0.12, 0.85, 0.12)), front, float(v), 1.9)))
            if height > 5.0:
                parts.append(("#3a2c20", placed(box(size=(0.06, 0.55, 0.8)), front, float(v), 4.1)))
    beam = rotated(cylinder(radius=0.1, height=0.55, segments=6), rotation(0.0, 90.0, 0.0))
    beams_at = np.arange(-width / 2 + 0.6, width / 2 - 0.4, 0.9).tolist()
    parts += [("wood:#7a5838", placed(beam, front - 0.1, v, height - 0.45)) for v in beams_at]
    parts += [(wall, placed(box(size=(0.8, 0.45, 0.45)), a, b, height + _PARAPET_M))
              for a, b in ((depth / 2 - 0.4, width / 2 - 0.23), (depth / 2 - 0.4, 0.23 - width / 2))]  # fmt: skip
    for k in range(int(height / 0.32)):
        u = -depth / 2 + 0.3 + k * 0.3
        if u < depth / 2 - 0.3:
            parts.append((wall, placed(box(size=(0.3, 0.9, 0.32 * (k + 1))), u, width / 2 + 0.46, 0.0)))
    site.add(None, "mudbrick_house", parts, footprint=plan.union(stair).buffer(0.1))
    return top + 0.01


@dataclass(frozen=True)
class CrumblingWall:
    """What is left of a wall."""

    line: Line
    height_m: Annotated[Number, Field(gt=0, le=100)] = 3.0  # Where it still stands
    decay: Annotated[Number, Field(ge=0, le=1)] = 0.6  # How much of its height is lost at the worst places
    thickness_m: Positive = 0.7


@site_builder
def crumbling_walls(site: Site, *, walls: list[CrumblingWall], material: Material) -> None:
    """Put up ruined walls, whose tops rise and fall in steps, as courses break off."""
    for k, wall in enumerate(walls):
        _crumbling_wall(site, wall, material, site.rng_for("wall", k))


def _crumbling_wall(site: Site, wall: CrumblingWall, material: str, rng: np.random.Generator) -> None:
    parts: Parts = []
    for (ax, ay), (bx, by) in pairwise(wall.line):
        length, yaw = leg((ax, ay), (bx, by))
        n = max(int(length / 1.1), 2)
        left = wall.height_m * (1.0 - wall.decay * power(rng.random(n + 1), 1.5))
        base = [site.ground_z(ax + (bx - ax) * t, ay + (by - ay) * t) for t in np.linspace(0, 1, n + 1)]
        foot = min(base) - 0.5
        crest: list[tuple[float, float]] = []
        for k in range(n):
            h = max(base[k], base[k + 1]) + float(left[k]) - foot
            crest += [(length * k / n, h), (length * (k + 0.96) / n, h)]
        outline = [(0.0, 0.0), (length, 0.0), (length, crest[-1][1]), *crest[::-1]]
        body = profile(points=outline, width=wall.thickness_m)
        parts.append((material, posed(body, rotation(0.0, 0.0, yaw), (ax, ay, foot))))
    area = LineString(wall.line).buffer(wall.thickness_m / 2 + 0.2, cap_style="flat")
    site.add(None, "ruin_wall", parts, footprint=area)
