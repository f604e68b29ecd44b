"""Amusement parks and fairs: rides on plazas, booths, ways between them, a gate at a street."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise, product
from typing import Any, NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, Point, ahead, heading
from aerialdojo_gen.scenes.worlds.streets import edge_slots, street_along
from aerialdojo_gen.scenes.worlds.wilds import rolling, strewn

_WORDS = [
    "DARTS", "RINGS", "PRIZES", "HOOPLA", "DUCKS", "CANS", "LUCKY", "POPCORN", "TEA", "NUTS", "MASKS", "TOYS",
    "CREPES", "JUICE", "FRIES", "TICKETS", "SWEETS", "HATS", "BALLS", "ARROWS", "WAFFLES", "CIDER", "FISH", "PIZZA",
]  # fmt: skip
_NAMES = ["FUN FAIR", "LAKELAND", "HILL FAIR", "WONDERS", "LUNA PARK", "TIVOLI", "HAPPYLAND", "STARLAND", "PRATER",
          "JOYLAND", "SUMMER FAIR", "DREAMLAND", "GALA", "OLD FAIR", "BIG TOP", "SKYLARK"]  # fmt: skip
_HALLS = ["DODGEMS", "ARCADE", "GRILL", "BUMPERS", "GAMES", "CAFE"]


class Park(NamedTuple):
    """The ground inside the fence, and the way in."""

    box: Box
    gate: Point
    inwards: float  # 1 where one walks in northwards, -1 southwards


class Pad(NamedTuple):
    """A round plaza for a ride."""

    x: float
    y: float
    radius_m: float

    def shape(self) -> shapely.Polygon:
        """Return it as a polygon."""
        return shapely.Point(self.x, self.y).buffer(self.radius_m)


def write(draft: Draft) -> None:
    """Lay street and gate, ways and plazas, put rides on these, booths and lights between, and trees about them."""
    w, d = draft.half
    inwards = draft.pick([1.0, -1.0], "inwards")
    draft.section("The street, the gate and the fence")
    half = street_along(draft, -inwards * (d - 6.0))
    inner = -inwards * (d - 6.0 - half - 3.0)
    box = Box(-w + 2.0, min(inner, inwards * (d - 2.0)), w - 2.0, max(inner, inwards * (d - 2.0)))
    park = Park(box, (draft.number(-w / 5, w / 5, "gate"), round(inner, 2)), inwards)
    _gate(draft, park)
    draft.section("Ways and plazas")
    pads = _TOPOLOGIES[draft.topology](draft, park)
    for pad in pads:
        _ring(draft, pad)
    draft.section("Rides")
    draft.landmark((pad.x, pad.y, draft.pick(SIDES, "ride", pad.x)) for pad in pads)
    if len(draft.landmarks) < 2:
        raise NoRoomError("no room for the rides")
    _halls(draft, [pad for pad in pads if draft.is_free(pad.shape().buffer(-5.5))])
    _lights(draft, pads)
    draft.section("Trees and lawns")
    edge_slots(draft, "tree", box.grown(-2.6), 5.5, (3.4, 3.4))
    strewn(draft, "tree", round(draft.knob("trees")), (3.4, 3.4), 8.0)
    strewn(draft, "lawn", 32, (3.2, 3.2), 8.0)
    draft.fill_slots()


def _gate(draft: Draft, park: Park) -> None:
    (x, y), box = park.gate, park.box
    width = draft.number(5.6, 7.0, "gate_width")
    low, high = sorted((round(y - park.inwards * 3.2, 2), y + park.inwards * 4))
    draft.paint([x - 4.0, low, x + 4.0, high], draft.material("path"))
    draft.make(
        "entrance_gate", at=[x, y], yaw_deg=-90.0 * park.inwards, name=draft.pick(_NAMES, "name"), width_m=width,
        wall=draft.material("wall"), roof=draft.material("roof"), sign=draft.material("paint", "sign"),
    )  # fmt: skip
    side, far = width / 2 + 3.0, box.y1 if park.inwards > 0 else box.y0
    lines = [
        [[box.x0, y], [round(x - side, 2), y]], [[round(x + side, 2), y], [box.x1, y]],
        [[box.x0, y], [box.x0, far], [box.x1, far], [box.x1, y]],
    ]  # fmt: skip
    draft.make("garden_fences", kind=draft.pick(["hedge", "picket", "hedge"], "fence"), lines=lines, piece_m=8)
    draft.take(shapely.box(x - side - 1.5, y - 2.0, x + side + 1.5, y + 2.0))
    for k, left in enumerate((-6.5, 6.5, -9.5, 9.5)):
        at = y + park.inwards * (3.6 if k < 2 else 5.5)
        draft.slot("gate", x + left, at, 90.0 - 90.0 * (1.0 if left > 0 else -1.0), (3.4, 3.4))


def _way(draft: Draft, points: list[Point], width_m: float = 3.2) -> None:
    """Pave a way, take it, and offer slots beside it that look to it."""
    line = shapely.LineString(points)
    ribbon = {"ribbon": [[round(x, 2), round(y, 2)] for x, y in points], "width_m": width_m, "round_ends": True}
    draft.paint(ribbon, draft.material("path"))
    draft.take(line.buffer(width_m / 2))
    for k in range(int((line.length - 2.0) // 3.4)):
        (x, y, yaw), side = heading(line, 2.0 + 3.4 * k), 1 if k % 2 else -1
        away, turn = side * (width_m / 2 + 1.2), math.radians(yaw)
        x, y = x - math.sin(turn) * away, y + math.cos(turn) * away
        if draft.has_room(x, y, 0.9):
            draft.slot("wayside", x, y, yaw - side * 90.0, (1.9, 2.6))


def _way_to(draft: Draft, start: Point, pad: Pad, from_m: float) -> None:
    """Pave a way to a plaza, from a point, or so far from it."""
    (x, y), away = start, math.dist(start, pad[:2])
    f, g = from_m / away, 1.0 - 0.9 * pad.radius_m / away
    _way(draft, [(x + t * (pad.x - x), y + t * (pad.y - y)) for t in (f, g)])


def _pad(draft: Draft, x: float, y: float, radius_m: float) -> Pad:
    pad = Pad(round(x, 1), round(y, 1), round(radius_m, 1))
    draft.paint({"disc": [pad.x, pad.y, pad.radius_m, 32]}, draft.material("plaza", pad.x, pad.y))
    if draft.chance(0.6, "inlay", pad.x, pad.y):
        inlay = {"disc": [pad.x, pad.y, round(pad.radius_m * 0.55, 1), 28]}
        draft.paint(inlay, draft.material("inlay", pad.x, pad.y))
    return pad


def _ring(draft: Draft, pad: Pad) -> None:
    """Offer slots about a plaza's rim."""
    first = draft.number(0, 60, "ring", pad.x, pad.y)
    n = int(pad.radius_m)
    for k in range(n):
        turn = math.radians(first + k * 360.0 / n)
        x, y = pad.x + (pad.radius_m - 1.0) * math.cos(turn), pad.y + (pad.radius_m - 1.0) * math.sin(turn)
        if draft.has_room(x, y, 1.0):
            draft.slot("plaza", x, y, round(math.degrees(turn) + 180.0), (2.6, 2.6))


def _halls(draft: Draft, pads: list[Pad]) -> None:
    """Put up halls on some of the plazas that are left, and offer the others to smaller rides."""
    signs = draft.shuffled(_HALLS, "halls")
    for k, pad in enumerate(pads):
        if k >= 2:
            draft.slot("pad", pad.x, pad.y, draft.pick(SIDES, "pad", pad.x), (9.5, 9.5))
            continue
        size = [draft.number(7.0, 9.5, "hall", k), draft.number(6.0, 8.5, "hall_deep", k)]
        draft.make(
            "ride_hall", node=f"ride_hall_{k}", at=[pad.x, pad.y], yaw_deg=draft.pick([0, 90, 180, 270], "hall", k),
            size_m=size, sign=signs[k], roof=f"sheet_metal:{draft.material('paint', 'hall', k)}",
            trim=draft.material("trim"), floor=draft.material("inlay", "hall", k), **{"as": f"hall_{k}"},
        )  # fmt: skip
        half = min(size) / 2 - 1.6
        draft.take_disc((pad.x, pad.y), max(size) / 2)
        kind = "dodgem" if signs[k] in ("DODGEMS", "BUMPERS") else "indoors"
        for u, v in product((-1, 1), repeat=2):
            yaw = draft.number(0, 360, kind, k, u, v) if kind == "dodgem" else 90.0
            draft.slot(kind, pad.x + u * half * 0.8, pad.y + v * half * 0.8, yaw, (2.2, 2.2), on=f"hall_{k}")


def _booths(draft: Draft, x: float, y: float, yaw: float, most: int = 9) -> None:
    """Put up a row of booths where the ground is free."""
    count = min(round(draft.knob("booths")), most)
    u, v = (1.7, count * 1.5 + 0.3) if yaw % 180 == 0 else (count * 1.5 + 0.3, 1.7)
    area = Box.about(x, y, 2 * u, 2 * v).shape()
    if not draft.is_free(area):
        return
    draft.take(area)
    key = (round(x, 1), round(y, 1))
    draft.make(
        "booths", at=[round(x, 2), round(y, 2)], yaw_deg=yaw, count=count,
        colours=draft.shuffled(draft.palette.materials["paint"], "booths", *key)[:4],
        words=draft.shuffled(_WORDS, "words", *key)[:count],
    )  # fmt: skip


def _lights(draft: Draft, pads: list[Pad]) -> None:
    """Hang strings of bulbs from plaza to plaza."""
    for k, (a, b) in enumerate(pairwise(pads)):
        away = math.hypot(b.x - a.x, b.y - a.y)
        if k >= draft.knob("lights") or away > 34.0:
            continue
        f, g = (a.radius_m - 0.4) / away, 1.0 - (b.radius_m - 0.4) / away
        poles = [[round(a.x + t * (b.x - a.x), 1), round(a.y + t * (b.y - a.y), 1)] for t in (f, (f + g) / 2, g)]
        draft.make("festoons", node=f"lights_{k}", poles=poles)
        for x, y in poles:
            draft.take_disc((x, y), 0.4)


def _midway(draft: Draft, park: Park) -> list[Pad]:
    (gx, gy), box, s = park.gate, park.box, park.inwards
    top = _pad(draft, gx, (box.y1 if s > 0 else box.y0) - s * 12.0, 9.5)
    length = abs(top.y - gy) - 8.0
    pads = [top]
    links = []
    for k, f in enumerate((0.28, 0.78)):
        for side in (-1, 1):
            radius = draft.number(7.8, 9.2, "pad", k, side)
            limit = box.x1 - radius - 2.0
            x = side * draft.number(min(gx * side + 17.0 + radius, limit), limit, "pad_x", k, side)
            pads.append(_pad(draft, x, gy + s * (length * f + draft.number(-1.5, 1.5, "pad_y", k, side)), radius))
            links.append((pads[-1], side))
    _way(draft, [(gx, gy), (gx, top.y - s * 8.5)], 6.4)
    for pad, side in links:
        _way(draft, [(gx + side * 3.0, pad.y), (pad.x - side * pad.radius_m * 0.9, pad.y)])
    for side in (-1, 1):
        for f in (0.1, 0.5, 0.62, 0.95):
            _booths(draft, gx + side * 5.2, gy + s * length * f, 90.0 + 90.0 * side)
    return pads


def _on_ellipse(draft: Draft, box: Box, number: int, radius_m: Point) -> Iterator[tuple[float, float, float]]:
    """Yield places for plazas about the middle of a box, and their radii."""
    first = draft.number(0, 60, "first")
    for k in range(number):
        turn, size = math.radians(first + 360.0 / number * k), draft.number(*radius_m, "pad", k)
        yield math.cos(turn) * (box.width / 2 - size - 1.5), math.sin(turn) * (box.depth / 2 - size - 1.5), size


def _lake(draft: Draft, park: Park) -> list[Pad]:
    (gx, gy), box, s = park.gate, park.box, park.inwards
    x, y = box.middle
    radius = draft.number(11.0, 14.0, "lake")
    draft.step("level_grid", cell_m=1.2)
    draft.step("sink_area", area={"disc": [x, y, radius]}, depth_m=1.1, blend_m=2.0)
    draft.areas["lake"] = {"blob": [x, y, radius - 0.6, draft.whole(0, 1999, "lake"), 0.16, 36]}
    draft.paint({"area": "lake", "grow_m": 1.1}, draft.material("bank"))
    draft.paint("lake", draft.material("water"))
    draft.take_disc((x, y), radius + 0.8)
    for k in range(5):
        turn, away = k * 72.0 + draft.number(-20, 20, "boat", k), draft.number(2.0, radius - 5.0, "boat_away", k)
        draft.slot("boats", *ahead((x, y), turn, away), draft.number(0, 360, "b", k), (5.8, 4.4))
    pads = []
    for u, v, size in _on_ellipse(draft, box, 6, (7.6, 9.0)):
        if math.dist((x + u, y + v), park.gate) > size + 6.0 and math.hypot(u, v) > radius + size + 4.5:
            pads.append(_pad(draft, x + u, y + v, size))
    turns = [math.radians(10.0 * k) for k in range(37)]
    _way(draft, [(x + (radius + 3.0) * math.cos(t), y + (radius + 3.0) * math.sin(t)) for t in turns])
    for pad in pads:
        _way_to(draft, (x, y), pad, radius + 3.0)
    _way(draft, [(gx, gy), (x, y - s * (radius + 3.0))], 4.4)
    for side in (-1, 1):
        for away in (15.0, 26.0):
            _booths(draft, gx + side * away, gy + s * 4.2, 90.0 * s)
        _booths(draft, side * (box.x1 - 3.0), y + side * 4.0, 90.0 + 90.0 * side)
    return pads


def _star(draft: Draft, park: Park) -> list[Pad]:
    (gx, gy), box = park.gate, park.box
    x, y = box.middle
    middle = _pad(draft, x, y, draft.number(11.0, 13.0, "middle"))
    pads = [middle]
    for u, v, size in _on_ellipse(draft, box, draft.whole(5, 6, "spokes"), (7.4, 8.8)):
        if math.dist((x + u, y + v), park.gate) > size + 6.0 and math.hypot(u, v) > middle.radius_m + size + 3.0:
            pads.append(_pad(draft, x + u, y + v, size))
    for pad in pads[1:]:
        _way_to(draft, (x, y), pad, 0.9 * middle.radius_m)
    away = math.hypot(gx - x, gy - y)
    f = middle.radius_m * 0.9 / away
    _way(draft, [(gx, gy), (x + f * (gx - x), y + f * (gy - y))], 5.0)
    for side in (-1, 1):
        for reach in (5.0, 9.0):
            _booths(draft, x + side * (middle.radius_m + reach), y, 90.0 + 90.0 * side)
            _booths(draft, x, y + side * (middle.radius_m + reach), -90.0 * side)
        _booths(draft, gx + side * 14.0, gy + park.inwards * 4.2, 90.0 * park.inwards)
    return pads


def _fairground(draft: Draft, park: Park) -> list[Pad]:
    (gx, gy), box, s = park.gate, park.box, park.inwards
    ground = Box(box.x0 + 4.0, box.y0 + (8.0 if s > 0 else 9.0), box.x1 - 4.0, box.y1 - (9.0 if s > 0 else 8.0))
    draft.paint(ground.rounded(), draft.material("lot"))
    _way(draft, [(gx, gy), (gx, gy + s * 9.0)], 6.0)
    nx, ny = max(2, int(ground.width // 26.0)), max(2, int(ground.depth // 22.0))
    pads = []
    for k in draft.shuffled(range(nx * ny), "pads"):
        i, j = divmod(k, ny)
        x = ground.x0 + (i + 0.5) * ground.width / nx + draft.number(-1.5, 1.5, "x", k)
        y = ground.y0 + (j + 0.5) * ground.depth / ny + draft.number(-1.0, 1.0, "y", k)
        pads.append(_pad(draft, x, y, draft.number(7.0, 8.2, "pad", k)))
    keep = shapely.union_all([pad.shape() for pad in pads])
    for i, f in product(range(1, nx), (0.2, 0.5, 0.8)):
        x, y = ground.x0 + i * ground.width / nx, ground.y0 + f * ground.depth
        if not keep.intersects(Box.about(x, y, 4, 10).shape()):
            _booths(draft, x, y, draft.pick([0.0, 180.0], "booth", i, f), 3)
    for x, y in Box(ground.x0 + 3, ground.y0 + 1.8, ground.x1 - 3, ground.y0 + 6.8).grid(5.0):
        draft.slot("backstage", x, y, draft.pick([0.0, 180.0], "van", x), (7.2, 4.2))
    for x, y in ground.grown(-1.2).grid(6.5):
        if not keep.intersects(shapely.Point(x, y).buffer(1.5)):
            draft.slot("plaza", x, y, draft.pick(SIDES, "lot", x, y), (2.6, 2.6))
    return pads


def _hills(draft: Draft, park: Park) -> list[Pad]:
    (gx, gy), box, s = park.gate, park.box, park.inwards
    rolling(draft, 0.9, (34, 44), 1.6)
    x0, y0 = box.middle
    spots: list[tuple[float, float, float, float]] = []
    for k, (u, v) in enumerate(((-0.62, -0.5), (0.62, -0.5), (0.0, 0.06), (-0.62, 0.58), (0.62, 0.58))):
        radius = draft.number(8.0, 9.6, "pad", k)
        x = x0 + u * (box.width / 2 - 3.0) + draft.number(-2, 2, "x", k)
        y = y0 + s * v * (box.depth / 2 - 2.0) + draft.number(-2, 2, "y", k)
        spots.append((round(x, 1), round(y, 1), radius, draft.number(0.8, 4.4, "high", k)))
    discs: list[Any] = [[x, y, round(radius + 1.2, 1), high] for x, y, radius, high in spots]
    discs.append([gx, round(gy, 1), 10.0, 0.0])
    draft.step("round_levels", discs=discs)
    low, high = sorted((gy, -s * draft.half[1]))
    street = draft.site._replace(y0=low, y1=high)
    draft.step("level_area", area=street.rounded(), to_m=0.0, blend_m=5.0)
    pads = [_pad(draft, x, y, radius) for x, y, radius, _ in spots]
    for pad in pads[:2]:
        _way_to(draft, (gx, gy), pad, 0.0)
    for a, b in ((0, 2), (1, 2), (2, 3), (2, 4)):
        _way_to(draft, (pads[a].x, pads[a].y), pads[b], 8.0)
    draft.step("level_under_things")
    return pads


_TOPOLOGIES = {
    "midway": _midway, "lake": _lake, "star": _star, "fairground": _fairground, "hills": _hills,
}  # fmt: skip
