"""Coasts: beaches, coves, cliffs, river mouths and spits, with villages, landings and what is afloat."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import Point, ahead, heading, point, smoothed, towards
from aerialdojo_gen.scenes.worlds.shores import Isle, build_village, islands, landing
from aerialdojo_gen.scenes.worlds.wilds import winding


class _Shore(NamedTuple):
    """A shore along the site, in a frame of its own: u along it, v inland, the sea before it; turned as drawn."""

    quarter: int
    flip: int
    half_u: float
    half_v: float

    def at(self, u: float, v: float) -> Point:
        """Point of the world."""
        x, y = self.flip * u, v
        for _ in range(self.quarter):
            x, y = -y, x
        return point(x, y)

    def yaw(self, deg: float) -> float:
        """Direction in the world of one where 0 is along the shore and 90 inland."""
        far = self.at(1e3 * math.cos(math.radians(deg)), 1e3 * math.sin(math.radians(deg)))
        return round(towards((0.0, 0.0), far) % 360.0, 1)

    @property
    def along(self) -> str:
        """Formula of u."""
        sign = self.flip * (1, 1, -1, -1)[self.quarter]
        return f"{sign}*{'xy'[self.quarter % 2]}"


def write(draft: Draft) -> None:
    """Raise the land, and build a village on it."""
    quarter, (w, d) = draft.whole(0, 3, "quarter"), draft.half
    shore = _Shore(quarter, draft.pick([1, -1], "flip"), *((d, w) if quarter % 2 else (w, d)))
    build_village(draft, _TOPOLOGIES[draft.topology](draft, shore))


def _beside(shore: _Shore, at: float, by_m: float) -> BaseGeometry:
    """Ground that is farther along the shore from a place than so much."""
    far, deep = shore.half_u + 30.0, shore.half_v + 30.0
    boxes = [[shore.at(u, v) for u, v in ((a, -deep), (b, -deep), (b, deep), (a, deep))]
             for a, b in ((-far, at - by_m), (at + by_m, far))]  # fmt: skip
    return shapely.union_all([shapely.Polygon(box).buffer(0) for box in boxes])


def _mainland(draft: Draft, shore: _Shore, line: Callable[[float], float]) -> shapely.Polygon:
    """Name the coastline, v by u, that bounds the land; it goes on beyond the site."""
    rng, out = draft.rng("coastline"), shore.half_u + 20.0
    ripples = [(n, float(rng.uniform(0.4, 1.1)), float(rng.uniform(0, 360))) for n in (3, 5)]
    flat = []
    for k in range(31):
        u = out * (k / 15.0 - 1.0)
        ripple = sum(a * math.sin(math.radians(n * 180.0 * u / out + phase)) for n, a, phase in ripples)
        flat.append((u, line(u) + ripple))
    points = [shore.at(u, v) for u, v in (*flat, (out, shore.half_v + 20), (-out, shore.half_v + 20))]
    draft.lines["coast"] = {"points": [*points, points[0]], "smooth": 1}
    return shapely.Polygon(smoothed([*points, points[0]], 1).coords).buffer(0)


def _raise(
    draft: Draft, parts: list[Any], land: BaseGeometry, heights: dict[str, str], total: str, share: float = 1.0
) -> None:  # fmt: skip
    """Raise land, with so much of the drawn relief."""
    site = land.intersection(draft.site.shape())
    islands(draft, parts, site, round(draft.knob("relief_m") * share, 2), heights=heights, total=total)


def _behind(shore: _Shore, land: BaseGeometry, u: float, by_m: float) -> Point:
    """Point so far inland of the shore."""
    sea = landing(land, shore.at(u, shore.half_v - 1.0), shore.yaw(270.0))
    return ahead(sea, shore.yaw(90.0), by_m)


def _beach(draft: Draft, shore: _Shore) -> Isle:
    """A long beach with groynes, dunes behind it, a pier out from the village."""
    base = draft.number(-0.36, -0.2, "base") * shore.half_v
    land = _mainland(draft, shore, lambda u: base)
    dunes = f"{draft.number(1.2, 2.6, 'dunes')}*eased(inland, 13, 22)*(1 - eased(inland, 30, 44))*abs(noise)"
    _raise(draft, [{"polygon": ["coast"]}], land, {"dunes": dunes}, "dunes", 0.4)
    draft.section("Groynes and the pier")
    middle = draft.number(-0.4, 0.4, "village") * shore.half_u
    lines = []
    for k in range(draft.whole(3, 5, "groynes")):
        u = (-0.8 + 0.4 * k) * shore.half_u + draft.number(-3, 3, "groyne", k)
        if abs(u - middle) > 14.0:
            ends = _behind(shore, land, u, 4.5), _behind(shore, land, u, -9.0)
            lines.append(ends)
            draft.take(shapely.LineString(ends).buffer(1.2))
    if lines:
        draft.make("groynes", lines=lines, height_m=1.5)
    heads = [_behind(shore, land, side * 0.68 * shore.half_u, 14.0) for side in (-1, 1)]
    return Isle(land, _behind(shore, land, middle, 17.0), shore.yaw(270.0), heads)


def _cove(draft: Draft, shore: _Shore) -> Isle:
    """A bay between two headlands, the village at its head."""
    base, deep = draft.number(-0.5, -0.36, "base") * shore.half_v, draft.number(0.5, 0.72, "deep") * shore.half_v
    at, half = draft.number(-0.2, 0.2, "at") * shore.half_u, draft.number(0.3, 0.4, "half") * shore.half_u
    land = _mainland(draft, shore, lambda u: base + deep * math.exp(-math.pow((u - at) / half, 4.0)))
    heads = [_behind(shore, land, at + side * half * 2.0, 13.0) for side in (-1, 1)]
    heights = {}
    for k, (x, y) in enumerate(heads):
        heights[f"far_{k}"] = f"hypot(x - {x}, y - {y})/{draft.number(15, 20, 'head', k)}"
        heights[f"head_{k}"] = f"{draft.number(5, 10, 'high', k)}*exp(-far_{k}*far_{k})*eased(inland, 1, 6)"
    _raise(draft, [{"polygon": ["coast"]}], land, heights, "head_0 + head_1")
    steep = shapely.MultiPoint(heads).buffer(24.0)
    return Isle(land, _behind(shore, land, at, 14.0), shore.yaw(270.0), heads, cliffs=steep)


def _cliffs(draft: Draft, shore: _Shore) -> Isle:
    """Cliffs with skerries before them, a village in the mouth of a valley."""
    base = draft.number(-0.42, -0.3, "base") * shore.half_v
    at = draft.number(-0.45, 0.45, "at") * shore.half_u
    land = _mainland(draft, shore, lambda u: base + 5.0 * math.exp(-(((u - at) / 12.0) ** 2)))
    high, half = draft.number(7, 12, "high"), draft.number(16, 21, "half")
    valley = f"eased(abs({shore.along} - ({at:.1f})), {half:.1f}, {half + 13:.1f})"
    parts: list[Any] = [{"polygon": ["coast"]}]
    whole: BaseGeometry = land
    for k in range(draft.whole(3, 5, "skerries")):
        u = draft.number(-0.85, 0.85, "skerry", k) * shore.half_u
        spot = ahead(_behind(shore, land, u, 0.0), shore.yaw(270.0), draft.number(9, 16, "skerry", k, "out"))
        radius = draft.number(2.4, 3.8, "skerry", k, "radius")
        if abs(u - at) > half and all(math.dist(spot, p["blob"][:2]) > 9.0 for p in parts[1:]):
            parts.append({"blob": [*spot, radius, draft.whole(0, 999, "skerry", k), 0.2]})
            whole = whole.union(shapely.Point(spot).buffer(radius + 1.0))
    heights = {"cliff": f"{high}*eased(inland, 0.4, 5.5)*{valley}*(1 + 0.1*noise)"}
    _raise(draft, parts, whole, heights, "cliff")
    far = [u * shore.half_u for u in (-0.72, 0.72) if abs(u * shore.half_u - at) > half + 8]
    heads = [_behind(shore, land, u, 11.0) for u in far]
    village = _behind(shore, land, at, 14.0)
    return Isle(whole, village, shore.yaw(270.0), heads, cliffs=_beside(shore, at, half - 1.0))


def _estuary(draft: Draft, shore: _Shore) -> Isle:
    """The mouth of a river, a footbridge over it, the village on one of its banks."""
    base = draft.number(-0.42, -0.3, "base") * shore.half_v
    at = draft.number(-0.25, 0.25, "at") * shore.half_u
    land = _mainland(draft, shore, lambda u: base + 4.0 * math.exp(-(((u - at) / 14.0) ** 2)))
    ends = shore.at(at, base - 4.0), shore.at(at + draft.number(-16, 16, "source"), shore.half_v + 6.0)
    river, width = winding(draft, "river", ends, 7.0, 3), draft.number(9, 12, "width")
    draft.lines["coast_line"] = draft.lines.pop("coast")
    whole = land.difference(river.buffer(width / 2))
    side = draft.pick([-1, 1], "side")
    _raise(draft, [{"polygon": ["coast_line"], "minus": {"ribbon": "river", "width_m": width}}], whole, {}, "0")
    *middle, along = heading(river, river.length * draft.number(0.5, 0.62, "bridge"))
    across = along + 90.0
    draft.section("The bridge")
    start = ahead((middle[0], middle[1]), across, -(width / 2 + 3.5))
    draft.make("pier", at=start, yaw_deg=round(across, 1), length_m=round(width + 7.0, 1), width_m=3.0, z=1.7,
               bay_m=4.2, rail=draft.material("rail"), category="footbridge")  # fmt: skip
    draft.take(shapely.LineString([start, ahead(start, across, width + 7.0)]).buffer(4.0))
    u = at + side * draft.number(19, 24, "village")
    heads = [at + f * 30.0 for f in (-side, side * 1.6) if abs(at + f * 30.0) < shore.half_u - 9.0]
    heads_at = [_behind(shore, whole, v, 12.0) for v in heads]
    return Isle(whole, _behind(shore, whole, u, 15.0), shore.yaw(270.0), heads_at)


def _spit(draft: Draft, shore: _Shore) -> Isle:
    """A hook of sand about a lagoon, a lookout at its end."""
    base = draft.number(-0.08, 0.08, "base") * shore.half_v
    land = _mainland(draft, shore, lambda u: base)
    reach, v = draft.number(0.42, 0.56, "reach") * shore.half_u, base - draft.number(35, 40, "out")
    bends = ((-0.72, base + 5.0), (-0.7, base - 10.0), (-0.5, v + 3.0), (0.0, v))
    points = [*(shore.at(f * shore.half_u, y) for f, y in bends), shore.at(reach, v + 2.0)]
    draft.lines["hook"] = {"points": points, "smooth": 2}
    wide = draft.number(12, 15, "wide")
    body = smoothed(points, 2).buffer(wide / 2)
    end = points[-1]
    whole = land.union(body).union(shapely.Point(end).buffer(10.0))
    parts = [{"polygon": ["coast"]}, {"ribbon": "hook", "width_m": wide, "round_ends": True},
             {"blob": [*end, 11.0, draft.whole(0, 999, "end"), 0.12]}]  # fmt: skip
    _raise(draft, parts, whole, {}, "0", 0.5)
    village, head = _behind(shore, land, 0.25 * shore.half_u, 14.0), _behind(shore, land, 0.8 * shore.half_u, 12.0)
    return Isle(whole, village, shore.yaw(270.0), [end, head])


def _fjord(draft: Draft, shore: _Shore) -> Isle:
    """A long arm of the sea between steep hills, the village at its end."""
    base, deep = -0.72 * shore.half_v, draft.number(1.05, 1.2, "deep") * shore.half_v
    at, half = draft.number(-0.15, 0.15, "at") * shore.half_u, draft.number(0.35, 0.4, "half") * shore.half_u
    land = _mainland(draft, shore, lambda u: base + deep * math.exp(-math.pow((u - at) / half, 4.0)))
    high = draft.number(8, 13, "high")
    aside = f"eased(abs({shore.along} - ({at:.1f})), {half * 1.1 + 6:.1f}, {half * 1.1 + 20:.1f})"
    hills = f"{high}*{aside}*eased(inland, 2, 12)*(1 + 0.25*noise)"
    _raise(draft, [{"polygon": ["coast"]}], land, {"hills": hills}, "hills")
    heads = [_behind(shore, land, at + side * half * 1.25, 16.0) for side in (-1, 1)]
    village = _behind(shore, land, at, 13.0)
    return Isle(land, village, shore.yaw(270.0), heads, cliffs=_beside(shore, at, half * 1.1 + 6.0))


_TOPOLOGIES = {
    "beach": _beach, "cove": _cove, "cliffs": _cliffs, "estuary": _estuary, "spit": _spit, "fjord": _fjord,
}  # fmt: skip
