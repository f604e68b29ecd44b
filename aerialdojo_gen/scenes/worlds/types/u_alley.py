"""Alleys and lanes between town houses, with yards and squares."""

from __future__ import annotations

from aerialdojo_gen.scenes.worlds.blocks import (
    dressed,
    inner_sides,
    ring,
    split,
    split_all,
    square,
    strung,
    town_house,
)
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box
from aerialdojo_gen.scenes.worlds.streets import street_along

Layout = tuple[list[Box], list[Box], list[Box]]  # Houses, lanes and squares


def write(draft: Draft) -> None:
    """Divide the ground into blocks, lanes and squares, put landmarks up, then houses, and fill lanes and squares."""
    w, d = draft.half
    draft.section("The lanes and squares")
    houses, lanes, squares = _TOPOLOGIES[draft.topology](draft, w, d)
    for lane in lanes:
        gutter = Box.about(*lane.middle, *((0.7, lane.depth) if lane.upright else (lane.width, 0.7)))
        draft.paint(gutter.rounded(), draft.material("gutter"))
    for house in houses:
        draft.take(house.shape())
    middles = [square(draft, box) for box in squares]
    draft.section("Landmarks")
    corners = [p for box in squares for p in box.grown(-2.0).grid(3.0)]
    spots = [*middles, *draft.shuffled(corners, "corners")]
    draft.landmark([(*p, draft.pick(SIDES, "landmark", *p)) for p in spots])
    draft.section("The houses")
    most = round(draft.knob("storeys"))
    for k, house in enumerate(houses):
        storeys = max(2, most - draft.whole(0, 2, "storeys", k))
        town_house(draft, house, f"house_{k}", storeys)
        dressed(draft, house, f"house_{k}", storeys, inner_sides(draft, house))
    draft.section("What hangs across the lanes")
    strung(draft, lanes, houses)
    for lane in lanes:
        for x, y in lane.grown(-0.4).grid(6.0):
            draft.slot("middle", x, y, draft.number(0, 360, "middle", x, y), (2.2, 2.2))
    draft.fill_slots()


def _squares(draft: Draft, blocks: list[Box], number: int) -> tuple[list[Box], list[Box]]:
    """Leave so many blocks open as squares, first those near the middle of the site."""
    fit = [b for b in blocks if min(b.width, b.depth) >= 9.0 and b.width * b.depth < 420.0]
    near = sorted(fit, key=lambda b: abs(b.middle[0]) + abs(b.middle[1]) + draft.number(0, 14, "square", *b))
    open_ = near[:number]
    if not open_:
        raise NoRoomError("no block for a square")
    return [b for b in blocks if b not in open_], open_


def _grid(draft: Draft, w: float, d: float) -> Layout:
    """Blocks of uneven sizes, two or three left open."""
    blocks, lanes = split(draft, Box(-w, -d, w, d), (4.4, 6.4), (11.0, 21.0))
    houses, squares = _squares(draft, blocks, draft.whole(2, 3, "squares"))
    return houses, lanes, squares


def _spine(draft: Draft, w: float, d: float) -> Layout:
    """A wide lane from end to end with a dogleg, narrow houses in rows at both sides."""
    wide, shift = draft.number(6.5, 8.5, "wide"), draft.number(9, 15, "shift")
    bend = draft.number(-0.25, 0.25, "bend") * w
    low = draft.number(-0.3, 0.0, "low") * d
    high = low + shift
    end = bend + wide
    lanes = [Box(-w, low, end, low + wide), Box(bend, low, end, high + wide), Box(bend, high, w, high + wide)]
    areas = [Box(-w, -d, end, low), Box(end + 0.01, -d, w, high), Box(-w, low + wide, bend, d),
             Box(bend + 0.01, high + wide, w, d)]  # fmt: skip
    blocks, ways = split_all(draft, areas, (3.8, 4.8), (9.0, 17.0))
    houses, squares = _squares(draft, blocks, 2)
    return houses, [*lanes, *ways], squares


def _piazza(draft: Draft, w: float, d: float) -> Layout:
    """A square in the middle that lanes come into at its corners."""
    half_x, half_y, lane = draft.number(9, 13, "x"), draft.number(8, 11, "y"), draft.number(5.0, 6.4, "lane")
    x, y = draft.number(-6, 6, "at_x"), draft.number(-5, 5, "at_y")
    piazza = Box.about(x, y, 2 * half_x, 2 * half_y)
    # Like the sails of a mill: each corner has a lane along one of its sides.
    x0, y0, x1, y1 = piazza
    lanes = [Box(-w, y1 - lane, x0, y1), Box(x1 - lane, y1, x1, d), Box(x1, y0, w, y0 + lane),
             Box(x0, -d, x0 + lane, y0)]  # fmt: skip
    areas = [Box(-w, y1, x1 - lane, d), Box(x1, y0 + lane, w, d), Box(x0 + lane, -d, w, y0),
             Box(-w, -d, x0, y1 - lane)]  # fmt: skip
    blocks, ways = split_all(draft, areas, (4.0, 5.4), (10.0, 20.0))
    houses, squares = _squares(draft, blocks, 1)
    return houses, [*lanes, *ways], [piazza, *squares]


def _street(draft: Draft, w: float, d: float) -> Layout:
    """A street along one side, houses at it, and yards behind them along a back alley."""
    y = -d + 6.0
    half = street_along(draft, y)
    front, deep = y + half + 0.2, draft.number(13, 16, "deep")
    alley, lane = front + deep, draft.number(5.0, 6.5, "alley")
    row, lanes = split(draft, Box(-w, front, w, alley), (3.8, 4.8), (10.0, 19.0), "row")
    back, ways = split(draft, Box(-w, alley + lane, w, d), (4.2, 5.6), (11.0, 20.0), "back")
    houses, squares = _squares(draft, back, draft.whole(2, 3, "squares"))
    return [*row, *houses], [*lanes, *ways, Box(-w, alley, w, alley + lane)], squares


def _ring(draft: Draft, w: float, d: float) -> Layout:
    """A lane about a block with a yard in its middle, houses about it."""
    lane, deep = draft.number(5.5, 7.0, "lane"), draft.number(13, 16, "deep")
    outer = Box(-w + deep, -d + deep, w - deep, d - deep)
    core = outer.grown(-lane)
    areas = [Box(-w, -d, outer.x1 - 0.01, outer.y0), Box(outer.x1, -d, w, outer.y1), Box(outer.x0, outer.y1, w, d),
             Box(-w, outer.y0, outer.x0, d)]  # fmt: skip
    houses, lanes = split_all(draft, areas, (4.2, 5.2), (10.0, 19.0))
    blocks, ways = split(draft, core, (4.4, 5.4), (9.0, 15.0), "core")
    inner, squares = _squares(draft, blocks, 2)
    return [*houses, *inner], [*ring(outer, core), *lanes, *ways], squares


_TOPOLOGIES = {
    "grid": _grid, "spine": _spine, "piazza": _piazza, "street": _street, "ring": _ring,
}  # fmt: skip
