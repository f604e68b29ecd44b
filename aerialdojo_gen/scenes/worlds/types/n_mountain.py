"""Mountains: ridges, peaks and valleys with huts, paths to the summits, tarns and brooks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.wilds import (
    about,
    beside,
    bridged,
    brook,
    landmarks,
    lay_out,
    paths,
    point,
    step,
    strewn,
    water,
    winding,
)

Point = tuple[float, float]
_SUMMITS = ["summit_cross", "mountain_chapel", "fire_tower", "radio_mast", "obelisk"]


class _Crest(NamedTuple):
    """A ridge of points with heights, or a peak of one; its flanks reach `width_m`."""

    line: Sequence[tuple[float, float, float]]
    width_m: float
    hollow: float = 1.3

    def shape(self) -> BaseGeometry:
        """Return about where it is too steep for houses."""
        flat = [(x, y) for x, y, _ in self.line]
        return (shapely.LineString(flat) if len(flat) > 1 else shapely.Point(flat[0])).buffer(self.width_m * 0.5)


class _Massif(NamedTuple):
    """What a topology gives to the stages after it."""

    crests: list[_Crest]
    heads: list[Point]  # Summits and saddles that paths lead to
    gates: list[Point]  # Where these paths come in, one of each
    tarn: tuple[float, float, float] | None = None  # Place and radius
    bed: tuple[Point, Point] | None = None  # Ends of a brook


def write(draft: Draft) -> None:
    """Raise the mountains, then water, summits and the paths to them, places in the valleys, crags and woods."""
    w, d = draft.width_m / 2, draft.depth_m / 2
    massif = _TOPOLOGIES[draft.topology](draft, w, d, draft.knob("relief_m"))
    ridges = [{"line": [list(p) for p in c.line], "width_m": c.width_m, "hollow": c.hollow} for c in massif.crests]
    step(
        draft,
        "massif",
        ridges=ridges,
        bench_m=draft.number(3.5, 5.5, "bench"),
        rough_m=draft.number(1.4, 2.6, "rough"),
    )
    draft.head["placing"] = {"settle_m": 0.5, "margin_m": 0.4}
    draft.level_things = True
    _summits(draft, massif)
    shut = shapely.union_all([crest.shape() for crest in massif.crests])
    _cover(draft, massif.tarn)
    landings = []
    if massif.bed is not None:
        bed = brook(draft, "brook", massif.bed, 11.0)
        landings = bridged(draft, bed, draft.number(0.4, 0.6, "bridge"))
    _paths(draft, massif, landings)
    crag_area = shut.difference(shapely.union_all([shapely.Point(h).buffer(9.0) for h in massif.heads]))
    draft.take(shut)
    spots = lay_out(draft)
    step(draft, "level_under_things")
    landmarks(draft, spots)
    _crags(draft, crag_area)
    strewn(draft, "slope", 34, (4.2, 4.2))
    draft.fill_slots()
    _growth(draft, w, d)


def _summits(draft: Draft, massif: _Massif) -> None:
    """Level the summits, and put a landmark on the first that has room for one."""
    draft.section("The summits")
    for head in massif.heads:
        step(draft, "level_area", area={"disc": [*head, 5.0]}, blend_m=3.5)
        draft.paint({"blob": [*head, 5.4, draft.whole(0, 999, "head", *head), 0.25]}, draft.material("glade"))
    draft.landmark([(*head, draft.number(0, 360, "head", *head, "yaw")) for head in massif.heads[:1]], of=_SUMMITS)
    for head in massif.heads:
        about(draft, "summit", head, (3.4, 4.8), 5, (2.8, 2.8))


def _cover(draft: Draft, tarn: tuple[float, float, float] | None) -> None:
    """Paint meadows, snow where it is high and gentle, scree and rock where it is steep; fill the tarn."""
    draft.section("What covers the ground")
    patches = [draft.material("patch", k) for k in range(3)]
    draft.make("paint_patches", materials=patches, count=40, radius_m=[2.5, 7.5], seed=draft.whole(0, 999, "patches"))
    draft.make("steep_ground", slope=0.8, **{"as": "faces"})
    draft.paint({"area": "faces", "grow_m": [1.1, 2]}, draft.material("scree"))
    draft.paint("faces", draft.material("rock"))
    if "snow" in draft.palette.materials:
        draft.make("high_ground", above_m=round(draft.knob("relief_m") * 0.82, 1), slope=0.7, **{"as": "snowfields"})
        draft.paint({"area": "snowfields", "plus": {"disc": [0, 0, 0.1]}}, draft.material("snow"))
    if tarn is not None:
        x, y, radius = tarn
        step(draft, "level_area", area={"disc": [x, y, radius + 4.0]}, blend_m=6)
        step(draft, "sink_area", area={"disc": [x, y, radius + 1.0]}, depth_m=1.0, blend_m=2.5)
        draft.areas["water"] = {"blob": [x, y, round(radius - 1.0, 1), draft.whole(0, 999, "tarn"), 0.18]}
        water(draft)
        about(draft, "shore", (x, y), (radius + 2.4, radius + 4.0), 9, (4.8, 3.6))
        draft.take(shapely.Point(x, y).buffer(radius + 5.0))


def _paths(draft: Draft, massif: _Massif, landings: Sequence[Point]) -> None:
    lines = {}
    for k, (gate, head) in enumerate(zip(massif.gates, massif.heads, strict=False)):
        toward = math.degrees(math.atan2(gate[1] - head[1], gate[0] - head[0]))
        lines[f"path_{k}"] = winding(draft, f"path_{k}", (gate, point(*beside((*head, toward), 5.5, 0.0))), 9.0, 5)
    for k, landing in enumerate(landings):
        out = min(massif.gates, key=lambda g: math.hypot(g[0] - landing[0], g[1] - landing[1])) if k else None
        if out is not None:
            lines["over"] = winding(draft, "over", (landing, out), 3.0, 2)
    paths(draft, lines)


def _crags(draft: Draft, area: BaseGeometry) -> None:
    """Pile crags on the flanks."""
    rng, (x0, y0, x1, y1) = draft.rng("crags"), area.bounds
    w, d = draft.width_m / 2 - 5.0, draft.depth_m / 2 - 5.0
    found: list[dict[str, Any]] = []
    for k in range(160):
        x, y = round(float(rng.uniform(x0, x1)), 1), round(float(rng.uniform(y0, y1)), 1)
        spot = shapely.Point(x, y)
        clear = all(math.hypot(x - c["at"][0], y - c["at"][1]) > 12.0 for c in found)
        ways = any(shapely.LineString(line["points"]).distance(spot) < 7.0 for line in draft.lines.values())
        if len(found) < 8 and abs(x) < w and abs(y) < d and clear and not ways and area.contains(spot):
            radius = draft.number(2.6, 4.2, "crag", k)
            found.append(
                {"at": [x, y], "radius_m": radius, "height_m": round(radius * draft.number(1.2, 1.9, "high", k), 1)}
            )
    if found:
        draft.section("Crags")
        draft.make("crags", crags=found, materials=[draft.material("rock"), draft.material("dark")])


def _growth(draft: Draft, w: float, d: float) -> None:
    """Plant woods below the tree line, dwarf spruces and flowers above, boulders at the feet of rocks."""
    draft.section("Woods and boulders")
    ground: dict[str, Any] = {"box": [-w + 1.5, -d + 1.5, w - 1.5, d - 1.5], "minus": ["faces"]}
    if "water" in draft.areas:
        ground["minus"] = ["faces", {"area": "water", "grow_m": 1.0}]
    line = round(draft.knob("relief_m") * 0.55, 1)
    below, most = f"max(0, min(1, ({line} - z)/3))", round(draft.knob("trees"))
    trees = draft.material("trees").split("+")
    for tree in trees:
        draft.make("strew", of=tree, area=ground, spacing_m=4.4, density=below, limit=most // len(trees))
    draft.make("strew", of="boulder", area=ground, spacing_m=4, limit=45,
               roles={"rock": draft.material("rock"), "top": draft.material("scree")},
               attributes={"colour": "grey"})  # fmt: skip
    low = ["bush", "fern", "young_spruce", "wildflowers", "grass_tuft"]
    kinds = [{"of": one, "spacing_m": 4, "limit": 18} for one in draft.shuffled(low, "low")[:4]]
    draft.make("undergrowth", area=ground, kinds=kinds)


def _cirque(draft: Draft, w: float, d: float, high: float) -> _Massif:
    """A bow of ridges about a tarn, open to one side."""
    open_deg = draft.number(0, 360, "open")
    crest, n = [], 7
    for k in range(n):
        turn = math.radians(open_deg + 180.0 + (k / (n - 1) - 0.5) * draft.number(190, 220, "bow"))
        z = high * (0.6 + 0.4 * math.sin(math.pi * k / (n - 1))) + draft.number(-1.5, 1.5, "crest", k)
        crest.append((*point(0.84 * w * math.cos(turn), 0.84 * d * math.sin(turn)), round(z, 1)))
    spur = [crest[2], (*point(crest[2][0] * 0.45, crest[2][1] * 0.45), round(high * 0.35, 1))]
    crests = [_Crest(crest, draft.number(30, 38, "width")), _Crest(spur, 18.0, 1.1)]
    at = point(*beside((0.0, 0.0, open_deg + 180.0), 8.0, draft.number(-6, 6, "tarn")))
    gates = [_edge(open_deg + off, w, d) for off in (-45.0, 45.0)]
    return _Massif(crests, [crest[5][:2], crest[1][:2]], gates, (*at, draft.number(6.5, 9.0, "tarn", "radius")))


def _edge(deg: float, w: float, d: float) -> Point:
    """Point of the site's edge in a direction from its middle."""
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    reach = min((w + 1.0) / max(abs(c), 1e-6), (d + 1.0) / max(abs(s), 1e-6))
    return point(c * reach, s * reach)


def _pass(draft: Draft, w: float, d: float, high: float) -> _Massif:
    """A ridge across the site, and a path over its saddle."""
    along = draft.number(0, 180, "along")
    ends = [_edge(along, w, d), _edge(along + 180.0, w, d)]
    saddle = draft.number(0.4, 0.6, "saddle")
    crest = []
    for k in range(7):
        f = k / 6
        dip = 1.0 - 0.5 * max(0.0, 1.0 - abs(f - saddle) / 0.22)
        x, y = ends[0][0] + f * (ends[1][0] - ends[0][0]), ends[0][1] + f * (ends[1][1] - ends[0][1])
        x, y = beside((x, y, along), 0.0, draft.number(-8, 8, "crest", k))
        crest.append((*point(x, y), round(high * dip + draft.number(-1.5, 1.5, "crest", k, "z"), 1)))
    heads = [point(ends[0][0] + saddle * (ends[1][0] - ends[0][0]), ends[0][1] + saddle * (ends[1][1] - ends[0][1]))]
    heads *= 2  # A path comes up from either side
    return _Massif(
        [_Crest(crest, draft.number(24, 30, "width"))], heads, [_edge(along + 90.0, w, d), _edge(along - 90.0, w, d)]
    )


def _peaks(draft: Draft, w: float, d: float, high: float) -> _Massif:
    """Three peaks apart from one another, a tarn between them."""
    first = draft.number(0, 120, "first")
    tops = []
    for k in range(3):
        turn, away = (
            math.radians(first + 120 * k + draft.number(-15, 15, "peak", k)),
            draft.number(0.55, 0.66, "peak", k, "r"),
        )
        z = high * (1.0 - 0.16 * k) + draft.number(-1, 1, "peak", k, "z")
        tops.append((*point(away * w * math.cos(turn), away * d * math.sin(turn)), round(z, 1)))
    crests = [_Crest([top], draft.number(24, 30, "width", k), 1.2) for k, top in enumerate(tops)]
    gates = [_edge(first + 60.0, w, d), _edge(first + 180.0, w, d)]
    return _Massif(crests, [top[:2] for top in tops], gates, (0.0, 0.0, draft.number(6.0, 8.0, "tarn", "radius")))


def _valley(draft: Draft, w: float, d: float, high: float) -> _Massif:
    """Two ridges along the edges, a brook between them."""
    turned = draft.chance(0.5, "turned")
    far, wide = (d, w) if turned else (w, d)
    crests, heads = [], []
    for side in (-1, 1):
        share = draft.number(0.8, 1.0, "side", side)
        line = []
        for k in range(5):
            along, off = (k / 2 - 1.0) * far, side * wide * (0.88 + 0.01 * draft.whole(-14, 2, "off", side, k))
            x, y = point(off, along) if turned else point(along, off)
            line.append((x, y, round(high * share * (0.75 + 0.25 * draft.number(0, 1, "z", side, k)), 1)))
        crests.append(_Crest(line, wide * draft.number(0.5, 0.6, "width", side)))
        heads.append(line[2][:2])
    ends = (point(0, -far - 1), point(0, far + 1)) if turned else (point(-far - 1, 0), point(far + 1, 0))
    near = 0.2 * wide
    gates = [point(side * near, -far - 1) if turned else point(-far - 1, side * near) for side in (-1, 1)]
    return _Massif(crests, heads, gates, bed=ends)


def _horn(draft: Draft, w: float, d: float, high: float) -> _Massif:
    """One steep horn with ridges that run out from it."""
    at = point(draft.number(-0.2, 0.2, "x") * w, draft.number(-0.2, 0.2, "y") * d)
    top, first, n = high * 1.15, draft.number(0, 120, "first"), draft.whole(3, 4, "ridges")
    crests = [_Crest([(*at, round(top, 1))], draft.number(24, 28, "width"), 1.2)]
    for k in range(n):
        yaw, long = first + 360 / n * k + draft.number(-15, 15, "ridge", k), draft.number(26, 38, "ridge", k, "long")
        end = point(*beside((*at, yaw), long, 0.0))
        crests.append(_Crest([(*at, round(top * 0.8, 1)), (*end, round(top * 0.25, 1))], 17.0, 1.1))
    between = first + 180 / n
    tarn = point(*beside((*at, between), 33.0, 0.0))
    fits = abs(tarn[0]) < w - 12 and abs(tarn[1]) < d - 12
    gates = [_edge(between + 180.0, w, d)]
    return _Massif(crests, [at], gates, (*tarn, draft.number(5.5, 7.5, "tarn", "radius")) if fits else None)


def _caldera(draft: Draft, w: float, d: float, high: float) -> _Massif:
    """A ring of ridges with a gap, about a lake."""
    gap = draft.number(0, 360, "gap")
    ring = []
    for k in range(10):
        turn = math.radians(gap + 28.0 + k * (304.0 / 9))
        share = 0.68 + 0.01 * draft.whole(-4, 4, "ring", k)
        z = high * (0.6 + 0.2 * draft.number(0, 1, "ring", k, "z")) * (0.75 if k in (0, 9) else 1.0)
        ring.append((*point(share * w * math.cos(turn), share * d * math.sin(turn)), round(z, 1)))
    lake = (*point(*beside((0.0, 0.0, gap), 2.0, 0.0)), draft.number(7.5, 10.0, "lake"))
    return _Massif([_Crest(ring, 19.0)], [ring[2][:2]], [_edge(gap, w, d)], lake)


_TOPOLOGIES: dict[str, Callable[[Draft, float, float, float], _Massif]] = {
    "cirque": _cirque, "pass": _pass, "peaks": _peaks, "valley": _valley, "horn": _horn, "caldera": _caldera,
}  # fmt: skip
