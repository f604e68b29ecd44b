"""Malls: shops about promenades, courts and car parks, department stores, what stands before them and on roofs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from aerialdojo_gen.scenes.worlds.blocks import dressed, split, strung
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box
from aerialdojo_gen.scenes.worlds.streets import (
    BAY_DEPTH_M,
    BAY_M,
    DOUBLE_ROW_M,
    bay_islands,
    edge_slots,
    street_along,
)

_STORES = ["MARKET", "CINEMA", "GALERIA", "PRIMA", "HOME", "NOVA", "CENTRAL"]


class _Mall(NamedTuple):
    """What a topology gives to the stages after it."""

    shops: Sequence[tuple[Box, tuple[float, ...]]]  # Shops of one or two storeys, and the sides with shop fronts
    stores: list[Box]  # Department stores, their fronts to the south
    courts: list[Box]  # Squares and promenades
    lanes: list[Box]
    lots: list[Box]  # Ground for cars


def write(draft: Draft) -> None:
    """Lay the street and the car parks, pave courts, then put up shops and stores, with what stands there."""
    (w, d), flip = draft.half, draft.pick([1, -1], "flip")
    draft.section("The street")
    half = street_along(draft, -d + 5.6)
    mall = _TOPOLOGIES[draft.topology](draft, Box(-w + 3.0, -d + 5.6 + half + 1.2, w - 3.0, d - 3.0))
    mall = _with_gardens(draft, mall if flip > 0 else _mirrored(mall))
    draft.section("Car parks")
    for k, lot in enumerate(mall.lots):
        _car_park(draft, lot, k)
    draft.section("Courts and promenades")
    for court in mall.courts:
        draft.paint(court.rounded(), draft.material("plaza", *court), rise_m=0.12)
    for box in [*(b for b, _ in mall.shops), *mall.stores]:
        draft.take(box.grown(0.3).shape())
    draft.section("Landmarks")
    spots = [p for court in mall.courts for p in court.grown(-2.8).grid(3.4)]
    spots += [p for lot in mall.lots for p in lot.grown(-2.6).grid(5.0)]
    draft.landmark([(*p, 270.0) for p in draft.shuffled(spots, "spots")])
    draft.section("Shops and stores")
    _shops(draft, mall)
    strung(draft, mall.lanes, [box for box, _ in mall.shops], 4.3)
    for court in mall.courts:
        draft.slots_over("court", court.grown(-2.2), 4.2, (3.8, 3.8))
    edge_slots(draft, "tree", draft.site.grown(-2.0), 6.0, (3.0, 3.0))
    draft.fill_slots()


def _mirrored(mall: _Mall) -> _Mall:
    """Turn a mall over along x: else the stores of all would be at the same end."""

    def over(boxes: list[Box]) -> list[Box]:
        return [Box(-box.x1, box.y0, -box.x0, box.y1) for box in boxes]

    shops = [(over([box])[0], tuple((180.0 - side) % 360.0 for side in sides)) for box, sides in mall.shops]
    return _Mall(shops, over(mall.stores), over(mall.courts), over(mall.lanes), over(mall.lots))


def _with_gardens(draft: Draft, mall: _Mall) -> _Mall:
    """Leave car parks two or three double rows deep; what is behind them is paved or planted for people."""
    lots, gardens = [], []
    for k, lot in enumerate(mall.lots):
        deep = 5.4 + draft.whole(2, 3, "double rows", k) * DOUBLE_ROW_M
        if lot.depth < deep + 12.0:
            lots.append(lot)
            continue
        lots.append(lot._replace(y1=lot.y0 + deep))
        gardens.append(lot._replace(y0=lot.y0 + deep + 1.5))
        edge_slots(draft, "tree", gardens[-1].grown(-1.2), 5.5, (3.0, 3.0))
    return mall._replace(courts=[*mall.courts, *gardens], lots=lots)


def _shops(draft: Draft, mall: _Mall) -> None:
    names = draft.shuffled(_STORES, "stores")
    for k, (box, sides) in enumerate(mall.shops):
        storeys = draft.whole(1, round(draft.knob("storeys")), "storeys", k)
        draft.make("building", outline=box.rounded(), wall=draft.material("wall", k), roof=draft.material("roof", k),
                   storeys=storeys, storey_m=4.6 if storeys == 1 else 3.8, on=0, category="shop_building",
                   **{"as": f"shop_{k}"})  # fmt: skip
        dressed(draft, box, f"shop_{k}", 1, sides, shops=0.72)
        draft.slots_over("roof", box.grown(-2.0), 5.0, (4.4, 4.4), on=f"shop_{k}")
    for k, box in enumerate(mall.stores):
        draft.make(
            "anchor_store", node=f"{names[k].lower()}_store", box=box.rounded(), sign=names[k],
            height_m=draft.number(9.0, 12.5, "store", k), wall=draft.material("store", k), **{"as": f"store_{k}"},
        )  # fmt: skip
        draft.slots_over("roof", box.grown(-2.4), 5.6, (4.6, 4.6), "store roof", on=f"store_{k}")


def _car_park(draft: Draft, lot: Box, k: int) -> None:
    """Pave a car park, with double rows of bays along x."""
    draft.paint(lot.rounded(), draft.material("lot"))
    for n in range(2):
        gate = round(lot.x0 + (0.1 + 0.5 * n + 0.3 * draft.number(0, 1, "entry", k, n)) * lot.width, 1)
        kerb = round(-draft.depth_m / 2 + 5.6 + 3.2, 2)
        draft.paint([gate - 3.2, kerb, gate + 3.2, round(lot.y0 + 0.1, 2)], draft.material("lot"))
        draft.make("arrows", at=[[gate - 1.5, lot.y0, 270.0], [gate + 1.5, lot.y0, 90.0]])
    x, y, rows = round(lot.middle[0], 2), lot.y0 + 3.4 + BAY_DEPTH_M, []
    count = int((lot.width - 12.0) // BAY_M)
    while y + BAY_DEPTH_M < lot.y1 - 2.0 and count > 3:
        rows += [[x, round(y, 2), 90.0, count], [x, round(y, 2), 270.0, count]]
        bay_islands(draft, x, y, count, 2.2)
        y += DOUBLE_ROW_M
    if rows:
        draft.make("parking_rows", rows=rows, occupancy=draft.knob("occupancy"), differ=0.06)
        for u, v, _, many in rows[::2]:
            draft.take(Box.about(u, v, many * BAY_M, 2 * BAY_DEPTH_M).shape())
    edge_slots(draft, "verge", lot.grown(-1.4), 5.6, (3.0, 3.0))


def _row(draft: Draft, x0: float, x1: float, y0: float, y1: float, key: str) -> list[Box]:
    """Shops wall to wall from x0 to x1."""
    boxes, x, k = [], x0, 0
    while x < x1 - 1.0:
        wide = draft.number(12, 20, key, k)
        wide = x1 - x if x1 - x - wide < 11.0 else wide
        boxes.append(Box(x, y0, x + wide, y1 - draft.pick([0.0, 0.0, 1.5], key, k, "deep")))
        x, k = x + wide, k + 1
    return boxes


def _strip(draft: Draft, area: Box) -> _Mall:
    """Shops in a row with a wing at one end, a store among them, a car park before them."""
    deep, wing = draft.number(13, 16, "deep"), draft.number(13, 15, "wing")
    y0 = area.y1 - deep
    at = draft.number(area.x0 + wing + 22, area.x1 - 44, "store")
    store = Box(at, y0 - 1.0, at + draft.number(22, 28, "store_wide"), area.y1)
    shops = [(b, (270.0,)) for b in _row(draft, area.x0, at, y0, area.y1, "west")]
    shops += [(b, (270.0,)) for b in _row(draft, store.x1, area.x1, y0, area.y1, "east")]
    low = y0 - draft.number(24, 32, "wing_long")
    shops += [(Box(area.x0, max(low, area.y0 + 4), area.x0 + wing, y0 - 0.05), (0.0,))]
    walk = Box(area.x0 + wing, y0 - 7.0, area.x1, y0)
    return _Mall(shops, [store], [walk], [], [Box(area.x0 + wing + 2.0, area.y0, area.x1, y0 - 8.0)])


def _promenade(draft: Draft, area: Box) -> _Mall:
    """Two rows of shops that face one another over a promenade, a store at its end."""
    deep, wide = draft.number(12, 15, "deep"), draft.number(11, 15, "wide")
    y1 = area.y1 - deep
    y0 = y1 - wide
    end = draft.number(24, 30, "store")
    north = [(b, (270.0,)) for b in _row(draft, area.x0, area.x1 - end - 8, y1, area.y1, "north")]
    south = [(b, (90.0, 270.0)) for b in _row(draft, area.x0, area.x1 - end - 8, y0 - deep, y0, "south")]
    store = Box(area.x1 - end, area.y1 - draft.number(22, 28, "store_deep"), area.x1, area.y1)
    walk, square = Box(area.x0, y0, area.x1 - end - 8, y1), Box(area.x1 - end - 8, y0 - deep, area.x1, store.y0)
    return _Mall([*north, *south], [store], [walk, square], [walk], [Box(area.x0, area.y0, area.x1, y0 - deep - 5.0)])


def _lanes(draft: Draft, area: Box) -> _Mall:
    """Shops on blocks with lanes between them, like a small town, a square among them."""
    y0 = area.y0 + draft.number(0.3, 0.38, "lot") * area.depth
    blocks, lanes = split(draft, area._replace(y0=y0), (6.0, 8.5), (13.0, 24.0))
    near = sorted(blocks, key=lambda b: abs(b.middle[0]) * 0.5 + abs(b.middle[1] - (y0 + area.y1) / 2))
    large = max(near[2:], key=lambda b: b.width)
    shops = [(b, SIDES) for b in near[2:] if b is not large]
    lot = area._replace(y1=y0 - 4.0)
    return _Mall(shops, [large.grown(-0.5)], [area._replace(y0=y0), *near[:2]], lanes, [lot])


def _court(draft: Draft, area: Box) -> _Mall:
    """Shops about a court that is open to the car park, stores at two sides."""
    deep, half = draft.number(13, 16, "deep"), draft.number(22, 28, "half")
    x, y1 = draft.number(-8, 8, "x"), area.y1 - deep
    low = y1 - draft.number(26, 32, "court")
    court = Box(x - half, low, x + half, y1)
    shops = [(b, (270.0,)) for b in _row(draft, x - half, x + half, y1, area.y1, "north")]
    shops.append((Box(x - half - deep, low, x - half, area.y1), (0.0,)))
    shops.append((Box(x + half, low, x + half + deep, area.y1), (180.0,)))
    ends = ((area.x0, x - half - deep - 0.1), (x + half + deep + 0.1, area.x1))
    stores = [Box(a, area.y1 - 22.0, b, area.y1) for a, b in ends if b - a > 17.0]
    return _Mall(shops, stores, [court], [], [Box(area.x0, area.y0, area.x1, low - 5.0)])


def _islands(draft: Draft, area: Box) -> _Mall:
    """Stores that stand alone in a wide car park, a row of shops behind them."""
    deep = draft.number(12, 14, "deep")
    y1 = area.y1 - deep
    shops = [(b, (270.0,)) for b in _row(draft, area.x0, area.x1, y1, area.y1, "north")]
    y = (area.y0 + y1) / 2
    xs = [area.x0 + (k + 0.5) * area.width / 2 + draft.number(-5, 5, "x", k) for k in range(2)]
    stores = [Box(x - 14.0, y - 3.0, x + 14.0, y + 14.0) for x in xs]
    walk = Box(area.x0, y1 - 6.0, area.x1, y1)
    return _Mall(shops, stores, [walk], [], [Box(area.x0, area.y0, area.x1, y - 12.0)])


_TOPOLOGIES = {
    "strip": _strip, "promenade": _promenade, "lanes": _lanes, "court": _court, "islands": _islands,
}  # fmt: skip
