"""Parking: rows of marked bays, vehicles in them, and car parks of several levels, open at their sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import Pose, slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.buildings import wall_with_openings
from aerialdojo_gen.scenes.kit.streets import parking_row
from aerialdojo_gen.scenes.kit.structures import Point, block, columns, deck, letters, parapet, ramp, stairs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge
from aerialdojo_gen.scenes.placement import DRAWN, Placement
from aerialdojo_gen.scenes.plans.values import At, Box, Material, Materials, Number
from aerialdojo_gen.scenes.site import Site

# What people come in, and how often.
VEHICLES = {
    "sedan": 0.34, "hatchback": 0.3, "suv": 0.2, "pickup_truck": 0.09, "delivery_van": 0.04, "motorcycle": 0.03,
}  # fmt: skip
_RAMP_M = 4.4
_Share = Annotated[Number, Field(ge=0, le=1)]
_Count = Annotated[int, Field(ge=1, le=200)]
_Levels = Annotated[int, Field(ge=2, le=3)]
_Row = tuple[Number, Number, Number, _Count]
# How much the proportions of vehicles differ beside their designs, as a share: 0 in scenes that were drawn before.
_Differ = Annotated[Number, Field(ge=0, le=0.1)]
_Weights = Annotated[dict[str, Annotated[float, Field(gt=0)]], Field(min_length=1)]


@site_builder
def parking_rows(
    site: Site, *, rows: list[_Row], bay_m: tuple[Number, Number] = (2.6, 5.2), material: Material = "marking",
    marks: bool = True, occupancy: _Share = 0.0, phrase: str = "", on: Number | None = None,
    vehicles: _Weights = VEHICLES, differ: _Differ = 0.0,
) -> None:  # fmt: skip
    """Mark rows of parking bays, and park vehicles in a share of them.

    A row is (x, y, yaw_deg, count): the middle of its closed side, the direction towards it, and the number of bays
    of (width, depth). Vehicles are categories and how often they come; their proportions differ by a share of
    `differ` from their designs. `on` is the floor's height, the ground's by default, and above it no bays are marked.
    """
    bays: list[Pose] = []
    for x, y, yaw_deg, count in rows:
        floor = on if marks else 0.0
        bays += parking_row(site, x, y, yaw_deg, count, bay_m=bay_m, z=floor, material=material)
    park_cars(site, bays, occupancy, phrase, z=on, kinds=vehicles, differ=differ)


@site_builder
def slanted_bays(
    site: Site, *, rows: list[tuple[Number, Number, bool, _Count]], slant_deg: Number = 60.0, pitch_m: Number = 3.1,
    depth_m: Number = 5.0, occupancy: _Share = 0.0, phrase: str = "", vehicles: _Weights = VEHICLES,
    differ: _Differ = 0.0,
) -> None:  # fmt: skip
    """Mark slanted bays along x from a point eastwards, and park vehicles in a share of them.

    A row is (x, y, north, count): the west end of its open side, whether the vehicles face north, and the number of
    bays, `slant_deg` from the row's direction and `pitch_m` apart along it.
    """
    c = np.cos(np.radians(slant_deg)) * depth_m
    bays = []
    for x0, y, north, count in rows:
        up = 1 if north else -1
        for k in range(count + 1):
            x, far = x0 + k * pitch_m, y + up * depth_m
            site.paint(Polygon([(x, y), (x + 0.16, y), (x + 0.16 + c, far), (x + c, far)]), "marking")
            if k < count:
                bays.append(Pose(x + (pitch_m + c) / 2, y + up * depth_m / 2, up * slant_deg))
    park_cars(site, bays, occupancy, phrase, kinds=vehicles, differ=differ)


def park_cars(
    site: Site, bays: Sequence[Pose], occupancy: float, place: str, *, z: float | None = None,
    kinds: Mapping[str, float] = VEHICLES, differ: float = 0.0,
) -> None:  # fmt: skip
    """Park vehicles in a share of bays (middle, and the way in), some backwards and none quite straight."""
    names, weights = list(kinds), np.array(list(kinds.values()))
    for bay in bays:
        rng = site.rng_for("bay", round(bay.x, 2), round(bay.y, 2), z)
        if rng.random() >= occupancy:
            continue
        category = names[int(np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random(), side="right"))]
        yaw = bay.yaw_deg + (180.0 if rng.random() < 0.25 else 0.0) + rng.uniform(-2.0, 2.0)
        shift = rng.uniform(-0.15, 0.15)
        car = Placement(category, bay.x + shift, bay.y - shift, yaw, DRAWN, z, attributes={"place": place})
        if differ:
            x, y, z_ = np.round(rng.uniform(1.0 - differ, 1.0 + differ / 2, 3), 3).tolist()
            car = replace(car, stretch=(x, y, z_))
        site.place(car, "skip")


@site_builder
def parking_deck(
    site: Site, *, box: Box, levels: _Levels = 3, level_m: Number = 3.7,
    wall: Material = "concrete:#c9c2b4", floor: Material = "concrete:#8f8d88", band: Material = "#2f8f8b",
    tower: Material = "tiles:#2f8f8b", phrase: str = "",
) -> float:  # fmt: skip
    """Build a parking deck with ramps at its east and north sides; gives the height of its highest floor, metres.

    The box is the outline of its floors, the ground and the roof among the `levels`; ramps stand outside it, a stair
    tower at its south-west corner. Slab and beam are 0.4 m of a level; the band is a stripe along the edges of the
    floors.
    """
    x0, y0, x1, y1 = box
    plan = rectangle(*box)
    heights = tuple(k * level_m for k in range(levels))
    grid = [(x, y) for x in np.linspace(x0 + 0.6, x1 - 0.6, 5) for y in np.linspace(y0 + 0.6, y1 - 0.6, 4)]
    parts: Parts = []
    lines = []
    site.paint(plan.buffer(0.3), "asphalt")
    parking_rows(site, rows=_rows(*box))
    for k, z in enumerate(heights[1:], 1):
        parts += deck(plan, z, floor=floor, under=wall, thickness_m=0.4)
        parts.append((wall, parapet(plan, z, 0.95, _ramp_mouths(x0, y0, x1, y1, k))))
        stripe = plan.exterior.buffer(0.08, join_style="mitre", cap_style="flat")
        parts.append((band, slab(stripe, z - 0.42, z - 0.02)))
        parts.append((wall, columns(grid, heights[k - 1], z - 0.4, 0.3)))
        for row in _rows(*box):
            lines += _deck_lines(*row, z)
    parts.append(("marking", merge(lines)))
    parts += _ramps(x0, y0, x1, y1, heights, floor, wall)
    parts += _stair_tower((x0, y0), heights, tower)
    site.add("parking_deck", "parking_deck", parts, {"place": phrase})
    return heights[-1]


@site_builder
def deck_cars(
    site: Site, *, box: Box, levels: _Levels = 3, level_m: Number = 3.7, occupancy: _Share,
    vehicles: _Weights = VEHICLES, differ: _Differ = 0.0,
) -> None:  # fmt: skip
    """Park vehicles in a share of the bays of a parking deck, which has the same `box` and levels."""
    for k in range(levels):
        name = "ground floor" if k == 0 else "roof" if k == levels - 1 else "middle floor"
        parking_rows(site, rows=_rows(*box), marks=False, occupancy=occupancy, on=k * level_m if k else None,
                     phrase=f"on the {name} of the parking deck", vehicles=vehicles, differ=differ)  # fmt: skip


def _rows(x0: float, y0: float, x1: float, y1: float) -> list[_Row]:
    """Two rows along the long walls, and a double one in the middle; aisles of six metres between them."""
    width = x1 - x0
    count = int((width - 9.0) // 2.6)
    middle = (y0 + y1) / 2
    x = x0 + 6.5 + count * 1.3
    double = [(x, middle, yaw_deg, count - 1) for yaw_deg in (90.0, -90.0)]
    return [(x, y0 + 0.7, -90.0, count), (x, y1 - 0.7, 90.0, count), *double]


def _deck_lines(x: float, y: float, yaw_deg: float, count: int, z: float) -> list[Mesh]:
    """A centimetre over the slab: painted lines would flicker in it."""
    low, high = (y - 5.0, y) if yaw_deg > 0 else (y, y + 5.0)
    along = [x - count * 2.6 / 2 + k * 2.6 for k in range(count + 1)]
    return [block(u - 0.07, low, u + 0.07, high, z, z + 0.012) for u in along]


def _ramp_mouths(x0: float, y0: float, x1: float, y1: float, level: int) -> list[BaseGeometry]:
    east_end = rectangle(x1 - 1, y1 - _RAMP_M - 1.0, x1 + 1, y1 - 0.5)
    north_foot = rectangle(x1 - _RAMP_M - 1.0, y1 - 1, x1 - 0.5, y1 + 1)
    north_head = rectangle(x0 + 0.5, y1 - 1, x0 + _RAMP_M + 1.0, y1 + 1)
    stair = rectangle(x0 - 1, y0 + 1.0, x0 + 1, y0 + 4.0)
    return [stair, *([east_end, north_foot] if level == 1 else [north_head])]


def _ramps(x0: float, y0: float, x1: float, y1: float, heights: tuple[float, ...], floor: str, wall: str) -> Parts:
    half = _RAMP_M / 2
    # The head turns in over a landing as wide as the ramp.
    head = y1 - _RAMP_M - 1.0
    parts = ramp((x1 + half + 0.3, y0), (x1 + half + 0.3, head), 0.0, heights[1], _RAMP_M, floor=floor, wall=wall)
    landing = rectangle(x1, head, x1 + _RAMP_M + 0.5, y1)
    parts += deck(landing, heights[1], floor=floor, under=wall, posts=[(x1 + _RAMP_M, y1 - 0.5)], post=wall)
    parts.append((wall, block(x1 + _RAMP_M + 0.3, head, x1 + _RAMP_M + 0.5, y1, heights[1], heights[1] + 0.95)))
    parts.append((wall, block(x1, y1 - 0.2, x1 + _RAMP_M + 0.3, y1, heights[1], heights[1] + 0.95)))
    if len(heights) > 2:
        foot, end = x1 - _RAMP_M - 1.0, x0 + _RAMP_M + 1.0
        y = y1 + half + 0.3
        parts += ramp((foot, y), (end, y), heights[1], heights[2], _RAMP_M, floor=floor, wall=wall)
        low = rectangle(foot, y1, x1, y1 + _RAMP_M + 0.5)
        high = rectangle(x0, y1, end, y1 + _RAMP_M + 0.5)
        for plan, z, corner in ((low, heights[1], x1 - 0.5), (high, heights[2], x0 + 0.5)):
            parts += deck(plan, z, floor=floor, under=wall, posts=[(corner, y1 + _RAMP_M)], post=wall)
            parts.append((wall, parapet(plan, z, 0.95, _inner(plan, y1))))
    return parts


def _inner(plan: BaseGeometry, y1: float) -> list[BaseGeometry]:
    x0, _, x1, top = plan.bounds
    return [rectangle(x0 - 1, y1 - 1, x1 + 1, y1 + 0.25), rectangle(x0 - 0.1, y1, x0 + 0.3, top - 0.25),
            rectangle(x1 - 0.3, y1, x1 + 0.1, top - 0.25)]  # fmt: skip


def _stair_tower(corner: Point, heights: tuple[float, ...], tower: str) -> Parts:
    x, y = corner
    top = heights[-1] + 3.2
    parts: Parts = [
        (tower, block(x - 4.4, y, x - 4.1, y + 6.0, 0.0, top)),
        (tower, block(x - 4.1, y, x - 0.4, y + 0.3, 0.0, top)),
        ("concrete", block(x - 4.6, y - 0.2, x + 0.2, y + 6.2, top, top + 0.25)),
        ("marking", letters("P", 2.4, (x - 2.3, y, top - 3.2), -90.0)),
        ("marking", letters("P", 2.4, (x - 4.4, y + 3.0, top - 3.2), 180.0)),
        ("iron", columns([(x - 0.5, y + 5.8), (x - 4.2, y + 5.8)], 0.0, top, 0.12)),
    ]
    for a, b in pairwise(heights):
        parts += deck(rectangle(x - 4.1, y + 0.3, x, y + 3.9), b, floor="concrete", thickness_m=0.25)
        parts += stairs((x - 2.2, y + 9.9), -90.0, 1.8, b - a, 6.0, z_m=a)
    return parts


@site_builder
def lockup_garages(
    site: Site, *, at: At, count: _Count, doors: Materials,
    open_doors: list[int] = [], bay_m: tuple[Number, Number] = (3.4, 6.0), height_m: Number = 2.9,  # noqa: B006
    wall: Material = "brick:#a5664e", roof: Material = "sheet_metal:#70787a", phrase: str = "",
) -> float:  # fmt: skip
    """Put up a row of lock-up garages along x, their doors to the south; gives the height of their roof, metres.

    `at` is their south-west corner; doors take the materials in turn, and one can fly in by those that are open,
    counted from 0; a bay is (width, depth).
    """
    (x0, y0), (width, depth), high = at, bay_m, height_m
    x1, back = x0 + count * width, y0 + depth
    gaps = [(k * width + 0.35, (k + 1) * width - 0.35, 0.0, high - 0.5) for k in range(count)]
    parts: Parts = [
        (wall, wall_with_openings((x0, y0 + 0.12), (x1, y0 + 0.12), 0.0, high, gaps, 0.24)),
        (wall, block(x0, back - 0.24, x1, back, 0.0, high)),
        ("concrete", block(x0 - 0.25, y0 - 0.5, x1 + 0.25, back + 0.2, high, high + 0.25)),
        (roof, block(x0, y0 - 0.2, x1, back, high + 0.25, high + 0.32)),
    ]
    edges = [x0 + k * width for k in range(count + 1)]
    parts += [(wall, block(u - 0.12, y0 + 0.24, u + 0.12, back - 0.24, 0.0, high)) for u in edges]
    for k in range(count):
        a, b = x0 + k * width + 0.4, x0 + (k + 1) * width - 0.4
        slats = [block(a - 0.04, y0 + 0.06, b + 0.04, y0 + 0.16 + 0.04 * (i % 2), 0.02 + 0.4 * i, 0.4 + 0.4 * i)
                 for i in range(6)]  # fmt: skip
        rolled_up = block(a, y0 + 0.3, b, y0 + 2.6, high - 0.44, high - 0.36)
        parts.append((doors[k % len(doors)], rolled_up if k in open_doors else merge(slats)))
    site.add("lockup_garages", "garages", parts, {"place": phrase})
    site.occupy(rectangle(x0 - 0.3, y0 + 0.3, x1 + 0.3, back), high - 0.4, high + 0.3)
    return high + 0.32
