"""Streets and yards after a blast: a crater, fronts torn open about it, soot, wreckage and a cordon."""

from __future__ import annotations

import math

import shapely

from aerialdojo_gen.scenes.worlds import wrecked
from aerialdojo_gen.scenes.worlds.blocks import Layout, about_square, avenue, estate, split, town
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import Box, Point, ahead, point


def write(draft: Draft) -> None:
    """Lay streets and lots out, blast a crater, then tear the buildings open, the more the nearer they stand."""
    lots, lanes, open_ = wrecked.built_up(draft, _TOPOLOGIES[draft.topology], 0.25, (22, 32))
    at = _where(draft, lanes, open_)
    radius = draft.knob("crater_m")
    _crater(draft, at, radius)
    for lane in lanes:
        draft.take(lane.shape())
    large = [lot for lot in lots if lot.width * lot.depth > 320]
    wrecked.open_landmarks(draft, [*open_, *large], shapely.Point(at).buffer(9.0))
    draft.section("What is left of the buildings")
    for k, lot in enumerate(draft.shuffled(lots, "lots")):
        _lot(draft, lot, k, at, radius)
    wrecked.camp(draft, open_)
    _cordon(draft, at, radius)
    draft.fill_slots()
    draft.section("Loose pieces")
    _scattered(draft, at, radius)


def _where(draft: Draft, lanes: list[Box], open_: list[Box]) -> Point:
    """Where it blew up: on the square, else in a street near the middle of the site."""
    if draft.topology in ("square", "yard") and open_:
        box = max(open_, key=lambda b: b.width * b.depth)
        return point(box.middle[0] + draft.number(-3, 3, "blast_x"), box.middle[1] + draft.number(-2, 2, "blast_y"))
    lane = min(lanes, key=lambda b: math.hypot(*b.middle) + draft.number(0, 6, "blast", *b))
    x, y = lane.middle
    off = draft.number(-0.2, 0.2, "blast_off")
    return point(x, y + off * lane.depth) if lane.upright else point(x + off * lane.width, y)


def _crater(draft: Draft, at: Point, radius_m: float) -> None:
    draft.section("The crater")
    draft.step("crater", at=at, radius_m=radius_m, depth_m=round(0.6 * radius_m, 1), rim_m=0.8)
    seed, soot = draft.whole(0, 999, "crater"), draft.material("soot")
    draft.paint({"blob": [*at, round(radius_m * 2.6, 1), seed, 0.4]}, soot)
    rays = {"count": 24, "reach": [2.4, 4.0], "spread": [0.06, 0.15], "material": soot}
    draft.make("scorch_rays", at=at, radius_m=radius_m, **rays)
    for share, role in ((1.65, "earth"), (0.98, "mud"), (0.42, "pool")):
        draft.paint({"blob": [*at, round(radius_m * share, 1), seed + round(share * 10), 0.25]}, draft.material(role))
    starts = [[*ahead(at, turn, 1.5 * radius_m), turn] for turn in (25.0, 97.0, 166.0, 235.0, 309.0)]
    draft.make("cracks", starts=starts, length_m=7, seed=seed % 90)
    if draft.chance(0.6, "rim"):
        draft.make("crater_rim", at=at, radius_m=radius_m)
    draft.take_disc(at, radius_m * 1.5)


def _lot(draft: Draft, lot: Box, k: int, at: Point, radius_m: float) -> None:
    """Put what is left of a building on a lot; near the blast it is torn wide open, or rubble alone."""
    name, storeys = f"block_{k}", max(2, round(draft.knob("storeys")) - draft.whole(0, 2, "storeys", k))
    # The front stands at the side that looks to the blast.
    low = at[0] < lot.middle[0] if lot.upright else at[1] < lot.middle[1]
    box = wrecked.shallow(draft, lot, k, 13.0, low)
    away = box.shape().distance(shapely.Point(at))
    free = draft.is_free(box.shape())
    if free and away >= radius_m * 1.1:
        torn = 2 if away < 16.0 else 1 if away < 34.0 else draft.whole(0, 1, "torn", k)
        wrecked.wreck(draft, box, name, storeys, torn, toward=at, soot=round(max(0.0, 0.7 - away / 45.0), 2))
    else:
        wrecked.flattened(draft, box, k, name, 0.42, free)


def _cordon(draft: Draft, at: Point, radius_m: float) -> None:
    """Bend street lamps away from the blast, and offer slots about the crater (``cordon``, ``rubble``)."""
    spots = (ahead(at, 72.0 * k + draft.number(0, 60, "lamp", k), radius_m * 2.2 + 2.0) for k in range(5))
    if feet := [spot for spot in spots if draft.has_room(*spot, 0.6)]:
        draft.make("bent_lamps", feet=feet, blast=at)
    for k in range(10):
        turn = 36.0 * k + draft.number(0, 30, "cordon", k)
        away = radius_m * (1.9 + 0.1 * draft.whole(0, 9, "cordon", k, "away"))
        draft.slot("cordon", *ahead(at, turn, away), turn, (5.6, 3.6), settle_m=0.5)


def _scattered(draft: Draft, at: Point, radius_m: float) -> None:
    beams = []
    for k in range(6):
        turn, away = draft.number(0, 360, "beam", k), radius_m * draft.number(1.8, 3.4, "beam", k, "away")
        beams.append([*ahead(at, turn, away), draft.number(2, 5, "beam", k, "m")])
    draft.make("twisted_steel", beams=beams, stream="beams")
    wrecked.littered(draft)


def _yard(draft: Draft, w: float, d: float) -> Layout:
    """A works' yard with halls at three sides, a street along the fourth."""
    street = -d + 5.0
    lanes = [Box(-w, street - 4.4, w, street + 4.4)]
    deep, side, y0 = draft.number(14, 17, "deep"), draft.number(15, 18, "side"), street + 4.4
    row, _ = split(draft, Box(-w, d - deep, w, d), (4.0, 7.0), (18.0, 34.0), "row")
    lots = [*row, Box(-w, y0 + 2, -w + side, d - deep - 5), Box(w - side, y0 + 2, w, d - deep - 5)]
    return lots, lanes, [Box(-w + side + 1, y0 + 1, w - side - 1, d - deep - 1)]


_TOPOLOGIES = {
    "street": avenue, "square": about_square, "blocks": town, "yard": _yard, "flats": estate,
}  # fmt: skip
