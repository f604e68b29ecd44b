"""Railways: stations, yards and junctions, trains on their tracks, and the town beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box
from aerialdojo_gen.scenes.worlds.streets import block_building, street_along

_SPACING_M, _EDGE_M = 4.6, 1.75  # From track to track, and from a track to a platform
_CARS_M = {"carriage": 18.8, "wagon": 13.6, "tank": 13.4}


class _Band(NamedTuple):
    """A strip of the corridor: its kind and its width; the strips lie beside one another from south to north."""

    kind: str  # track, platform, yard, street, town, green
    wide_m: float = 0.0
    x0: float = -1.0  # Where tracks and platforms begin and end, in half widths of the site
    x1: float = 1.0


def write(draft: Draft) -> None:
    """Lay the strips out, then tracks and trains, platforms, what crosses, the town, and what stands in the yards."""
    (w, d), flip = draft.half, draft.pick([1, -1], "flip")
    draft.floors |= {"platform": 1.15, "rail": 0.56, "bed": 0.35, "deck": 6.8}
    bands, crossing, bridge = _TOPOLOGIES[draft.topology](draft, d)
    tracks, boxes = list[tuple[float, float, float]](), list[tuple[str, Box]]()
    last, y = "", -d
    for band in bands:
        if band.kind == "track":
            y += _SPACING_M if last == "track" else _EDGE_M if last == "platform" else 2.6
            tracks.append((round(flip * y, 2), band.x0 * w, band.x1 * w))
        else:
            y += {"track": _EDGE_M if band.kind == "platform" else 2.6}.get(last, 0.0)
            low, high = sorted((flip * y, flip * (y + band.wide_m)))
            boxes.append((band.kind, Box(band.x0 * w, low, band.x1 * w, high)))
            y += band.wide_m
        last = band.kind
    _tracks(draft, tracks, w, crossing)
    ys, platforms = [t[0] for t in tracks], [box for kind, box in boxes if kind == "platform"]
    for platform in platforms:
        _platform(draft, platform)
    if crossing is not None:
        _crossing(draft, crossing, ys, d)
    if bridge is not None:
        _footbridge(draft, bridge, platforms)
    for kind, box in boxes:
        if kind == "street":
            draft.section("The street")
            street_along(draft, box.middle[1])
    draft.section("Landmarks")
    open_ = [box for kind, box in boxes if kind in ("yard", "town", "green")]
    spots = draft.shuffled((p for box in open_ for p in box.grown(-2.8).grid(5.0)), "spots")
    draft.landmark([(*p, draft.pick(SIDES, "landmark", *p)) for p in spots])
    for n, (kind, box) in enumerate(boxes):
        if kind == "town":
            _town(draft, box, n, 270.0 if min(ys) < box.middle[1] else 90.0)
        elif kind == "yard":
            _yard(draft, box, n)
        elif kind == "green":
            _green(draft, box, n)
    draft.fill_slots()


def _tracks(draft: Draft, tracks: Sequence[tuple[float, float, float]], w: float, crossing: float | None) -> None:
    """Lay tracks, and make up trains on most."""
    draft.section("Tracks")
    lines = [[[round(x0, 1), y], [round(x1, 1), y]] for y, x0, x1 in tracks]
    draft.make("ballast", lines=lines, material=draft.material("ballast"))
    clear = {"clear": [crossing - 3.4, -200, crossing + 3.4, 200]} if crossing is not None else {}
    draft.make("tracks", lines=lines, **clear)
    stops = []
    for k, (y, x0, x1) in enumerate(tracks):
        draft.take(shapely.box(x0, y - 2.2, x1, y + 2.2))
        stops += [["buffer_stop", round(x + (2.4 if side < 0 else -2.4), 1), y, 0.0 if side < 0 else 180.0]
                  for side, x in ((-1, x0), (1, x1)) if abs(x) < w - 1.0]  # fmt: skip
        _train(draft, k, y, x0 + 7.0, x1 - 7.0, crossing)
    if stops:
        draft.add({"place": stops, "on": "rail - 0.15", "fit": "as_is"})


def _train(draft: Draft, k: int, y: float, x0: float, x1: float, crossing: float | None) -> None:
    kind = draft.pick(["carriage", "carriage", "wagon", "tank", "none"], "train", k)
    if kind == "none":
        draft.slot("alone", draft.number(x0 + 5, x1 - 5, "alone", k), y, 0.0, (4.0, 3.2), on="rail")
        return
    number, turn = draft.whole(2, 4, "cars", k), draft.pick([0.0, 180.0], "turn", k)
    car_m = _CARS_M[kind]
    if 18.0 + number * car_m > x1 - x0:
        number = int((x1 - x0 - 18.0) // car_m)
    length = 18.0 + number * car_m
    start = x0 + draft.number(0, max(0.0, x1 - x0 - length), "start", k)
    if number < 1 or (crossing is not None and start < crossing + 5.0 and start + length > crossing - 5.0):
        start = crossing + 6.0 if crossing is not None else start
        number = min(number, int((x1 - start - 18.0) // car_m))
        if number < 1:
            return
    draft.slot("engine", start + 9.0, y, turn, (17.4, 3.3), on="rail")
    for j in range(number):
        draft.slot(kind, start + 18.0 + (j + 0.5) * car_m, y, 0.0, (18.6, 3.3), on="rail")


def _platform(draft: Draft, box: Box) -> None:
    """Build a platform with a roof over a part of it, and things along it."""
    draft.section("A platform")
    draft.make("rail_platform", box=box.rounded(), top_m="platform", floor=draft.material("platform", box.y0))
    draft.take(box.shape())
    middle, long = box.middle[1], box.width
    a = box.x0 + draft.number(0.05, 0.3, "roof", box.y0) * long
    roof = Box(a, box.y0 + 0.5, min(a + draft.number(24, 40, "roof", box.y0, "long"), box.x1 - 2), box.y1 - 0.5)
    draft.add({"category": "platform_canopy", "parts": [
        {"make": "butterfly_roof", "box": roof.rounded(), "z_m": 5.4, "foot_m": "platform",
         "rows": [round(middle, 2)], "roof": draft.material("canopy", box.y0), "frame": draft.material("frame")},
    ]})  # fmt: skip
    for k in range(int(long // 4.2)):
        x, side = box.x0 + 2.2 + 4.2 * k, 1 if k % 2 else -1
        off = min(1.3, box.depth / 2 - 1.1)
        draft.slot("platform", x, middle + side * off, 90.0 * side % 360.0, (1.9, 3.2), on="platform")


def _crossing(draft: Draft, x: float, ys: Sequence[float], d: float) -> None:
    """Lead a road over the tracks, with planks between the rails and barriers."""
    draft.section("The level crossing")
    low, high = min(ys) - 3.6, max(ys) + 3.6
    for a, b in ((-d, low), (high, d)):
        if b - a > 6.0:
            draft.make("streets", paths=[[[x, round(a, 1)], [x, round(b, 1)]]], lane_m=2.8, pavement_m=1.4)
            draft.take(shapely.box(x - 4.4, a, x + 4.4, b))
    planks = []
    for y in ys:
        for a, b in ((-0.6, 0.6), (-2.2, -0.84), (0.84, 2.2)):
            planks.append({"shape": "block", "role": "planks:#7d6a55", "z": ["bed - 0.1", "bed + 0.19"],
                           "corners": [x - 2.8, round(y + a, 2), x + 2.8, round(y + b, 2)]})  # fmt: skip
    draft.add({"node": "crossing_planks", "parts": planks})
    ends = ((x, round(low - 1.2, 2), 270.0), (x, round(high + 1.2, 2), 90.0))
    draft.add({"place": [["level_crossing_barrier", *end] for end in ends], "fit": "skip"})


def _footbridge(draft: Draft, x: float, platforms: Sequence[Box]) -> None:
    """Put up a footbridge from the first platform to the last, with stairs down to each."""
    middles = [p.middle[1] for p in platforms]
    low, high = min(middles) - 1.4, max(middles) + 1.4
    draft.section("The footbridge")
    frame = draft.material("frame")
    x0, y0, x1, y1 = Box(x - 1.6, low, x + 1.6, high).rounded()
    feet = [[u, round(y, 2)] for y in middles for u in (x0 + 0.3, x1 - 0.3)]
    parts = [
        {"shape": "block", "role": "boards:#9a8a72", "corners": [x0, y0, x1, y1], "z": ["deck - 0.1", "deck"]},
        {"shape": "block", "role": frame, "corners": [x0, y0, x1, y1], "z": ["deck - 0.45", "deck - 0.1"]},
        {"make": "round_columns", "at": feet, "z": ["platform", "deck - 0.4"], "radius_m": 0.2, "material": frame},
    ]  # fmt: skip
    for u, opened in ((x0 + 0.05, False), (x1 - 0.05, True)):
        gaps = [v for y in middles for v in (y - 1.1, y + 1.1)] if opened else []
        cuts = [y0, *gaps, y1]
        for a, b in zip(cuts[::2], cuts[1::2], strict=True):
            if b - a > 0.4:
                parts.append({"make": "railing", "path": [[u, round(a, 2)], [u, round(b, 2)]], "z_m": "deck",
                              "height_m": 1.2, "frame": frame, "pane": "glass"})  # fmt: skip
    draft.add({"node": "station_footbridge", "parts": parts})
    stairs = [
        {"make": "stairs", "foot": [round(x1 + 10.5, 2), round(y, 2)], "yaw_deg": 180, "width_m": 2.0,
         "rise_m": "deck - platform", "run_m": 10.5, "z_m": "platform", "stringer": frame}
        for y in middles
    ]  # fmt: skip
    draft.add({"node": "footbridge_stairs", "category": "stairs", "parts": stairs})
    areas = [Box(x0, y - 1.4, x1 + 11.0, y + 1.4).rounded() for y in middles]
    draft.make("keep_free", areas=areas, z=[0, "deck"])
    for k in range(int((high - low) // 5.0)):
        draft.slot("bridge", x, low + 2.5 + 5.0 * k, 0.0, (1.4, 2.6), on="deck")


def _town(draft: Draft, box: Box, n: int, toward: float) -> None:
    """Put up buildings on a strip, the station in the middle, every other front to the tracks, a square about all."""
    draft.section("Buildings beside the line")
    draft.paint(box.rounded(), draft.material("square", n), rise_m=0.12)
    deep, x, k = min(box.depth - 4.5, 11.0), box.x0 + draft.number(2, 8, "first", n), 0
    while x + 10.0 < box.x1:
        long = draft.number(12, 24, "long", n, k)
        y0 = box.middle[1] - deep / 2
        house = Box(x, y0, min(x + long, box.x1 - 1), y0 + deep)
        if draft.is_free(house.shape()) and house.width > 8.0:
            storeys = max(1, round(draft.knob("storeys")) - draft.whole(0, 1, "lower", n, k))
            street, category = toward + 180.0 * (k % 2 == 0), "station_building" if k == 1 else "town_house"
            block_building(draft, house, f"building_{n}_{k}", storeys=storeys, street_deg=street, category=category)
        else:
            long = 3.0
        x, k = x + long + draft.number(4, 12, "gap", n, k), k + 1
    draft.slots_over("square", box.grown(-1.4), 5.0, (3.4, 3.4), free_m=1.7)


def _yard(draft: Draft, box: Box, n: int) -> None:
    """Pave a goods yard with a hall at one end and goods in rows."""
    draft.section("The yard")
    draft.paint(box.rounded(), draft.material("yard", n))
    if box.depth > 14.0:
        wide, left = draft.number(22, 34, "hall", n), draft.chance(0.5, "hall_side", n)
        x0 = box.x0 + 4 if left else box.x1 - 4 - wide
        hall = Box(x0, box.middle[1] - 5.0, x0 + wide, box.middle[1] + 5.0)
        if draft.is_free(hall.shape()):
            facing = draft.pick([90.0, 270.0], "hall_front", n)
            draft.make("warehouse", box=hall.rounded(), height_m=draft.number(4.8, 6.4, "hall_high", n), name="GOODS",
                       wall=draft.material("hall", n), roof=draft.material("hall_roof", n),
                       doors=draft.material("frame"), facing_deg=facing, **{"as": f"hall_{n}"})  # fmt: skip
            draft.take(hall.grown(0.5).shape())
            draft.slots_over("roof", hall.grown(-1.8), 5.0, (4.4, 4.4), yaw_deg=facing, on=f"hall_{n}")
    draft.slots_over("yard", box.grown(-2.0), 5.6, (8.4, 4.6), "goods", free_m=2.4)


def _green(draft: Draft, box: Box, n: int) -> None:
    """Leave a strip green, with trees and what stands beside a line."""
    if box.depth < 3.0:
        return
    draft.paint(box.rounded(), draft.material("green", n))
    for x, y in box.grown(-1.4).grid(6.2):
        u, v = x + draft.number(-1.5, 1.5, "u", x, y), y + draft.number(-1, 1, "v", x, y)
        kind = "tree" if draft.chance(0.4, "tree", x, y) else "green"
        draft.slot(kind, u, v, draft.number(0, 360, "green", x, y), (3.8, 3.8))


Layout = tuple[list[_Band], float | None, float | None]  # Strips, where a road crosses, where a footbridge does


def _rest(draft: Draft, bands: list[_Band], d: float, *kinds: str) -> list[_Band]:
    """Fill the site up with strips of such kinds at both sides."""
    used = sum(b.wide_m if b.kind != "track" else 4.2 for b in bands)
    left = max(2 * d - used, 6.0)
    share = draft.number(0.35, 0.65, "share")
    first = _Band(kinds[0], round(left * share, 1))
    return [first, *bands, _Band(kinds[-1], 60.0)]


def _halt(draft: Draft, d: float) -> Layout:
    """Two tracks and two platforms in the country, a road over them."""
    x0, x1 = draft.number(-0.7, -0.5, "x0"), draft.number(0.1, 0.3, "x1")
    platform = _Band("platform", 5.2, x0, x1)
    bands = [platform, _Band("track"), _Band("track"), platform, _Band("town", 16)]
    return _rest(draft, bands, d, "green", "green"), draft.number(26, 34, "crossing"), draft.number(-20, 2, "bridge")


def _island(draft: Draft, d: float) -> Layout:
    """Four tracks with platforms between them under roofs, a footbridge, a street before the station."""
    a, b = draft.number(-0.75, -0.6, "x0"), draft.number(0.5, 0.7, "x1")
    yard, pair = _Band("yard", draft.number(10, 18, "yard")), [_Band("track"), _Band("track")]
    island, side = _Band("platform", 7.6, a, b), _Band("platform", 6.0, a, b)
    bands = [yard, *pair, island, *pair, side, _Band("town", 15), _Band("street", 11)]
    return _rest(draft, bands, d, "green", "green"), None, draft.number(-18, 18, "bridge")


def _goods(draft: Draft, d: float) -> Layout:
    """Two running lines beside a yard of sidings with halls and goods."""
    ends = [draft.number(-0.9, -0.6, "siding", k) for k in range(4)]
    sidings = [_Band("track", 0.0, end, draft.number(0.7, 0.9, "end", k)) for k, end in enumerate(ends)]
    yard = _Band("yard", draft.number(18, 24, "yard"))
    bands = [_Band("street", 11), yard, *sidings, _Band("yard", 5.0), _Band("track"), _Band("track")]
    return _rest(draft, bands, d, "green", "green"), None, None


def _terminus(draft: Draft, d: float) -> Layout:
    """Tracks that end before buffers, platforms between them."""
    end, a = draft.number(0.5, 0.62, "end"), -0.8
    side, island = _Band("platform", 6.0, a, end), _Band("platform", 7.6, a, end)
    track = _Band("track", 0.0, -1.0, end)
    bands = [side, track, track, island, track, track, side, _Band("town", 15), _Band("street", 11)]
    return _rest(draft, bands, d, "yard", "green"), None, draft.number(-12, 10, "bridge")


def _crossing_line(draft: Draft, d: float) -> Layout:
    """Three tracks through a town, streets along both sides, a level crossing."""
    a, b = draft.number(-0.7, -0.5, "x0"), draft.number(0.2, 0.35, "x1")
    street, houses, side, track = _Band("street", 11), _Band("town", 14), _Band("platform", 5.4, a, b), _Band("track")
    bands = [street, houses, side, track, track, track, side, houses, street]
    return _rest(draft, bands, d, "green", "green"), draft.number(28, 36, "crossing"), draft.number(-16, 4, "bridge")


_TOPOLOGIES = {
    "halt": _halt, "station": _island, "goods": _goods, "terminus": _terminus, "town": _crossing_line,
}  # fmt: skip
