"""Works: halls, stores, tank farms, process plants, power houses, yards, and the roads between them."""

from __future__ import annotations

from itertools import cycle, product
from typing import Any

import shapely

from aerialdojo_gen.scenes.worlds.blocks import fence_lines, inner_sides, ring, split
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box
from aerialdojo_gen.scenes.worlds.streets import block_building, front_slots, street_along

Layout = tuple[list[Box], list[Box]]  # Lots and roads
_NAMES = ["NORTH WORKS", "IRON CO", "UNION MILL", "KERAMIK", "HALL 4", "WEST PLANT", "ROLLING MILL", "FOUNDRY"]
_ROAD_M = 6.6


def write(draft: Draft) -> None:
    """Wall the works in beside a street, lay roads and lots, and build on each lot what the topology has next."""
    w, d = draft.half
    draft.section("The street, the roads of the works and the wall")
    street = -d + 5.4
    half = street_along(draft, street)
    site = Box(-w + 2.0, street + half + 2.0, w - 2.0, d - 2.0)
    layout, uses = _TOPOLOGIES[draft.topology]
    lots, roads = layout(draft, site)
    gate = min(roads, key=lambda r: r.y0 + (r.depth < r.width) * 100.0 + abs(r.middle[0]) * 0.1).middle[0]
    _roads(draft, [*roads, Box(gate - 3.3, street + 3.0, gate + 3.3, site.y0)])
    _wall(draft, site, gate)
    lots = sorted((lot.grown(-1.2) for lot in lots), key=lambda b: -b.width * b.depth)
    lot_uses = [(lot, _use(lot, use)) for lot, use in zip(lots, cycle(uses), strict=False)]
    # Offices take their ground before landmarks do, or a chimney stands in one.
    for lot, use in lot_uses:
        if use == "office":
            draft.take(_office_box(lot).shape())
    _landmarks(draft, [lot for lot, use in lot_uses if use in ("yard", "green", "office")])
    for k, (lot, use) in enumerate(lot_uses):
        draft.section(f"A lot: {use}")
        _USES[use](draft, lot, k)
    draft.fill_slots()


def _roads(draft: Draft, roads: list[Box]) -> None:
    draft.paint([road.rounded() for road in roads], draft.material("road"))
    for road in roads:
        draft.slots_over("haul", road.grown(-1.7), 10.5, (10.4, 3.4), yaw_deg=90.0 if road.upright else 0.0)
        draft.take(road.shape())


def _wall(draft: Draft, site: Box, gate: float) -> None:
    kind = draft.pick(["wall", "railing"], "fence")
    brick = {"material": draft.material("fence")} if kind == "wall" else {}
    draft.make("garden_fences", kind=kind, lines=fence_lines(site.grown(1.0), gate, 4.0), **brick)
    for side in (-1, 1):
        draft.slot("gate", gate + side * 5.4, site.y0 - 2.2, 270.0, (3.2, 3.2))


def _use(lot: Box, use: str) -> str:
    """What a lot is used for, where it is large enough; else it is a yard."""
    return "yard" if min(lot.width, lot.depth) < 11.5 and use != "green" else use


def _landmarks(draft: Draft, lots: list[Box]) -> None:
    """Set landmarks up on lots without halls, near their corners."""
    draft.section("Landmarks")
    spots = []
    for n, lot in enumerate(draft.shuffled(lots, "landmark_lots")):
        x, y = lot.middle
        free = [p for p in lot.grown(-2.8).grid(3.0) if draft.is_free(shapely.Point(p))]
        far = sorted(free, key=lambda p: -abs(p[0] - x) - abs(p[1] - y))
        spots += [(*p, draft.pick(SIDES, "landmark", n)) for p in far[:12]]
    draft.landmark(spots)


def _hall(draft: Draft, lot: Box, k: int) -> None:
    """Put up a hall with open gates, machines in it, and goods at its sides."""
    box = _shrunk(draft, lot, k, 4.0)
    eaves = draft.number(6.4, 8.4, "eaves", k)
    kind = draft.pick(["saw", "flat", "gable"], "roof_kind", k)
    roof: dict[str, Any] = {"kind": kind, "material": draft.material("hall_roof", k)}
    roof |= {"teeth": draft.whole(3, 5, "teeth", k)} if kind == "saw" else {}
    roof |= {"lights": draft.whole(2, 4, "lights", k)} if kind == "flat" else {}
    gates: dict[str, list[list[float]]] = {}
    for side, length in (("s", box.width), ("n", box.width), ("w", box.depth), ("e", box.depth)):
        if draft.chance(0.7, "gate", k, side) or side == "s":
            at = round(draft.number(0.15, 0.6, "gate", k, side, "at") * length, 1)
            gates[side] = [[at, round(min(at + 5.0, length - 1.5), 1), 0, 4.8]]
    draft.make(
        "hall", category="works_hall", box=box.rounded(), eaves_m=eaves, wall=draft.material("hall", k), roof=roof,
        gates=gates, name=draft.shuffled(_NAMES, "names")[k % len(_NAMES)], letter_m=1.1, **{"as": f"hall_{k}"},
    )  # fmt: skip
    draft.slots_over("inside", box.grown(-3.0), 6.4, (6.6, 4.0), on=0.0)
    if kind == "flat":
        draft.slots_over("roof", box.grown(-2.4), 6.0, (3.6, 4.6), "hall roof", on=f"hall_{k}")
    _about(draft, box, lot)


def _shrunk(draft: Draft, lot: Box, k: int, by_m: float) -> Box:
    """Take part of a lot: the rest of it is a yard on one side, off what stands there already."""
    side = draft.pick([0, 1, 2, 3], "side", k)
    x0, y0, x1, y1 = lot
    cut = [0.0, 0.0, 0.0, 0.0]
    cut[side] = by_m
    return Box(x0 + cut[0], y0 + cut[1], x1 - cut[2], y1 - cut[3]).grown(-1.4)


def _about(draft: Draft, box: Box, lot: Box) -> None:
    """Offer slots at the fronts of a building, and on what is left of its lot."""
    draft.take(box.shape())
    for yaw in inner_sides(draft, box):
        front_slots(draft, box, yaw, 3.8)
    for x, y in lot.grown(-1.6).grid(5.0):
        if not box.grown(2.6).shape().contains(shapely.Point(x, y)):
            draft.slot("yard", x, y, draft.pick(SIDES, "about", x, y), (4.6, 4.2))


def _store(draft: Draft, lot: Box, k: int) -> None:
    """Put up a closed hall with big doors."""
    box, facing = _shrunk(draft, lot, k, 5.0), draft.pick([90.0, 270.0], "facing", k)
    draft.make(
        "warehouse", box=box.rounded(), height_m=draft.number(5.4, 7.4, "store", k), wall=draft.material("hall", k),
        roof=draft.material("flat_roof", k), doors=draft.material("doors", k), facing_deg=facing,
        name=draft.shuffled(_NAMES, "names")[k % len(_NAMES)], **{"as": f"store_{k}"},
    )  # fmt: skip
    draft.slots_over("roof", box.grown(-2.4), 6.0, (3.6, 4.6), yaw_deg=facing, on=f"store_{k}")
    _about(draft, box, lot)


def _tanks(draft: Draft, lot: Box, k: int) -> None:
    """Wall in a farm of tanks."""
    draft.make("bund", box=lot.grown(-0.8).rounded())
    wide, deep = max(1, int((lot.width - 3.0) // 15.0)), max(1, int((lot.depth - 3.0) // 14.2))
    for i, j in product(range(wide), range(deep)):
        x, y = lot.x0 + (i + 0.5) * lot.width / wide, lot.y0 + (j + 0.5) * lot.depth / deep
        draft.slot("tank", x, y, draft.pick(SIDES, "tank", x, y), (14.2, 13.0))
    draft.slots_over("plant", lot.grown(-1.8), 4.6, (3.8, 3.2))


def _process(draft: Draft, lot: Box, k: int) -> None:
    """Put up a process structure with vessels, a pipe bridge beside it, pumps about it."""
    x, y = lot.middle
    half_u, half_v = min(lot.width / 2 - 3.0, 8.5), min(lot.depth / 2 - 3.4, 5.6)
    if min(half_u, half_v) < 3.4:
        return _yard(draft, lot, k)
    box = Box.about(x, y, 2 * half_u, 2 * half_v)
    levels = [4.2, 8.4, 12.6][: draft.whole(2, 3, "levels", k)]
    vessels = [
        [round(x + u * half_u, 1), round(y + draft.number(-0.3, 0.3, "vessel", k, u) * half_v, 1),
         draft.number(1.0, 1.6, "vessel", k, u, "r"), levels[-1] + draft.number(1.5, 5, "vessel", k, u, "top"),
         draft.material("vessel", k, u)]
        for u in (-0.6, 0.0, 0.6)
    ]  # fmt: skip
    draft.make("process_tower", box=box.rounded(), levels=levels, vessels=vessels, steel=draft.material("steel"))
    line = [[round(lot.x0 + 1.0, 1), round(lot.y0 + 1.6, 1)], [round(lot.x1 - 1.0, 1), round(lot.y0 + 1.6, 1)]]
    pipes = [draft.material("pipe", j) for j in range(4)]
    draft.make("pipe_bridge", line=line, z_m=5.6, pipes=pipes, bay_m=7.0)
    for n, z in enumerate(levels):
        for u in (-0.3, 0.3):
            draft.floors[f"level_{k}_{n}"] = z
            v = (0.75 if n % 2 else -0.75) * half_v
            draft.slot("level", x + u * half_u, y + v, 90.0, (2.2, 2.8), on=f"level_{k}_{n}")
    for u, v in lot.grown(-1.8).grid(4.8):
        if not box.grown(1.6).shape().contains(shapely.Point(u, v)):
            draft.slot("plant", u, v, draft.pick(SIDES, "plant", u, v), (4.4, 4.0))
    return None


def _power(draft: Draft, lot: Box, k: int) -> None:
    """Put up a power house, with heaps of coal beside it."""
    wide, deep = min(lot.width - 3.0, 20.0), min(lot.depth - 3.0, 18.0)
    box = Box(lot.x0 + 1.5, lot.y0 + 1.5, lot.x0 + 1.5 + wide, lot.y0 + 1.5 + deep)
    draft.make(
        "building", outline=box.rounded(), wall=draft.material("industrial", k), roof=draft.material("flat_roof", k),
        storeys=draft.whole(3, 4, "storeys", k), storey_m=3.0, category="power_house", parapet_m=0.8,
        **{"as": f"power_{k}"},
    )  # fmt: skip
    draft.slots_over("roof", box.grown(-2.4), 5.6, (3.6, 4.6), yaw_deg=0.0, on=f"power_{k}")
    heaps = []
    for x, y in Box(box.x1 + 3.0, lot.y0 + 2, lot.x1 - 1, lot.y1 - 2).grid(8.0):
        if lot.x1 - box.x1 > 9.0 and draft.chance(0.5, "heap", x, y):
            heaps.append([round(x, 1), round(y, 1), draft.number(2.4, 3.6, "heap", x, y), "rubble:#35363a"])
            draft.take_disc((x, y), 3.8)
    if heaps:
        draft.make("bulk_heaps", heaps=heaps)
    _about(draft, box, lot)


def _office(draft: Draft, lot: Box, k: int) -> None:
    """Put up offices, with bays for cars before them."""
    box = _office_box(lot)
    if min(box.width, box.depth) < 6.0:
        return _yard(draft, lot, k)
    storeys = max(2, round(draft.knob("storeys")) - draft.whole(0, 1, "office", k))
    draft.paint(lot.rounded(), draft.material("road"))
    front = 180.0 if lot.upright else 270.0
    block_building(draft, box, f"office_{k}", storeys=storeys, street_deg=front, category="office_block")
    count = int((max(lot.width, lot.depth) - 2.0) // 2.7)
    at = (lot.x0 + 5.6, lot.middle[1]) if lot.upright else (lot.middle[0], lot.y0 + 5.6)
    if count > 1:
        row = [round(at[0], 2), round(at[1], 2), front + 180.0, count]
        draft.make("parking_rows", rows=[row], occupancy=draft.number(0.3, 0.7, "cars", k))
    return None


def _office_box(lot: Box) -> Box:
    """Where offices stand on their lot: at its far side, along it."""
    inner, deep = lot.grown(-1), min(11.0, min(lot.width, lot.depth) - 8.5)
    return inner._replace(x0=inner.x1 - deep) if lot.upright else inner._replace(y0=inner.y1 - deep)


def _yard(draft: Draft, lot: Box, k: int) -> None:
    """Leave a yard with goods in rows."""
    draft.paint(lot.rounded(), draft.material("yard", k))
    draft.slots_over("yard", lot.grown(-1.6), 5.6, (8.2, 4.8), "goods")


def _green(draft: Draft, lot: Box, k: int) -> None:
    """Leave a green with trees, and seats for a break."""
    draft.paint(lot.rounded(), draft.material("verge", k))
    for x, y in lot.grown(-1.4).grid(5.0):
        kind = "tree" if draft.chance(0.4, "tree", x, y) else "break"
        draft.slot(kind, x, y, draft.number(0, 360, "green", x, y), (3.4, 3.4))


def _works(draft: Draft, site: Box) -> Layout:
    return split(draft, site, (_ROAD_M, _ROAD_M), (17.0, 34.0))


def _spine(draft: Draft, site: Box) -> Layout:
    """One road from the gate to the far end, lots in rows at both sides."""
    x = draft.number(-0.2, 0.2, "spine") * site.width / 2
    lots, roads = [], [Box(x - 3.6, site.y0, x + 3.6, site.y1)]
    for k, area in enumerate((Box(site.x0, site.y0, x - 3.6, site.y1), Box(x + 3.6, site.y0, site.x1, site.y1))):
        at, n = area.y0, 0
        while at < area.y1 - 12.0:
            deep = min(draft.number(16, 28, "deep", k, n), area.y1 - at)
            deep = area.y1 - at if area.y1 - at - deep < 14.0 else deep
            lots.append(Box(area.x0, at, area.x1, at + deep))
            at, n = at + deep + 3.0, n + 1
    return lots, roads


def _court(draft: Draft, site: Box) -> Layout:
    """Halls about a yard in the middle, a road round it."""
    deep = draft.number(20, 24, "deep")
    inner = site.grown(-deep)
    yard = inner.grown(-_ROAD_M)
    if min(yard.width, yard.depth) < 12.0:
        raise NoRoomError("no room for the yard")
    gate = Box(inner.middle[0] - 3.3, site.y0, inner.middle[0] + 3.3, inner.y0)
    front = [Box(site.x0, site.y0, gate.x0, inner.y0), Box(gate.x1, site.y0, site.x1, inner.y0)]
    sides = [Box(site.x0, inner.y0 + 1, inner.x0, inner.y1 - 1), Box(inner.x1, inner.y0 + 1, site.x1, inner.y1 - 1)]
    back, ways = split(draft, Box(site.x0, inner.y1, site.x1, site.y1), (4.0, 6.0), (20.0, 40.0), "back")
    return [*front, yard, *sides, *back], [*ring(inner, yard), gate, *ways]


_TOPOLOGIES = {
    "works": (_works, ("yard", "hall", "store", "process", "office", "tanks", "power", "green")),
    "spine": (_spine, ("hall", "store", "yard", "power", "hall", "office", "process")),
    "refinery": (_works, ("tanks", "process", "tanks", "process", "yard", "office", "store", "power")),
    "court": (_court, ("yard", "hall", "store", "hall", "office", "power", "store")),
    "mill": (_spine, ("power", "hall", "yard", "green", "store", "office", "tanks")),
}
_USES = {
    "hall": _hall, "store": _store, "tanks": _tanks, "process": _process, "power": _power, "office": _office,
    "yard": _yard, "green": _green,
}  # fmt: skip
