"""Parking of urban layouts: cars in marked bays, and a car park of several levels, open at its sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_scatter import Pose, slab
from aerialdojo_gen.scenes.grammar_streets import parking_row
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import (
    Parts,
    Point,
    block,
    columns,
    deck,
    letters,
    parapet,
    ramp,
    stairs,
)
from aerialdojo_gen.scenes.mesh import Mesh, merge
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.site import Site

# What people come in to a mall, and how often.
VEHICLES = {
    "sedan": 0.34, "hatchback": 0.3, "suv": 0.2, "pickup_truck": 0.09, "delivery_van": 0.04, "motorcycle": 0.03,
}  # fmt: skip
_RAMP_M = 4.4


def park_cars(
    site: Site,
    bays: Sequence[Pose],
    occupancy: float,
    place: str,
    *,
    z: float | None = None,
    kinds: dict[str, float] = VEHICLES,
) -> list[Instance]:
    """Park vehicles in bays, some of them backwards and none quite straight.

    Parameters
    ----------
    site : Site
        Where.
    bays : sequence of Pose
        Middles of the bays and the way in.
    occupancy : float
        Share of the bays that is taken, 0 to 1.
    place : str
        Goes into the vehicles' attributes, e.g. ``"in the car park"``.
    z : float, optional
        Height of the floor; the ground by default.
    kinds : dict of str to float
        Categories and their weights.
    """
    out = []
    names, weights = list(kinds), np.array(list(kinds.values()))
    for bay in bays:
        rng = site.rng_for("bay", round(bay.x, 2), round(bay.y, 2), z)
        if rng.random() >= occupancy:
            continue
        category = names[int(np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random(), side="right"))]
        yaw = bay.yaw_deg + (180.0 if rng.random() < 0.25 else 0.0) + rng.uniform(-2.0, 2.0)
        shift = rng.uniform(-0.15, 0.15)
        car = site.try_place(category, bay.x + shift, bay.y - shift, yaw, z=z, attributes={"place": place})
        if car is not None:
            out.append(car)
    return out


@dataclass(frozen=True)
class ParkingDeck:
    """A parking deck: where its floors are, and the bays on each.

    Attributes
    ----------
    levels_m : tuple of float
        Height of every floor, metres, the ground's first.
    bays : tuple of list of Pose
        Bays of every floor.
    """

    levels_m: tuple[float, ...]
    bays: tuple[list[Pose], ...]


def parking_deck(
    site: Site,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    *,
    levels: int = 3,
    level_m: float = 3.7,
    place: str = "east of the mall",
) -> ParkingDeck:
    """Build a parking deck with ramps along its east and north sides and a stair tower at its south-west corner.

    Parameters
    ----------
    site : Site
        Where.
    x0, y0, x1, y1 : float
        Outline of the floors, metres; ramps stand outside it.
    levels : int
        Number of floors, the ground's and the roof's among them.
    level_m : float
        From floor to floor; 0.4 m of it are slab and beam.
    place : str
        How a person says where it stands.
    """
    plan = rectangle(x0, y0, x1, y1)
    heights = tuple(k * level_m for k in range(levels))
    grid = [(x, y) for x in np.linspace(x0 + 0.6, x1 - 0.6, 5) for y in np.linspace(y0 + 0.6, y1 - 0.6, 4)]
    wall, floor = site.material("deck_wall", "concrete:#c9c2b4"), site.material("deck_floor", "concrete:#8f8d88")
    parts: Parts = []
    bays: list[list[Pose]] = []
    lines = []
    site.paint(plan.buffer(0.3), "asphalt")
    for k, z in enumerate(heights):
        if k:
            parts += deck(plan, z, floor=floor, under=wall, thickness_m=0.4)
            parts.append((wall, parapet(plan, z, 0.95, _ramp_mouths(x0, y0, x1, y1, k, levels))))
            stripe = plan.exterior.buffer(0.08, join_style="mitre", cap_style="flat")
            parts.append((site.material("deck_band", "#2f8f8b"), slab(stripe, z - 0.42, z - 0.02)))
            parts.append((wall, columns(grid, heights[k - 1], z - 0.4, 0.3)))
        rows = _rows(x0, y0, x1, y1)
        poses = []
        for x, y, yaw, count in rows:
            poses += parking_row(site, x, y, yaw, count, z=z if k else None)
            if k:
                lines += _deck_lines(x, y, yaw, count, z)
        bays.append(poses)
    parts.append(("marking", merge(lines)))
    parts += _ramps(x0, y0, x1, y1, heights, floor, wall)
    parts += _stair_tower(site, (x0, y0), heights)
    site.add("parking_deck", "parking_deck", parts, {"place": place})
    return ParkingDeck(heights, tuple(bays))


def _rows(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float, float, int]]:
    # Two rows along the long walls, and a double one in the middle; aisles of six metres between them.
    width = x1 - x0
    count = int((width - 9.0) // 2.6)
    middle = (y0 + y1) / 2
    x = x0 + 6.5 + count * 1.3
    return [
        (x, y0 + 0.7, -90.0, count),
        (x, y1 - 0.7, 90.0, count),
        (x, middle, 90.0, count - 1),
        (x, middle, -90.0, count - 1),
    ]


def _deck_lines(x: float, y: float, yaw_deg: float, count: int, z: float) -> list[Mesh]:
    # A centimetre over the slab: painted lines would flicker in it.
    sign = 1.0 if yaw_deg > 0 else -1.0
    half = count * 2.6 / 2
    out = []
    for k in range(count + 1):
        u = x - half + k * 2.6
        low, high = sorted((y, y - sign * 5.0))
        out.append(block(u - 0.07, low, u + 0.07, high, z, z + 0.012))
    return out


def _ramp_mouths(x0: float, y0: float, x1: float, y1: float, level: int, levels: int) -> list[BaseGeometry]:
    east_end = rectangle(x1 - 1, y1 - _RAMP_M - 1.0, x1 + 1, y1 - 0.5)
    north_foot = rectangle(x1 - _RAMP_M - 1.0, y1 - 1, x1 - 0.5, y1 + 1)
    north_head = rectangle(x0 + 0.5, y1 - 1, x0 + _RAMP_M + 1.0, y1 + 1)
    stair = rectangle(x0 - 1, y0 + 1.0, x0 + 1, y0 + 4.0)
    return [stair, *([east_end, north_foot] if level == 1 else [north_head])]


def _ramps(x0: float, y0: float, x1: float, y1: float, heights: tuple[float, ...], floor: str, wall: str) -> Parts:
    half = _RAMP_M / 2
    parts: Parts = []
    if len(heights) > 1:
        # The head turns in over a landing as wide as the ramp.
        head = y1 - _RAMP_M - 1.0
        parts += ramp(
            (x1 + half + 0.3, y0), (x1 + half + 0.3, head), 0.0, heights[1], _RAMP_M, floor=floor, wall=wall
        )
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


def _stair_tower(site: Site, corner: Point, heights: tuple[float, ...]) -> Parts:
    x, y = corner
    top = heights[-1] + 3.2
    tower = site.material("deck_tower", "tiles:#2f8f8b")
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
