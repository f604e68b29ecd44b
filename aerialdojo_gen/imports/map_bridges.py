"""Bridges of a map: grouping of ways, height of the deck, length of the ramps.

OpenStreetMap says that a way is on a bridge, not how high. The deck is as high as the clearance below requires; the
ramps use the approaches up to the first junction, and the rest of the climb is on the bridge.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry import LineString, Point, Polygon
from shapely.ops import linemerge, substring

from aerialdojo_gen.imports.map_tags import Tags, below_ground, metres
from aerialdojo_gen.imports.osm import Feature

BRIDGE = "aerialdojo:bridge"
"""Tag with the index of the bridge that a way lies on."""

_RAILS = ("rail", "tram", "light_rail", "narrow_gauge", "subway")
_PATHS = ("footway", "path", "cycleway", "steps", "bridleway", "pedestrian")
# Required clearance above what passes below, metres.
_CLEAR_M = {"rail": 5.5, "road": 4.7, "water": 3.2, "path": 2.8, "": 2.8}
_DEPTH_M = {"rail": 1.0, "road": 0.8, "path": 0.45}
# Ramp grades: usual, and maximum where there is no room.
_GRADE = {"rail": (0.03, 0.08), "road": (0.06, 0.14), "path": (0.1, 0.2)}
_MAX_OFFSET_M, _ALONG = 14.0, math.cos(math.radians(30.0))
_MAX_RAMP_M = 120.0
_STATION_M, _ROUND_M = 2.0, 8.0
_MIN_M = 4.0

Ground = Callable[[float, float], float]
At = tuple[float, float]
Cut = tuple[Feature, list[tuple[LineString, bool]]]


@dataclass(frozen=True)
class Bridge:
    """A deck for one or several parallel ways, with its ramps."""

    axis: LineString  # Centre line between the feet of the ramps, metres
    heights_m: tuple[float, ...]
    span_m: tuple[float, float]  # (from, to) along the axis, metres: the bridge itself; the rest is ramp
    kind: str  # ``"rail"``, ``"road"`` or ``"path"``: the heaviest traffic
    layer: int  # As mapped
    members: tuple[Feature, ...]  # Ways on the bridge itself

    def height(self, x: float, y: float) -> float:
        """Height of the deck at a point over the line between its ends, metres."""
        s = self.axis.project(Point(x, y))
        return float(np.interp(s, np.linspace(0.0, self.axis.length, len(self.heights_m)), self.heights_m))

    def to_plan(self) -> dict[str, Any]:
        """Return the bridge as a table of the plan."""
        at = np.linspace(0.0, self.axis.length, len(self.heights_m))
        name = next((f.tags["name"] for f in self.members if f.tags.get("name")), "")[:80]
        points = [self.axis.interpolate(s) for s in at]
        return {
            **({"name": name} if name else {}), "depth_m": _DEPTH_M[self.kind],
            "span_m": [round(s, 2) for s in self.span_m], "line": [[round(p.x, 2), round(p.y, 2)] for p in points],
            "heights_m": [round(h, 2) for h in self.heights_m],
        }  # fmt: skip


def bridges(
    lines: Sequence[Feature], areas: Sequence[Feature], site: Polygon, ground: Ground, summary: Counter[str]
) -> tuple[list[Bridge], list[Feature]]:
    """Find the bridges that touch the site, lowest first, and split the lines on them."""
    ways = [f for f in lines if _kind(f.tags) and isinstance(f.shape, LineString) and not below_ground(f.tags)]
    net = _RoadNetwork(ways)
    out: list[Bridge] = []
    on: dict[int, list[Feature]] = {}
    clusters = _clusters([f for f in ways if _is_bridge(f.tags) and f.shape.length >= _MIN_M])
    for members in clusters:
        if not any(f.shape.intersects(site) for f in members):
            continue
        bridge, ramps, enough = _build_bridge(members, net, lines, areas, site, ground, out)
        if max(bridge.heights_m) < 0.3 and _level(bridge, ground):
            continue
        number = {BRIDGE: str(len(out))}
        for way in members:
            on[id(way)] = [replace(way, tags={**way.tags, **number})]
        for way, pieces in ramps:
            on[id(way)] = [replace(way, shape=shape, tags={**way.tags, **(number if up else {})})
                           for shape, up in pieces]  # fmt: skip
        out.append(bridge)
        summary["bridges"] += 1
        if not enough:
            summary["bridges lower than the required clearance: no room for ramps"] += 1
    return out, [one for f in lines for one in on.get(id(f), [f])]


def _kind(tags: Tags) -> str:
    if tags.get("railway") in _RAILS:
        return "rail"
    highway = tags.get("highway", "").removesuffix("_link")
    if not highway or tags.get("area") == "yes" or highway in ("platform", "corridor", "proposed", "construction"):
        return ""
    return "path" if highway in _PATHS else "road"


def _is_bridge(tags: Tags) -> bool:
    return tags.get("bridge", "no") not in ("no", "abandoned") and _layer(tags) >= 0


def _layer(tags: Tags) -> int:
    text = tags.get("layer", "1")
    return int(text) if text.lstrip("-").isdigit() and len(text) < 4 else 1


def _at(point: Sequence[float]) -> At:
    return round(point[0], 3), round(point[1], 3)


class _RoadNetwork:
    """The graph of ways and the points at which they meet."""

    def __init__(self, ways: Sequence[Feature]) -> None:
        self._meet: dict[At, list[Feature]] = {}
        for way in ways:
            for at in {_at(p) for p in way.shape.coords}:
                self._meet.setdefault(at, []).append(way)

    def approach(self, way: Feature, end: At, most_m: float) -> list[tuple[Feature, list[At]]]:
        """Follow ways of the same kind beyond a way's end, up to the first junction; returns ways with points."""
        out: list[tuple[Feature, list[At]]] = []
        length = 0.0
        while length < most_m:
            others = [f for f in self._meet[end] if f is not way]
            if len(others) != 1 or _kind(others[0].tags) != _kind(way.tags) or _is_bridge(others[0].tags):
                break
            way = others[0]
            points = [_at(p) for p in way.shape.coords]
            if end not in (points[0], points[-1]) or points[0] == points[-1]:
                break
            points = points if points[0] == end else points[::-1]
            joined = next((k for k, p in enumerate(points[1:-1], 1) if len(self._meet[p]) > 1), len(points) - 1)
            out.append((way, points[: joined + 1]))
            length += LineString(points[: joined + 1]).length
            if joined < len(points) - 1:
                break
            end = points[-1]
        return out


def _clusters(ways: Sequence[Feature]) -> list[tuple[Feature, ...]]:
    """Group ways that share a bridge: same layer, consecutive or parallel."""
    if not ways:
        return []
    ways = sorted(ways, key=lambda f: (_layer(f.tags), f.key, sorted(f.tags.items())))
    together = [
        (i, j) for i, a in enumerate(ways) for j, b in enumerate(ways[:i])
        if _layer(a.tags) == _layer(b.tags) and _same_bridge(a.shape, b.shape)
    ]  # fmt: skip
    ends = np.array(together, dtype=np.int64).reshape(-1, 2).T
    graph = coo_array((np.ones(len(together)), ends), shape=(len(ways), len(ways)))
    # Components are numbered in the order of their first ways.
    n, number = connected_components(graph, directed=False)
    return [tuple(way for way, k in zip(ways, number, strict=True) if k == group) for group in range(n)]


def _same_bridge(a: LineString, b: LineString) -> bool:
    if a.distance(b) > _MAX_OFFSET_M:
        return False
    u, v = (np.subtract(line.coords[-1], line.coords[0])[:2] for line in (a, b))
    lengths = float(np.hypot(*u) * np.hypot(*v))
    if lengths < 1e-6 or abs(float(u @ v)) < _ALONG * lengths:
        return False
    ends = {_at(a.coords[0]), _at(a.coords[-1])} & {_at(b.coords[0]), _at(b.coords[-1])}
    # Parallel, not two bridges in a row.
    across = np.array([-u[1], u[0]]) / np.hypot(*u)
    along = u / np.hypot(*u)
    p, q = (np.asarray(line.coords)[:, :2] @ along for line in (a, b))
    overlap = min(p.max(), q.max()) - max(p.min(), q.min())
    aside = abs(float((np.mean(a.coords, axis=0)[:2] - np.mean(b.coords, axis=0)[:2]) @ across))
    return bool(ends) or (overlap > 0.5 * min(np.ptp(p), np.ptp(q)) and aside < _MAX_OFFSET_M)


def _merged(members: Sequence[Feature]) -> LineString:
    """Return the longest line of the heaviest kind, from west to east (or south to north)."""
    kind = _heaviest(members)
    whole = linemerge([f.shape for f in members if _kind(f.tags) == kind])
    line = max(getattr(whole, "geoms", [whole]), key=lambda one: (round(one.length, 3), one.coords[0]))
    return LineString(line.coords[::-1]) if line.coords[0] > line.coords[-1] else LineString(line.coords)


def _heaviest(members: Sequence[Feature]) -> str:
    return min((_kind(f.tags) for f in members), key=("road", "rail", "path").index)


def _build_bridge(
    members: tuple[Feature, ...], net: _RoadNetwork, lines: Sequence[Feature], areas: Sequence[Feature],
    site: Polygon, ground: Ground, lower: Sequence[Bridge],
) -> tuple[Bridge, list[Cut], bool]:  # fmt: skip
    kind, core = _heaviest(members), _merged(members)
    usual, most = _GRADE[kind]
    needs = _required_rises(members, core, kind, lines, areas, ground, lower)
    rise = max(need for _, need in needs)
    # All ramps of a side end together, so that there are no steps.
    ends = [[(f, e) for f, e in _ends(members) if (core.project(Point(e)) > core.length / 2) == far]
            for far in (False, True)]  # fmt: skip
    room, runs = [0.0, 0.0], [[], []]  # type: tuple[list[float], list[list[Any]]]
    beyond = [False, False]
    for side, several in enumerate(ends):
        beyond[side] = bool(several) and all(not site.buffer(10.0).contains(Point(e)) for _, e in several)
        if beyond[side] or not several:
            continue
        runs[side] = [net.approach(f, e, _MAX_RAMP_M) for f, e in several]
        room[side] = min(sum(LineString(p).length for _, p in run) for run in runs[side])
    ramp = [min(r, rise / usual, _MAX_RAMP_M) for r in room]
    axis = _axis(core, runs, ramp)
    start, end = (axis.project(Point(core.coords[k])) for k in (0, -1))
    at = np.linspace(0.0, axis.length, max(round(axis.length / _STATION_M), 4) + 1)
    climbs = [1e9 if beyond[0] else 0.0, 1e9 if beyond[1] else 0.0]
    grade = usual
    for s, need in needs:
        foot = min(s + start + climbs[0], axis.length - s - start + climbs[1])
        grade = max(grade, need / max(foot, 1.0) * 1.05)
    enough, grade = grade <= most, min(grade, most)
    heights = np.minimum(grade * np.minimum(at + climbs[0], axis.length - at + climbs[1]), rise)
    heights = _smooth(at, heights, beyond)
    pieces = [piece for side in (0, 1) for run in runs[side] for piece in _split_ways(run, ramp[side])]
    bridge = Bridge(axis, tuple(float(h) for h in heights), (start, end), kind, _layer(members[0].tags), members)
    return bridge, pieces, enough


def _ends(members: Sequence[Feature]) -> list[tuple[Feature, At]]:
    """List the outer ends of a bridge's ways."""
    count = Counter(e for f in members for e in {_at(f.shape.coords[0]), _at(f.shape.coords[-1])})
    return [(f, e) for f in members for e in (_at(f.shape.coords[0]), _at(f.shape.coords[-1])) if count[e] == 1]


def _required_rises(
    members: Sequence[Feature], core: LineString, kind: str, lines: Sequence[Feature], areas: Sequence[Feature],
    ground: Ground, lower: Sequence[Bridge],
) -> list[tuple[float, float]]:  # fmt: skip
    """List positions along the core where something passes below, and the required height above its end line."""
    first, last = (ground(*core.coords[k][:2]) for k in (0, -1))
    own = {id(f) for f in members}
    out = []

    def need(s: float, clear_m: float, over_m: float = 0.0) -> None:
        p = core.interpolate(s)
        line = first + (last - first) * s / core.length
        out.append((s, max(ground(p.x, p.y) + over_m + clear_m + _DEPTH_M[kind] - line, 0.0)))

    for f in lines:
        below = _kind(f.tags)
        if not below or id(f) in own or below_ground(f.tags) or not f.shape.intersects(core):
            continue
        if _is_bridge(f.tags) and _layer(f.tags) >= _layer(members[0].tags):
            continue
        half = (metres(f.tags, "width") or {"rail": 4.0, "road": 7.0, "path": 2.5}[below]) / 2
        carried = [b for b in lower if any(f is m for m in b.members)]
        for p in shapely.get_parts(f.shape.intersection(core)):
            s = core.project(p.representative_point())
            if 1.0 < s < core.length - 1.0:
                over = max((b.height(*core.interpolate(s).coords[0]) for b in carried), default=0.0)
                for t in (s - half, s + half):
                    need(min(max(t, 0.0), core.length), _CLEAR_M[below], over)
    wet = any(f.shape.intersects(core) for f in (*areas, *lines)
              if f.tags.get("natural") == "water" or "waterway" in f.tags or "water" in f.tags)  # fmt: skip
    need(core.length / 2, _CLEAR_M["water" if wet else ""])
    return out


def _axis(core: LineString, runs: Sequence[Sequence[Any]], ramp: Sequence[float]) -> LineString:
    """Extend the core by its approaches."""
    points = [tuple(p[:2]) for p in core.coords]
    for side in (0, 1):
        if ramp[side] < 0.5:
            continue
        end = _at(points[-1] if side else points[0])
        run = next((r for r in runs[side] if r and r[0][1][0] == end), None)
        if run is None:
            continue
        whole = LineString([run[0][1][0], *(p for _, way in run for p in way[1:])])
        more = [tuple(p) for p in substring(whole, 0.0, ramp[side]).coords][1:]
        points = points + more if side else more[::-1] + points
    return LineString(points)


def _split_ways(run: Sequence[tuple[Feature, list[At]]], ramp_m: float) -> list[Cut]:
    """Split the approach's ways at the ramp's end: pieces, and whether they are on the ramp."""
    out: list[Cut] = []
    done = 0.0
    for way, points in run:
        own = [_at(p) for p in way.shape.coords]
        line = way.shape if own[0] == points[0] else LineString(way.shape.coords[::-1])
        up = min(max(ramp_m - done, 0.0), LineString(points).length)
        done += LineString(points).length
        if up < 0.5:
            break
        pieces = [(substring(line, 0.0, up), True)]
        if line.length - up > 0.5:
            pieces.append((substring(line, up, line.length), False))
        # Keep the way's direction, for lanes and one-way streets.
        back = line is not way.shape
        out.append((way, [(LineString(p.coords[::-1]) if back else p, on) for p, on in pieces]))
    return out


def _smooth(at: Any, heights: Any, beyond: Sequence[bool]) -> Any:
    """Smooth the profile by a moving average; ends on the ground stay there."""
    near = np.abs(at[:, None] - at[None, :]) <= _ROUND_M / 2
    out = (near * heights[None, :]).sum(axis=1) / near.sum(axis=1)
    for end, free in ((0, beyond[0]), (-1, beyond[1])):
        if not free:
            # Linear from the first full window of the average to the end.
            away = np.abs(at - at[end])
            reach = away[away >= _ROUND_M / 2].min()
            rows = away <= reach
            out[rows] = np.interp(away[rows], [0.0, reach], [0.0, out[away == reach][0]])
    return out


def _level(bridge: Bridge, ground: Ground) -> bool:
    """Whether the ground follows the deck, so that there is nothing to bridge."""
    a, b = (ground(*bridge.axis.coords[k][:2]) for k in (0, -1))
    shares = np.linspace(0.0, 1.0, 9)
    points = [bridge.axis.interpolate(share, normalized=True) for share in shares]
    return all(a + (b - a) * f - ground(p.x, p.y) <= 1.0 for f, p in zip(shares, points, strict=True))
