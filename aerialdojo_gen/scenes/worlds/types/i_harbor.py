"""Harbours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, Point, Pose, ahead, heading, smoothed, towards
from aerialdojo_gen.scenes.worlds.shores import afloat, jetty, walls
from aerialdojo_gen.scenes.worlds.wilds import trees

_NAMES = ("FISH MARKET", "PORT OFFICE", "SHED", "ICE HOUSE", "CUSTOMS", "ROPE WORKS", "COLD STORE", "SHIP CHANDLER",
          "BOATYARD", "FERRY", "GRAIN STORE", "SAILMAKER", "NORTH QUAY", "TIMBER", "DRY DOCK", "COFFEE")  # fmt: skip


class _Port:
    """A harbour laid out with its water in the south, and mirrored as the seed has it."""

    def __init__(self, draft: Draft) -> None:
        self.draft, (self.w, self.d) = draft, draft.half
        self.fx, self.fy = draft.pick([1.0, -1.0], "flip_x"), draft.pick([1.0, -1.0], "flip_y")
        self.land: BaseGeometry = shapely.Polygon()
        self.halls = 0

    def at(self, x: float, y: float) -> Point:
        """Point as the plan has it."""
        return round(self.fx * x, 2), round(self.fy * y, 2)

    def box(self, x0: float, y0: float, x1: float, y1: float) -> Box:
        """Box as the plan has it."""
        return Box(*shapely.LineString([self.at(x0, y0), self.at(x1, y1)]).bounds)

    def yaw(self, yaw_deg: float) -> float:
        """Direction as the plan has it."""
        c, s = self.fx * math.cos(math.radians(yaw_deg)), self.fy * math.sin(math.radians(yaw_deg))
        return round(towards((0.0, 0.0), (c, s)) % 360.0, 1)

    def line(self, points: Sequence[Point]) -> list[Point]:
        """Points as the plan has them."""
        return [self.at(*p) for p in points]

    def slot(self, kind: str, x: float, y: float, yaw_deg: float, room_m: Point, on: str | None = None) -> None:
        """Offer a place to what fits there."""
        self.draft.slot(kind, *self.at(x, y), self.yaw(yaw_deg), room_m, on=on)

    def quays(self, boxes: Sequence[tuple[float, float, float, float]]) -> None:
        """Lay the quays out of the water."""
        draft = self.draft
        draft.floors |= {"sea": 0.0, "quay": 2.0, "jetty": 1.3}
        self.land = shapely.union_all([self.box(*b).shape() for b in boxes])
        draft.areas["land"] = {"union": [self.box(*b).rounded() for b in boxes]}
        draft.section("The quays")
        paving, edge = draft.material("paving"), draft.material("edge")
        draft.make("quay", area="land", height_m="quay", material=paving, edge=edge)

    def paved(self, box: tuple[float, float, float, float], role: str) -> None:
        """Pave a part of a quay in another way."""
        material = self.draft.material(role)
        self.draft.paint(self.box(*box).rounded(), material, rise_m="quay", edge=material)


def write(draft: Draft) -> None:
    """Lay quays, berths and what stands on them as the topology has it, then a breakwater, boats and things."""
    port = _Port(draft)
    draft.head["placing"] = {"margin_m": 0.3}
    heads = _TOPOLOGIES[draft.topology](port, port.w, port.d)
    afloat(draft, port.land, 9)
    draft.take(draft.site.shape().difference(port.land))
    draft.section("Landmarks")
    if draft.chance(0.8, "lighthouse"):
        draft.landmark(heads, of=["lighthouse"])
    whole = Box(*port.land.bounds)
    room = [(*p, port.yaw(-90)) for p in draft.shuffled(whole.grown(-6).grid(7.0), "landmarks")]
    draft.landmark([*heads, *room], of=[what for what in draft.kind.landmarks if what != "container_crane"])
    free = [p for p in whole.grown(-4.0).grid(5.6) if draft.has_room(*p, 2.9)]
    for x, y in draft.shuffled(free, "yard")[: round(draft.knob("goods"))]:
        draft.slot("yard", x, y, draft.pick(SIDES, "yard", x, y), (6.4, 4.6))
    draft.fill_slots()


def _edge(port: _Port, a: Point, b: Point, *, ships: bool = True, key: str = "") -> None:
    """Fit an edge of a quay out, walked with the water on its right: fenders, berths, and what stands along it."""
    draft = port.draft
    line = port.line([a, b] if port.fx * port.fy > 0 else [b, a])
    draft.make("fenders", edges=[line])
    length, yaw = math.dist(a, b), towards(a, b)
    for k in range(int(length // 6.2)):
        port.slot("edge", *ahead(a, yaw, 3.1 + 6.2 * k, 1.5), yaw - 90, (2.6, 2.9))
    for k in range(int(length // 15.0)):
        kind = "crane" if k == int(length // 30.0) else "apron"
        port.slot(kind, *ahead(a, yaw, 7.5 + 15.0 * k, 6.4), yaw if kind == "apron" else yaw - 90, (17.4, 4.9))
    at, k = 3.0, 0
    while ships and at < length - 12.0:
        big = length - at > 48.0 and draft.chance(0.65, "big", key, k)
        long, off = (45.0, 5.3) if big else (14.4, 3.6)
        turn = draft.pick([0.0, 180.0], "turn", key, k)
        if at + long < length + 1.0:
            berth = ahead(a, yaw, at + long / 2, -off)
            port.slot("ship" if big else "berth", *berth, yaw + turn, (44.6, 9.2) if big else (14.2, 5.6), on="sea")
        at, k = at + long + 3.0, k + 1
    if ships:
        strip = [port.at(*ahead(a, yaw, s, -o)) for s, o in ((0, 0), (length, 0), (length, 11.0), (0, 11.0))]
        draft.take(shapely.Polygon(strip).buffer(-0.1))
    draft.take(shapely.LineString([port.at(*ahead(a, yaw, s, 5.0)) for s in (1.0, length - 1.0)]).buffer(4.0))


def _jetties(port: _Port, xs: Sequence[float], y: float, longest_m: float) -> None:
    for k, x in enumerate(xs):
        length = port.draft.number(max(14.0, longest_m - 9.0), longest_m, "jetty", k)
        jetty(port.draft, port.land, port.at(x, y), port.yaw(-90), length)


def _mole(port: _Port, points: Sequence[Point]) -> list[Pose]:
    """Heap up a breakwater with a paved way; its head has room for a lighthouse, which is given."""
    draft, path = port.draft, smoothed([port.at(*p) for p in points], 2)
    draft.section("The breakwater")
    draft.lines["mole"] = {"points": port.line(points), "smooth": 2}
    draft.make("breakwater", path="mole", top_m="quay", seed=draft.whole(0, 999, "mole"))
    x, y = points[-1]
    head = port.box(x - 6.2, y - 6.2, x + 6.2, y + 6.2)
    draft.paint(head.rounded(), draft.material("paving"), rise_m="quay", edge=draft.material("edge"))
    for k in range(int((path.length - 12) // 9)):
        px, py, yaw = heading(path, 6 + 9 * k)
        draft.slot("mole", px, py, yaw + 90, (1.8, 3.0), on="quay")
    rocks = path.difference(port.land.union(head.shape())).buffer(6.0)
    draft.take(rocks.difference(head.shape()))
    port.land = port.land.union(head.shape())
    return [(*port.at(x, y), port.yaw(180)), (*port.at(x, y), port.yaw(90))]


def _hall(port: _Port, x0: float, y0: float, x1: float, y1: float, facing: float = -90.0) -> None:
    """Put up a hall, with slots before its front and on its roof."""
    draft, k = port.draft, port.halls
    port.halls += 1
    box, pitched = port.box(x0, y0, x1, y1), draft.chance(0.45, "pitched", k)
    draft.make(
        "warehouse", box=box.rounded(), height_m=draft.number(4.6, 7.4, "hall", k), wall=draft.material("hall", k),
        roof=draft.material("roof" if pitched else "flat_roof", k), doors=draft.material("doors", k), on="quay",
        name=draft.shuffled(_NAMES, "names")[k % len(_NAMES)], facing_deg=port.yaw(facing), **{"as": f"hall_{k}"},
        **({"ridge_m": draft.number(1.6, 2.6, "ridge", k)} if pitched else {}),
    )  # fmt: skip
    draft.take(box.grown(0.4).shape())
    out, wide = ((y1 - y0) / 2, x1 - x0) if facing % 180 == 90 else ((x1 - x0) / 2, y1 - y0)
    for j in range(int(wide // 4.4)):
        v = 4.4 * (j + 0.5 - int(wide // 4.4) / 2)
        port.slot("front", *ahead(((x0 + x1) / 2, (y0 + y1) / 2), facing, out + 1.8, v), facing, (2.4, 3.6))
    if not pitched:
        draft.slots_over("roof", box.grown(-1.8), 5.0, (3.2, 3.4), yaw_deg=port.yaw(facing), on=f"hall_{k}")


def _halls(port: _Port, x0: float, x1: float, y: float, depth_m: float) -> None:
    """Put up a row of halls from x0 to x1, fronts to the water."""
    at, k = x0, 0
    while at < x1 - 12.0:
        wide = min(port.draft.number(13, 24, "wide", x0, k), x1 - at)
        _hall(port, at, y, at + wide, y + depth_m)
        at, k = at + wide + port.draft.number(5, 9, "gap", x0, k), k + 1


def _houses(port: _Port, x0: float, x1: float, y: float) -> None:
    """Put up a row of narrow houses, fronts to the water."""
    draft = port.draft
    pitch, high = draft.number(6.8, 8.6, "pitch"), draft.knob("storeys")
    xs = [x0 + pitch * (k + 0.5) for k in range(int((x1 - x0) // pitch))]
    draft.make(
        "house_row", at=port.line([(x, y) for x in xs]), yaw_deg=port.yaw(-90), on="quay",
        style={"width_m": 6.2, "depth_m": 6.4, "storey_m": 2.7, "roof_m": draft.number(2.2, 3.0, "roof_m"),
               "overhang_m": 0.15},
        walls=walls(draft, 7, "houses"), roofs=[draft.material("roof", k) for k in range(3)],
        doors=["#d9a24a", "#5a6f94", "#b8493c"], storeys=[draft.whole(1, high, "storeys", k) for k in range(5)],
        chimneys=[True, False, False],
    )  # fmt: skip
    draft.take(port.box(x0, y - 3.6, x1, y + 3.6).shape())
    for x in xs:
        port.slot("front", x + 1.9, y - 4.9, -90.0, (2.4, 2.6))


def _garden(port: _Port, box: tuple[float, float, float, float]) -> None:
    """Plant a strip of green behind the houses."""
    port.paved(box, "green")
    draft, area = port.draft, port.box(*box).grown(-1.6)
    trees(draft, area.rounded(), 6.5, 18, fit="skip")
    draft.take(area.shape())
    draft.slots_over("garden", area, 8.0, (3.0, 3.0), yaw_deg=port.yaw(-90))


def _road(port: _Port, y: float) -> None:
    """Lead a road along the back of the quays."""
    draft = port.draft
    port.paved((-port.w + 0.6, y - 3.4, port.w - 0.6, y + 3.4), "road")
    draft.make("dashed_marks", lines=[port.line([(-port.w + 1, y), (port.w - 1, y)])], rise_m="quay")
    draft.take(port.box(-port.w, y - 3.6, port.w, y + 3.6).shape())
    for k in range(int(port.w * 2 // 13)):
        port.slot("road", -port.w + 7 + 13 * k, y - 1.7 + 3.4 * (k % 2), 180.0 * (k % 2), (12.0, 2.9))


def _stacks(port: _Port, x0: float, y0: float, x1: float, y1: float) -> None:
    """Stack containers in blocks with lanes between them."""
    draft, tall = port.draft, round(port.draft.knob("tiers"))
    stacks, columns = [], int((x1 - x0 + 7.0) // 33.0)
    for i, j in product(range(columns), range(int((y1 - y0 + 7.0) // 20.5))):
        box = port.box(x0 + 33.0 * i, y0 + 20.5 * j, x0 + 33.0 * i + 25.4, y0 + 20.5 * j + 13.2)
        stacks.append(
            {"at": [box.x0, box.y0], "tiers": draft.rng("stack", i, j).integers(0, tall + 1, (2, 5)).tolist()}
        )
        draft.make("outline_marks", areas=[box.grown(0.5).rounded()], material="marking_yellow", rise_m="quay")
        draft.take(box.grown(0.6).shape())
    if not stacks:
        raise NoRoomError("no room for containers")
    draft.make("container_stacks", on="quay", stacks=stacks)
    masts = [port.at(x0 + 33.0 * i - 3.6, y0 - 3.6) for i in range(1, columns)]
    if masts:
        draft.make("light_masts", at=masts, foot_m="quay", top_m=draft.number(15, 18, "masts"))
        draft.take(shapely.MultiPoint(masts).buffer(1.2))


def _heaps(port: _Port, at: Sequence[Point]) -> None:
    draft = port.draft
    if at:
        heaps = [[*port.at(*p), draft.number(3.6, 5.4, "heap", *p), draft.material("bulk", *p)] for p in at]
        draft.make("bulk_heaps", on="quay", heaps=heaps)
        draft.take(shapely.MultiPoint([port.at(*p) for p in at]).buffer(6.4))


def _crane(port: _Port, a: Point, b: Point) -> None:
    """Lay the rails of a container crane behind an edge along x, and mostly put one there."""
    port.draft.make("crane_rails", lines=[port.line([(a[0], a[1] + o), (b[0], b[1] + o)]) for o in (3, 15)],
                    rise_m="quay")  # fmt: skip
    spots = [(*port.at(a[0] + f * (b[0] - a[0]), a[1] + 9.0), port.yaw(-90)) for f in (0.3, 0.75, 0.5)]
    if port.draft.chance(0.85, "crane"):
        port.draft.landmark(port.draft.shuffled(spots, "crane_spots"), of=["container_crane"])


def _terminal(port: _Port, w: float, d: float) -> list[Pose]:
    """One long quay with container cranes, stacks behind it and a breakwater before it."""
    q = -d * 0.22
    port.quays([(-w, q, w, d)])
    split = w * port.draft.number(0.35, 0.5, "split")
    port.paved((-w + 1, q + 1.2, split, q + 18), "apron")
    _crane(port, (-w + 4, q), (split, q))
    _edge(port, (-w + 1, q), (w - 1, q))
    _road(port, d - 5.5)
    _stacks(port, -w + 6, q + 22, split, d - 12)
    _halls(port, split + 6, w - 3, d - 24, 12.0)
    return _mole(port, [(w - 5, q - 1), (w - 8, -d + 14), (w * 0.55, -d + 8), (w * 0.12, -d + 9)])


def _basin(port: _Port, w: float, d: float) -> list[Pose]:
    """Quays about three sides of a basin with jetties, halls and houses behind."""
    q, low, left, right = d * 0.12, -d * 0.5, -w * 0.62, w * 0.6
    port.quays([(-w, q, w, d), (-w, low, left, q), (right, low, w, q)])
    _road(port, d - 5.5)
    _edge(port, (left, low + 1), (left, q - 1), key="west")
    _edge(port, (right, q - 1), (right, low + 1), key="east")
    _edge(port, (left + 1, q), (right - 1, q), ships=False)
    number = port.draft.whole(2, 3, "jetties")
    inner = (left + 19, right - 19)
    xs = [inner[0] + (inner[1] - inner[0]) * (k + 0.5) / number for k in range(number)]
    _jetties(port, xs, q, min(28.0, q - low - 6))
    _halls(port, -w + 4, -w * 0.05, d - 24, 12.5)
    _houses(port, w * 0.02, w - 3, d - 16)
    _garden(port, (right + 14, low + 1, w - 1, low + 26))
    return _mole(port, [(left - 6, low + 1), (left - 5, -d + 16), (left + 16, -d + 9), (w * 0.05, -d + 9)])


def _fingers(port: _Port, w: float, d: float) -> list[Pose]:
    """Two or three broad piers out from a shore, ships at both sides of them, sheds upon them."""
    q, low, wide = d * 0.3, -d * 0.68, port.draft.number(23, 26, "wide")
    number = 3 if w > 84 else 2
    xs = [-w + (2 * w) * (k + 0.5) / number - wide / 2 for k in range(number)]
    port.quays([(-w, q, w, d), *((x, low, x + wide, q) for x in xs)])
    _road(port, d - 5.5)
    for k, x in enumerate(xs):
        _edge(port, (x + wide, low + 1), (x + wide, q - 1), key=f"east{k}")
        _edge(port, (x, q - 1), (x, low + 1), key=f"west{k}")
        middle, reach = x + wide / 2, q - low
        if k % 2 == 0:
            out = port.draft.pick([0.0, 180.0], "out", k)
            _hall(port, middle - 3.4, low + reach * 0.36, middle + 3.4, q - 4, out)
        else:
            _heaps(port, [(middle, low + 14 + 13 * j) for j in range(int((reach - 20) // 13))])
    _halls(port, -w + 4, w * 0.2, d - 22, 10.5)
    _houses(port, w * 0.28, w - 3, d - 14)
    return [(*port.at(x + wide / 2, low + 9), port.yaw(-90)) for x in (xs[0], xs[-1])]


def _marina(port: _Port, w: float, d: float) -> list[Pose]:
    """A front of houses, jetties before it, a boatyard at its end, a mole about it."""
    q, low, yard = d * 0.3, -d * 0.42, w * 0.56
    port.quays([(-w, q, w, d), (yard, low, w, q)])
    _road(port, q + 13.5)
    _edge(port, (-w + 1, q), (yard - 1, q), ships=False)
    _edge(port, (yard, q - 1), (yard, low + 1), key="yard")
    first, last = -w + 22, yard - 21
    number = max(2, int((last - first) // 22))
    xs = [first + (last - first) * k / (number - 1) for k in range(number)]
    _jetties(port, xs, q, min(30.0, q + d - 30))
    _hall(port, yard + 12, low + 12, w - 2, q - 6, 180.0)
    _houses(port, -w + 3, w * 0.5, q + 23)
    _garden(port, (-w + 1, q + 28, w - 1, d - 1))
    _halls(port, w * 0.55, w - 2, q + 19.4, 7.6)
    return _mole(port, [(-w + 6, q - 1), (-w + 6, -d + 18), (-w + 20, -d + 9), (-w * 0.1, -d + 9)])


def _channel(port: _Port, w: float, d: float) -> list[Pose]:
    """Quays at both sides of a channel: halls on one, containers or bulk goods on the other."""
    q, south = d * 0.26, -d * 0.34
    end = w * port.draft.number(0.4, 0.6, "end")
    port.quays([(-w, q, w, d), (-w, -d, end, south)])
    _road(port, d - 5.5)
    _edge(port, (-w + 1, q), (w - 1, q), key="north")
    _edge(port, (end - 1, south), (-w + 1, south), key="south")
    _halls(port, -w + 4, w - 3, d - 22, 10.5)
    _stacks(port, -w + 5, -d + 5, -w * 0.1, south - 16)
    _heaps(port, [(13.0 * k, -d + 9) for k in range(int((end - 12) // 13))])
    return [(*port.at(end - 7, -d + 12), port.yaw(90))]


def _causeway(port: _Port, w: float, d: float) -> list[Pose]:
    """A terminal out in the water, joined to the shore by a causeway."""
    shore, x0, x1, y0, y1 = d * 0.55, -w * 0.6, w * 0.62, -d * 0.5, d * 0.14
    at = port.draft.number(x0 + 14, x1 - 14, "causeway")
    port.quays([(-w, shore, w, d), (x0, y0, x1, y1), (at - 5, y1, at + 5, shore)])
    _road(port, d - 5.5)
    _crane(port, (x0 + 4, y0), (x1 - 4, y0))
    _edge(port, (x0 + 1, y0), (x1 - 1, y0), key="south")
    _edge(port, (x1, y0 + 1), (x1, y1 - 1), key="east", ships=False)
    _edge(port, (x0, y1 - 1), (x0, y0 + 1), key="west", ships=False)
    _stacks(port, x0 + 12, y0 + 20, x1 - 12, y1 - 1)
    _halls(port, -w + 3, at - 8, d - 19, 9.0)
    _houses(port, at + 10, w - 3, d - 14)
    return [(*port.at(x1 - 8, y1 - 9), port.yaw(0))]


_TOPOLOGIES = {
    "terminal": _terminal, "basin": _basin, "fingers": _fingers, "marina": _marina, "channel": _channel,
    "causeway": _causeway,
}  # fmt: skip
