"""Sports grounds: pitches and tracks with stands about them, forecourts, courts and car parks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box
from aerialdojo_gen.scenes.worlds.streets import block_building, edge_slots, street_along

_TREAD_M = 0.85
_WORDS = ["ENERGY", "BANK", "RADIO", "FRESH", "TRAVEL", "CITY", "SPORT"]
_INKS = [("#c9382e", "#f1f0ea"), ("#e9b52a", "#26282c"), ("#2f5f9e", "#f1f0ea"), ("#3f7d4e", "#f1f0ea")]


class _Ground(NamedTuple):
    """The pitch: half extents of the core that stands are about, and how far off they begin."""

    half_x: float
    half_y: float
    front_m: float
    y: float  # Where its middle is, north of the site's

    def core(self) -> Box:
        """Rectangle that stands are about."""
        return Box.about(0.0, self.y, 2 * self.half_x, 2 * self.half_y)

    def back(self, rows: int) -> float:
        """How far from the core a stand of so many rows ends."""
        return self.front_m + rows * _TREAD_M


def write(draft: Draft) -> None:
    """Lay the street and the forecourt, then the pitch and its stands, courts, and what belongs about them."""
    (w, d), flip = draft.half, draft.pick([1, -1], "flip")
    draft.section("The street and the forecourt")
    street = -flip * (d - 5.6)
    half = street_along(draft, street)
    ground = _Ground(draft.number(18.5, 21.0, "half_x"), draft.number(10.5, 12.5, "half_y"),
                     13.0 if draft.topology == "athletics" else 6.0, flip * draft.number(5.5, 8.0, "y"))  # fmt: skip
    draft.areas["core"] = ground.core().rounded()
    edge = street + flip * (half + 0.4)
    low, high = sorted((edge, ground.y - flip * (ground.half_y + ground.back(9) + 1.0)))
    forecourt = Box(-w + 3, low, w - 3, high)
    draft.paint(forecourt.rounded(), draft.material("plaza"))
    draft.paint({"area": "core", "grow_m": round(ground.back(9) + 4.0, 1)}, draft.material("plaza", "about"))
    taken = _TOPOLOGIES[draft.topology](draft, ground, flip)
    _pitch(draft, ground)
    _car_park(draft, forecourt, flip)
    draft.section("Landmarks")
    for area in taken:
        draft.take(area)
    draft.take(ground.core().grown(2.0).shape())
    spots = [p for p in draft.site.grown(-3.2).grid(4.0) if draft.has_room(*p, 2.6)]
    draft.landmark([(*p, 270.0 if p[1] > ground.y else 90.0) for p in draft.shuffled(spots, "spots")])
    _courts(draft)
    edge_slots(draft, "tree", draft.site.grown(-2.2), 6.0, (3.4, 3.4))
    for x, y in draft.site.grown(-2.6).grid(5.2):
        if draft.has_room(x, y, 1.9):
            kind = "forecourt" if forecourt.shape().contains(shapely.Point(x, y)) else "about"
            draft.slot(kind, x, y, draft.pick(SIDES, "about", x, y), (4.4, 4.4))
    draft.fill_slots()


def _pitch(draft: Draft, ground: _Ground) -> None:
    """Mow and mark the pitch, and set up goals, dugouts and boards beside it."""
    core, y = ground.core(), round(ground.y, 2)
    half = [round(ground.half_x + 1.5, 1), round(ground.half_y + 1.8, 1)]
    draft.section("The pitch")
    draft.make(
        "football_pitch", at=[0, y], half_m=half, turf=draft.material("turf"), light=draft.material("turf_light"),
        stripes=draft.whole(8, 14, "stripes"),
    )  # fmt: skip
    goals = [["goal_post", round(side * (half[0] - 0.6), 2), y, 180.0 if side > 0 else 0.0] for side in (-1, 1)]
    draft.add({"place": goals, "fit": "as_is"})
    draft.slots_over("pitch", Box(core.x0 + 4, core.y0 + 1, core.x1 - 4, core.y1 - 1), 6.2, (4.4, 4.4))
    side = draft.pick([-1, 1], "benches")
    for k in range(6):
        x = -core.x1 + (k + 0.5) * core.width / 6
        draft.slot("touchline", x, ground.y + side * (half[1] + 1.6), 270.0 if side > 0 else 90.0, (2.2, 7.2))
    boards = []
    for k in range(int(core.width // 4.8)):
        word, (paint, ink) = draft.pick(_WORDS, "board", k), draft.pick(_INKS, "ink", k)
        x, v = round(core.x0 + 2.4 + 4.8 * k, 2), round(ground.y - side * (half[1] + 1.4), 2)
        boards.append([x, v, side, word, paint, ink])
    parts = [{"make": "hoardings", "boards": boards}]
    draft.add({"node": "hoardings", "category": "advertising_boards", "parts": parts})


def _stand(draft: Draft, ground: _Ground, name: str, rows: int, region: Sequence[float]) -> shapely.Polygon:
    """Put up a stand in a part of the ring about the core, with a wall behind it; gives the ground it takes."""
    box = [round(v, 2) for v in region]
    tier = {"core": "core", "front_m": ground.front_m, "rows": rows, "z_m": 1.1, "region": box}
    seats = draft.material("seats").split("+")
    stripes = {"width_m": draft.number(3, 8, "stripes", name), "shift_m": draft.number(0, 2.6, "shift", name)}
    draft.make("stand", node=f"{name}_stand", seats=seats, concrete=draft.material("terrace"), stripes=stripes,
               step="concrete:#d8d5cc", tier=tier)  # fmt: skip
    wall = {
        "make": "stand_back_wall", "tier": tier, "top_m": round(1.1 + rows * 0.42 + 1.0, 2), "gates": [],
        "gate_m": [3, 3.2], "wall": draft.material("wall"), "band": seats[0],
    }  # fmt: skip
    draft.add({"node": f"{name}_stand_walls", "category": "wall", "parts": [wall]})
    core = ground.core().shape()
    ring = core.buffer(ground.back(rows) + 0.8).difference(core.buffer(ground.front_m - 0.6))
    return ring.intersection(shapely.box(*region))


def _roof(draft: Draft, ground: _Ground, name: str, rows: int, side: int, long_m: float) -> None:
    """Hang a roof over a stand along x, on the north for side 1."""
    y = ground.y + side * (ground.half_y + ground.back(rows) + 0.7)
    draft.add({"node": f"{name}_roof", "category": "stand_roof", "parts": [
        {"make": "cantilever_roof", "at": [0, round(y, 2)], "yaw_deg": -90 if side > 0 else 90,
         "size_m": [round(long_m, 1), draft.number(7.5, 10.0, "roof", name)],
         "z_m": round(1.1 + rows * 0.42 + 4.2, 1), "rise_m": 1.8, "roof": draft.material("roof"),
         "truss": "#f1f0ea", "fascia": draft.material("seats").split("+")[0]},
    ]})  # fmt: skip


def _side_stand(
    draft: Draft, ground: _Ground, name: str, rows: int, side: int, half_m: float
) -> shapely.Polygon:  # fmt: skip
    """Put up a stand with a roof along x, on the north for side 1."""
    edge = ground.y + side * ground.half_y
    y0, y1 = sorted((edge, edge + side * 90.0))
    area = _stand(draft, ground, name, rows, (-half_m, y0, half_m, y1))
    _roof(draft, ground, name, rows, side, 2 * half_m)
    return area


def _bowl(draft: Draft, ground: _Ground, flip: int) -> list[shapely.Polygon]:
    """Stands all round the pitch, a roof over one side or two."""
    rows = draft.whole(8, 11, "rows")
    draft.section("The stands")
    area = _stand(draft, ground, "bowl", rows, (-90, -90, 90, 90))
    for side in (-1, 1) if draft.chance(0.5, "roofs") else (flip,):
        _roof(draft, ground, "north" if side > 0 else "south", rows, side, 2 * ground.half_x)
    return [area]


def _facing(draft: Draft, ground: _Ground, flip: int) -> list[shapely.Polygon]:
    """Two stands that face one another under roofs, banks of grass at the ends."""
    areas = []
    for side, name in ((-1, "south"), (1, "north")):
        draft.section(f"The {name} stand")
        rows = draft.whole(6, 11, "rows", side)
        areas.append(_side_stand(draft, ground, name, rows, side, ground.half_x - 1.0))
    return areas


def _horseshoe(draft: Draft, ground: _Ground, flip: int) -> list[shapely.Polygon]:
    """Stands at three sides, open at one end."""
    rows, open_ = draft.whole(8, 11, "rows"), draft.pick([-1, 1], "open")
    x0, x1 = (-90.0, ground.half_x - 2.0) if open_ > 0 else (-ground.half_x + 2.0, 90.0)
    draft.section("The stands")
    area = _stand(draft, ground, "horseshoe", rows, (x0, -90, x1, 90))
    _roof(draft, ground, "north" if flip > 0 else "south", rows, flip, 2 * ground.half_x - 6.0)
    return [area]


def _athletics(draft: Draft, ground: _Ground, flip: int) -> list[shapely.Polygon]:
    """A running track about the pitch, one stand along it."""
    y, reach = round(ground.y, 2), ground.half_x - 4.0
    draft.section("The track")
    line = [[-reach, y], [reach, y]]
    inner = ground.half_y + 3.0
    draft.make(
        "running_track", line=line, inner_m=round(inner, 1), lanes=6, lane_m=1.1, track=draft.material("track"),
        apron=draft.material("track", "apron"), turf=draft.material("turf"),
    )  # fmt: skip
    for k in range(16):
        x, side = -reach + (k + 0.5) * reach / 8, 1 if k % 2 else -1
        draft.slot("track", x, y + side * (inner + draft.number(1.5, 5.0, "lane", k)), 0.0, (4.4, 10.4))
    for side in (-1, 1):
        for v in (-0.4, 0.4):
            draft.slot("field", side * (reach + 0.6 * inner), y + v * inner, 90.0, (6.2, 7.0))
    draft.section("The stand")
    area = _side_stand(draft, ground, "main", draft.whole(7, 10, "rows"), flip, reach)
    return [area, shapely.LineString(line).buffer(inner + 8.6)]


def _village(draft: Draft, ground: _Ground, flip: int) -> list[shapely.Polygon]:
    """A small stand and a clubhouse beside a pitch, courts about it."""
    rows, x = draft.whole(4, 6, "rows"), draft.number(9, 13, "stand")
    draft.section("The stand and the clubhouse")
    area = _side_stand(draft, ground, "village", rows, flip, x)
    side = draft.pick([-1, 1], "clubhouse")
    out = side * (ground.half_x + 9.0)
    low, high = sorted((out, out + side * 9.0))
    box = Box(low, ground.y - 8.0, high, ground.y + 8.0)
    storeys, facing = draft.whole(1, 2, "storeys"), 180.0 if side > 0 else 0.0
    block_building(draft, box, "clubhouse", storeys=storeys, street_deg=facing, category="clubhouse")
    return [area, ground.core().shape().buffer(5.0)]


def _car_park(draft: Draft, forecourt: Box, flip: int) -> None:
    """Mark bays on one half of the forecourt."""
    side, count = draft.pick([-1, 1], "bays"), draft.whole(8, 12, "bays", "n")
    if forecourt.depth < 13.0:
        return
    x = side * (forecourt.x1 - 3.0 - count * 1.35)
    front, yaw = (forecourt.y1 - 0.6, 270.0) if flip > 0 else (forecourt.y0 + 0.6, 90.0)
    mouth = front - flip * 5.2
    low, high = sorted((front, mouth - flip * 5.0))
    box = Box(x - count * 1.35, low, x + count * 1.35, high)
    if not draft.is_free(box.shape()):
        return
    draft.paint(box.rounded(), draft.material("street"))
    draft.make("parking_rows", rows=[[round(x, 2), round(mouth, 2), yaw, count]], occupancy=draft.knob("occupancy"))
    draft.take(box.shape())


def _courts(draft: Draft) -> None:
    """Lay out courts where there is room: for tennis, balls, and a playground."""
    for k in range(3):
        wide, deep = (15.0, 10.0) if draft.chance(0.5, "court", k) else (10.0, 15.0)
        for x, y in draft.shuffled(draft.site.grown(-2.0).grid(3.4), "court", k):
            box = Box.about(x, y, wide, deep)
            if draft.is_free(box.grown(0.6).shape()):
                draft.paint(box.rounded(), draft.material("court", k))
                draft.make("outline_marks", areas=[box.grown(-0.7).rounded()], width_m=0.1)
                draft.slots_over("court", box, 5.0, (4.6, 4.6))
                draft.take(box.grown(0.4).shape())
                break


_TOPOLOGIES = {
    "bowl": _bowl, "facing": _facing, "athletics": _athletics, "village": _village, "horseshoe": _horseshoe,
}  # fmt: skip
