"""Mountains: ridges, peaks and valleys with huts, paths to the summits, tarns and brooks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds import wilds
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import Point, ahead, point, towards

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
    massif = _TOPOLOGIES[draft.topology](draft, *draft.half, draft.knob("relief_m"))
    ridges = [{"line": c.line, "width_m": c.width_m, "hollow": c.hollow} for c in massif.crests]
    bench, rough = draft.number(3.5, 5.5, "bench"), draft.number(1.4, 2.6, "rough")
    draft.step("massif", ridges=ridges, bench_m=bench, rough_m=rough)
    draft.settle()
    _summits(draft, massif)
    shut = shapely.union_all([crest.shape() for crest in massif.crests])
    _cover(draft, massif.tarn)
    landings = []
    if massif.bed is not None:
        bed = wilds.brook(draft, "brook", massif.bed, 11.0)
        landings = wilds.bridged(draft, bed, draft.number(0.4, 0.6, "bridge"))
    _paths(draft, massif, landings)
    crag_area = shut.difference(shapely.union_all([shapely.Point(h).buffer(9.0) for h in massif.heads]))
    draft.take(shut)
    spots = wilds.lay_out(draft)
    draft.step("level_under_things")
    wilds.landmarks(draft, spots)
    _crags(draft, crag_area)
    wilds.strewn(draft, "slope", 34, (4.2, 4.2))
    draft.fill_slots()
    _growth(draft)


def _summits(draft: Draft, massif: _Massif) -> None:
    """Level the summits, and put a landmark on the first that has room for one."""
    draft.section("The summits")
    for head in massif.heads:
        draft.step("level_area", area={"disc": [*head, 5.0]}, blend_m=3.5)
        draft.paint({"blob": [*head, 5.4, draft.whole(0, 999, "head", *head), 0.25]}, draft.material("glade"))
    draft.landmark([(*head, draft.number(0, 360, "head", *head, "yaw")) for head in massif.heads[:1]], of=_SUMMITS)
    for head in massif.heads:
        wilds.about(draft, "summit", head, (3.4, 4.8), 5, (2.8, 2.8))


def _cover(draft: Draft, tarn: tuple[float, float, float] | None) -> None:
    """Paint meadows, snow where it is high and gentle, scree and rock where it is steep; fill the tarn."""
    draft.section("What covers the ground")
    wilds.patches(draft, "patch", 3, 40, [2.5, 7.5], 999)
    draft.make("steep_ground", slope=0.8, **{"as": "faces"})
    draft.paint({"area": "faces", "grow_m": [1.1, 2]}, draft.material("scree"))
    draft.paint("faces", draft.material("rock"))
    if "snow" in draft.palette.materials:
        draft.make("high_ground", above_m=round(draft.knob("relief_m") * 0.82, 1), slope=0.7, **{"as": "snowfields"})
        draft.paint({"area": "snowfields", "plus": {"disc": [0, 0, 0.1]}}, draft.material("snow"))
    if tarn is not None:
        x, y, radius = tarn
        draft.step("level_area", area={"disc": [x, y, radius + 4.0]}, blend_m=6)
        draft.step("sink_area", area={"disc": [x, y, radius + 1.0]}, depth_m=1.0, blend_m=2.5)
        draft.areas["water"] = {"blob": [x, y, round(radius - 1.0, 1), draft.whole(0, 999, "tarn"), 0.18]}
        wilds.water(draft)
        wilds.about(draft, "shore", (x, y), (radius + 2.4, radius + 4.0), 9, (4.8, 3.6))
        draft.take_disc((x, y), radius + 5.0)


def _paths(draft: Draft, massif: _Massif, landings: Sequence[Point]) -> None:
    lines = {}
    for k, (gate, head) in enumerate(zip(massif.gates, massif.heads, strict=False)):
        foot = point(*ahead(head, towards(head, gate), 5.5))
        lines[f"path_{k}"] = wilds.winding(draft, f"path_{k}", (gate, foot), 9.0, 5)
    for landing in landings[1:]:
        gate = min(massif.gates, key=lambda g: math.dist(g, landing))
        lines["over"] = wilds.winding(draft, "over", (landing, gate), 3.0, 2)
    wilds.tread(draft, lines)


def _crags(draft: Draft, area: BaseGeometry) -> None:
    """Pile crags on the flanks."""
    rng, (x0, y0, x1, y1) = draft.rng("crags"), area.bounds
    inner = draft.site.grown(-5.0).shape()
    ways = [shapely.LineString(line["points"]) for line in draft.lines.values()]
    crags: list[dict[str, Any]] = []
    for k in range(160):
        at = point(rng.uniform(x0, x1), rng.uniform(y0, y1))
        spot = shapely.Point(at)
        clear = all(math.dist(at, c["at"]) > 12.0 for c in crags) and all(way.distance(spot) >= 7.0 for way in ways)
        if len(crags) < 8 and clear and inner.contains(spot) and area.contains(spot):
            radius = draft.number(2.6, 4.2, "crag", k)
            high = round(radius * draft.number(1.2, 1.9, "high", k), 1)
            crags.append({"at": list(at), "radius_m": radius, "height_m": high})
    if crags:
        draft.section("Crags")
        draft.make("crags", crags=crags, materials=[draft.material("rock"), draft.material("dark")])


def _growth(draft: Draft) -> None:
    """Plant woods below the tree line, dwarf spruces and flowers above, boulders at the feet of rocks."""
    draft.section("Woods and boulders")
    water = [{"area": "water", "grow_m": 1.0}] if "water" in draft.areas else []
    ground = {"box": list(draft.site.grown(-1.5)), "minus": ["faces", *water]}
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
    at = point(*ahead((0.0, 0.0), open_deg + 180.0, 8.0, draft.number(-6, 6, "tarn")))
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
    (x0, y0), (x1, y1) = _edge(along, w, d), _edge(along + 180.0, w, d)
    saddle = draft.number(0.4, 0.6, "saddle")
    crest = []

    def between(f: float) -> Point:
        return x0 + f * (x1 - x0), y0 + f * (y1 - y0)

    for k in range(7):
        f = k / 6
        dip = 1.0 - 0.5 * max(0.0, 1.0 - abs(f - saddle) / 0.22)
        at = ahead(between(f), along, 0.0, draft.number(-8, 8, "crest", k))
        crest.append((*point(*at), round(high * dip + draft.number(-1.5, 1.5, "crest", k, "z"), 1)))
    heads = [point(*between(saddle))] * 2  # A path comes up from either side
    gates = [_edge(along + 90.0, w, d), _edge(along - 90.0, w, d)]
    return _Massif([_Crest(crest, draft.number(24, 30, "width"))], heads, gates)


def _peaks(draft: Draft, w: float, d: float, high: float) -> _Massif:
    """Three peaks apart from one another, a tarn between them."""
    first = draft.number(0, 120, "first")
    tops = []
    for k in range(3):
        turn = math.radians(first + 120 * k + draft.number(-15, 15, "peak", k))
        away = draft.number(0.55, 0.66, "peak", k, "r")
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
        end = point(*ahead(at, yaw, long))
        crests.append(_Crest([(*at, round(top * 0.8, 1)), (*end, round(top * 0.25, 1))], 17.0, 1.1))
    between = first + 180 / n
    tarn = point(*ahead(at, between, 33.0))
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
    lake = (*point(*ahead((0.0, 0.0), gap, 2.0)), draft.number(7.5, 10.0, "lake"))
    return _Massif([_Crest(ring, 19.0)], [ring[2][:2]], [_edge(gap, w, d)], lake)


_TOPOLOGIES = {
    "cirque": _cirque, "pass": _pass, "peaks": _peaks, "valley": _valley, "horn": _horn, "caldera": _caldera,
}  # fmt: skip
