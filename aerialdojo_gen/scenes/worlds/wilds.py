"""Stages that open country shares: winding ways, relief, clearings, slots in the open and trees about them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft

Point = tuple[float, float]


def rolling(draft: Draft, height_m: float, wavelength_m: tuple[float, float] = (28, 48), cell_m: float = 1.7) -> None:
    """Let the ground roll, and level it under what stands on it."""
    step = {
        "make": "rolling_ground", "cell_m": cell_m, "height_m": height_m, "octaves": 3,
        "wavelength_m": draft.number(*wavelength_m, "waves"), "seed": draft.whole(0, 10_000, "relief"),
    }  # fmt: skip
    draft.ground.setdefault("steps", []).append(step)
    draft.head["placing"] = {"settle_m": 0.5, "margin_m": 0.4}
    draft.level_things = True


def step(draft: Draft, builder: str, **arguments: Any) -> None:
    """Add a step to the ground."""
    draft.ground.setdefault("steps", []).append({"make": builder, **arguments})


def winding(draft: Draft, name: str, ends: tuple[Point, Point], swing_m: float, bends: int = 4) -> shapely.LineString:
    """Name a winding line of the plan between two points; gives about where it goes."""
    (x0, y0), (x1, y1) = ends
    length = math.hypot(x1 - x0, y1 - y0)
    nx, ny = -(y1 - y0) / length, (x1 - x0) / length
    rng = draft.rng("line", name)
    points = [ends[0]]
    for k in range(1, bends + 1):
        f, off = k / (bends + 1), float(rng.uniform(-swing_m, swing_m))
        points.append((x0 + f * (x1 - x0) + nx * off, y0 + f * (y1 - y0) + ny * off))
    points.append(ends[1])
    draft.lines[name] = {"points": [[round(x, 1), round(y, 1)] for x, y in points], "smooth": 3}
    return smoothed(points, 3)


def smoothed(points: Sequence[Point], times: int) -> shapely.LineString:
    """Cut corners so often, as plans do."""
    line = np.array(points)
    for _ in range(times):
        first, last = line[:-1] * 0.75 + line[1:] * 0.25, line[:-1] * 0.25 + line[1:] * 0.75
        line = np.concatenate([line[:1], np.stack([first, last], 1).reshape(-1, 2), line[-1:]])
    return shapely.LineString(line)


def paths(draft: Draft, lines: dict[str, shapely.LineString], width_m: float = 1.5) -> None:
    """Tread paths along named lines: level, painted, kept free, with slots (``wayside``) beside them."""
    step(draft, "level_along", lines=list(lines), width_m=1.2, blend_m=3, smooth_m=10)
    ribbons = [{"ribbon": name, "width_m": width_m, "round_ends": True} for name in lines]
    draft.section("Paths")
    draft.paint(ribbons, draft.material("path"))
    draft.make("keep_free", areas=[{"ribbon": name, "width_m": width_m + 0.6} for name in lines])
    for line in lines.values():
        draft.take(line.buffer(width_m / 2 + 0.3))
    for name, line in lines.items():
        for k in range(int(line.length // 8.0)):
            at = 4.0 + 8.0 * k
            here, there = line.interpolate(at), line.interpolate(at + 0.5)
            yaw = math.atan2(there.y - here.y, there.x - here.x)
            side = 1 if draft.chance(0.5, "side", name, k) else -1
            x, y = here.x - math.sin(yaw) * side * 2.3, here.y + math.cos(yaw) * side * 2.3
            if draft.is_free(shapely.Point(x, y).buffer(1.0)):
                draft.slot("wayside", x, y, math.degrees(yaw) - side * 90.0, (2.4, 2.6))


def clearing(draft: Draft, name: str, at: Point, radius_m: float) -> None:
    """Clear and level a round place, and take its ground."""
    x, y = at
    step(draft, "level_area", area={"disc": [x, y, round(radius_m * 0.9, 1)]}, blend_m=5)
    draft.areas[name] = {"blob": [x, y, radius_m, draft.whole(0, 1999, "blob", name), 0.25]}
    draft.paint({"area": name, "grow_m": 1.2}, draft.material("patch", name))
    draft.paint(name, draft.material("glade", name))


def brook(draft: Draft, name: str, ends: tuple[Point, Point], swing_m: float) -> shapely.LineString:
    """Cut the bed of a brook, and let water flow in it; gives its middle line."""
    bed = winding(draft, name, ends, swing_m)
    step(draft, "level_along", lines=[name], width_m=5.6, blend_m=5, smooth_m=40)
    step(draft, "sink_area", area={"ribbon": name, "width_m": 7.0}, depth_m=1.8, blend_m=2.4)
    draft.areas["water"] = {"ribbon": name, "width_m": 2.8}
    water(draft)
    return bed


def water(draft: Draft) -> None:
    """Paint the area `water` and its shore."""
    seed = draft.whole(0, 9999, "shore")
    draft.make("paint_shore", water="water", material=draft.material("bank"), lobe_m=1.4, seed=seed)
    draft.paint("water", draft.material("water"))


def bridged(draft: Draft, bed: shapely.LineString, share: float) -> list[Point]:
    """Lay a footbridge over a brook at a share of its length, and take its ground; gives the landings."""
    middle = bed.interpolate(bed.length * share)
    ahead = bed.interpolate(bed.project(middle) + 0.5)
    across = math.degrees(math.atan2(ahead.y - middle.y, ahead.x - middle.x)) + 90.0
    c, s = math.cos(math.radians(across)), math.sin(math.radians(across))
    draft.take(bed.buffer(3.8))
    draft.take(middle.buffer(7.5))
    at = [round(middle.x, 1), round(middle.y, 1)]
    draft.make("footbridge", at=at, yaw_deg=round(across, 1), span_m=8.5, place="")
    return [(round(middle.x + u * c, 1), round(middle.y + u * s, 1)) for u in (-6.5, 6.5)]


def about(
    draft: Draft, kind: str, at: Point, ring: tuple[float, float], number: int, room_m: tuple[float, float]
) -> None:
    """Offer slots about a point, in a ring between two radii, fronts to the point."""
    rng = draft.rng("about", kind, *at)
    first = float(rng.uniform(0, 360))
    for k in range(number):
        angle = math.radians(first + (k + float(rng.uniform(-0.25, 0.25))) * 360 / number)
        away = float(rng.uniform(*ring))
        x, y = at[0] + away * math.cos(angle), at[1] + away * math.sin(angle)
        draft.slot(kind, x, y, math.degrees(angle) + 180.0 + float(rng.uniform(-20, 20)), room_m)


def strewn(draft: Draft, kind: str, number: int, room_m: tuple[float, float], margin_m: float = 4.0) -> None:
    """Offer slots anywhere on free ground, well apart."""
    rng, w, d = draft.rng("strewn", kind), draft.width_m / 2 - margin_m, draft.depth_m / 2 - margin_m
    chosen: list[shapely.Point] = []
    for _ in range(number * 6):
        spot = shapely.Point(float(rng.uniform(-w, w)), float(rng.uniform(-d, d)))
        if len(chosen) < number and all(spot.distance(c) > 6.0 for c in chosen) and draft.is_free(spot.buffer(1.6)):
            chosen.append(spot)
            draft.slot(kind, spot.x, spot.y, float(rng.uniform(0, 360)), room_m)


def anywhere(draft: Draft, number: int = 60, margin_m: float = 7.0) -> list[tuple[float, float, float]]:
    """Draw poses for landmarks over the site."""
    rng, w, d = draft.rng("anywhere"), draft.width_m / 2 - margin_m, draft.depth_m / 2 - margin_m
    return [
        (round(float(rng.uniform(-w, w)), 1), round(float(rng.uniform(-d, d)), 1), round(float(rng.uniform(0, 360))))
        for _ in range(number)
    ]


def wood(draft: Draft, area: Any, most: float, spacing_m: float = 4.6) -> None:
    """Plant the palette's trees on what is left of an area, and what grows under them."""
    species = draft.material("trees").split("+")
    draft.add({
        "pattern": {"of": species, "scatter": area, "spacing_m": spacing_m, "limit": int(most), "stream": "wood"},
        "fit": "skip", "room_m": 0.0,
    })  # fmt: skip
    low = draft.shuffled(["bush", "fern", "sapling", "grass_tuft", "wildflowers", "young_spruce"], "undergrowth")
    draft.make("undergrowth", area=area, kinds=[{"of": kind, "spacing_m": 3.5, "limit": 24} for kind in low[:3]])
