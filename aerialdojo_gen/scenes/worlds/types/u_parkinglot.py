"""Car parks."""

from __future__ import annotations

from typing import Any

from aerialdojo_gen.scenes.kit.parking import VEHICLES
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import Box, point
from aerialdojo_gen.scenes.worlds.streets import (
    BAY_DEPTH_M,
    BAY_M,
    DOUBLE_ROW_M,
    bay_islands,
    block_building,
    edge_slots,
    street_along,
)


def write(draft: Draft) -> None:
    """Lay a street along one side, a building or two along another, and the lot on what is left."""
    w, d = draft.half
    draft.section("The street")
    half = street_along(draft, -d + 5.6)
    lot = Box(-w + 3.0, -d + 5.6 + half + 1.5, w - 3.0, d - 3.0)
    lot = _buildings(draft, lot)
    draft.section("The lot")
    draft.paint(lot.rounded(), draft.material("lot"))
    entry_x = draft.number(lot.x0 + 6, lot.x1 - 6, "entry")
    draft.paint(Box(entry_x - 3.3, -d + 5.6 + 3.25, entry_x + 3.3, lot.y0 + 0.1).rounded(), draft.material("lot"))
    low = round(lot.y0 - 1.6, 2)
    draft.make("arrows", at=[[entry_x - 1.5, low, 90.0], [entry_x + 1.5, low, 270.0]])
    for side in (-4.6, 4.6):
        draft.slot("entrance", entry_x + side, lot.y0 - 0.4, 270.0, (3.0, 3.0))
    _TOPOLOGIES[draft.topology](draft, lot)
    edge_slots(draft, "verge", lot.grown(-1.6), 5.2, (3.2, 3.2))
    edge_slots(draft, "tree", lot.grown(1.4), 6.5, (2.0, 2.0))
    spots = [*lot.grown(-2).grid(3.0), (lot.x0 + 4, lot.y1 - 4), (lot.x1 - 4, lot.y0 + 4)]
    draft.section("Landmarks")
    draft.landmark([(*p, 180.0) for p in draft.shuffled(spots, "landmarks")])
    draft.fill_slots()


def _buildings(draft: Draft, lot: Box) -> Box:
    """Put one or two buildings along a side of the lot, their fronts to it; gives the lot that is left."""
    draft.section("The buildings")
    side = draft.pick(["north", "east", "west"], "side")
    deep = draft.number(9.0, 14.0, "deep")
    strip, rest, facing = {
        "north": (lot._replace(y0=lot.y1 - deep), lot._replace(y1=lot.y1 - deep - 3.0), 270.0),
        "east": (lot._replace(x0=lot.x1 - deep), lot._replace(x1=lot.x1 - deep - 3.0), 180.0),
        "west": (lot._replace(x1=lot.x0 + deep), lot._replace(x0=lot.x0 + deep + 3.0), 0.0),
    }[side]
    along = strip.width if side == "north" else strip.depth
    at, k = draft.number(0.0, 6.0, "first"), 0
    while at < along - 10.0:
        length = min(draft.number(10.0, 22.0, "building", k), along - at)
        storeys = max(1, round(draft.knob("storeys")) - draft.whole(0, 1, "lower", k))
        if side == "north":
            box = strip._replace(x0=strip.x0 + at, x1=strip.x0 + at + length)
        else:
            box = strip._replace(y0=strip.y0 + at, y1=strip.y0 + at + length)
        if length >= 8.0:
            block_building(draft, box, f"building_{k}", storeys=storeys, street_deg=facing, category="office_block")
        at, k = at + (length + draft.number(4.0, 12.0, "gap", k)), k + 1
    draft.paint(strip.grown(0.4).rounded(), "paving:#b8afa0", rise_m=0.1)
    return rest


def _parked(draft: Draft) -> dict[str, Any]:
    """How many bays are taken, and by what: which vehicles are common differs by lot."""
    weights = {what: round(1.0 / (k + 1), 2) for k, what in enumerate(draft.shuffled(VEHICLES, "vehicles"))}
    return {"occupancy": draft.knob("occupancy"), "vehicles": weights, "differ": 0.06}


def _rows(draft: Draft, lot: Box) -> None:
    """Double rows of bays along x, aisles between them, islands at both ends."""
    inner = lot.grown(-4.5)
    count = int((inner.width - 5.0) // BAY_M)
    x, y, rows = inner.middle[0], inner.y0 + BAY_DEPTH_M, []
    while y + BAY_DEPTH_M <= inner.y1:
        rows += [[round(x, 2), round(y, 2), 90.0, count], [round(x, 2), round(y, 2), -90.0, count]]
        for area in (*bay_islands(draft, x, y, count, 1.0), Box.about(x, y, count * BAY_M, 2 * BAY_DEPTH_M)):
            draft.take(area.shape())
        for k in range(1, count, 4):
            draft.slot("machines", x + (k - count / 2) * BAY_M, y, 90.0, (0.9, 0.9))
        y += DOUBLE_ROW_M
    if not rows:
        raise NoRoomError("no room for a row of bays")
    draft.make("parking_rows", rows=rows, **_parked(draft))
    for x, y, yaw, n in rows:
        for k in range(int(n)):
            draft.slot("bays", x + (k + 0.5 - n / 2) * BAY_M, y - (2.5 if yaw > 0 else -2.5), yaw, (5.0, 2.5))


def _fishbone(draft: Draft, lot: Box) -> None:
    """Slanted bays on both sides of one-way aisles."""
    inner = Box(lot.x0 + 3.0, lot.y0 + 3.0, lot.x1 - 9.0, lot.y1 - 3.0)  # A strip at one end is left for landmarks
    count = int((inner.width - 8.0) // 3.1)
    y, rows = inner.y0, []
    while y + 16.0 <= inner.y1:
        x, arrows = round(inner.x0 + 2.0, 2), range(int(inner.width // 16))
        rows += [[x, round(y + 5.2, 2), False, count], [x, round(y + 10.0, 2), True, count]]
        draft.make("arrows", at=[[*point(inner.x0 + 8 + 14 * k, y + 7.6), 0.0] for k in arrows])
        strip = Box(inner.x0 + 1.0, y + 15.2, inner.x1 - 1.0, y + 17.2)
        draft.paint(strip.rounded(), draft.material("island"), rise_m=0.12)
        for k in range(int(strip.width // 7)):
            kind = draft.pick(["tree", "island", "machines"], "strip", round(y), k)
            draft.slot(kind, strip.x0 + 3 + 7 * k, strip.middle[1], 90.0, (1.8, 3.0))
        draft.take(Box(inner.x0, y, inner.x1, y + 17.2).shape())
        y += 17.6
    if not rows:
        raise NoRoomError("no room for a row of bays")
    draft.make("slanted_bays", rows=rows, **_parked(draft))


def _deck(draft: Draft, lot: Box) -> None:
    """A parking deck of two or three floors, and rows on what is left."""
    width, depth = draft.number(26, 30, "deck_w"), draft.number(33, 35, "deck_d")
    if lot.depth < depth + 16 or lot.width < width + 30:
        raise NoRoomError("no room for the deck")
    left = draft.chance(0.5, "deck_side")
    x0 = lot.x0 + 6.5 if left else lot.x1 - width - 7.5
    deck = Box(*Box(x0, lot.y0 + 10.5, x0 + width, lot.y0 + 10.5 + depth).rounded())
    box, levels = list(deck), draft.whole(2, 3, "levels")
    colour = draft.material("steel")
    draft.make("parking_deck", box=box, levels=levels, band=colour, tower=f"tiles:{colour}", **{"as": "deck_roof"})
    draft.make("deck_cars", box=box, levels=levels, **_parked(draft))
    draft.take(deck.grown(6.0).shape())
    draft.slots_over("wheels", deck.grown(-4.0), 5.4, (2.4, 1.4), yaw_deg=0.0, on="deck_roof")
    _rows(draft, lot._replace(x0=deck.x1 + 7) if left else lot._replace(x1=deck.x0 - 7))


def _court(draft: Draft, lot: Box) -> None:
    """Lock-up garages along the north side, some open, and bays before them."""
    count = int((lot.width - 6.0) // 3.4)
    at = [round(lot.x0 + 3.0, 2), round(lot.y1 - 7.2, 2)]
    doors = draft.shuffled(["#3f6f5a", "#7a3b36", "#44618a", "#c9a23f", "#6f6f70", "#8a5a8a"], "doors")[:3]
    opened = [k for k in range(count) if draft.chance(0.25, "open", k)]
    wall, top = draft.material("wall", "garages"), {"as": "garage_top"}
    draft.make("lockup_garages", at=at, count=count, doors=doors, open_doors=opened, wall=wall, **top)
    draft.take(Box(at[0] - 1, at[1] - 2, at[0] + count * 3.4 + 1, lot.y1).shape())
    for k in range(count):
        x = at[0] + (k + 0.5) * 3.4
        if k in opened:
            draft.slot("wheels", x, at[1] + 2.6, 270.0, (2.6, 2.2))
        elif k % 2:
            draft.slot("verge", x, at[1] - 1.4, 270.0, (2.0, 2.6))
        draft.slot("roof", x, at[1] + 3.0, 270.0, (2.8, 3.0), on="garage_top")
    _rows(draft, Box(lot.x0, lot.y0, lot.x1, at[1] - 6.0))


def _solar(draft: Draft, lot: Box) -> None:
    """Rows of bays under solar roofs."""
    _rows(draft, lot)
    inner = lot.grown(-4.5)
    x, y, k = inner.middle[0], inner.y0 + BAY_DEPTH_M, 0
    half = round(int((inner.width - 5.0) // BAY_M) * BAY_M / 2, 2)
    while y + BAY_DEPTH_M <= inner.y1:
        posts = [[round(x + u * half * 0.9, 2), round(y, 2)] for u in (-1, -0.5, 0, 0.5, 1)]
        steel = draft.material("steel", k)
        box = Box.about(x, y, 2 * half, 10).rounded()
        draft.add({"node": f"solar_roof_{k}", "category": "solar_roof", "parts": [
            {"make": "canopy", "box": box, "z_m": 4.2, "roof": "sheet_metal:#c9ced0", "post": steel},
            {"make": "round_columns", "at": posts, "z": [0, 4.2], "material": steel, "radius_m": 0.2},
        ]})  # fmt: skip
        for u in range(int(half * 2 // 6)):
            draft.slot("roof", x - half + 3 + 6 * u, y, 90.0, (3.2, 5.0), on=4.42)
        y, k = y + DOUBLE_ROW_M, k + 1


_TOPOLOGIES = {
    "rows": _rows, "fishbone": _fishbone, "deck": _deck, "court": _court, "solar": _solar,
}  # fmt: skip
