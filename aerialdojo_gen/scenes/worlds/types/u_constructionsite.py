"""Building sites: frames that rise, pits, yards, offices in stacks, cranes."""

from __future__ import annotations

from itertools import product

import shapely

from aerialdojo_gen.scenes.worlds.blocks import fence_lines
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, point
from aerialdojo_gen.scenes.worlds.streets import street_along
from aerialdojo_gen.scenes.worlds.wilds import spot_for

_STOREY_M = 3.5
_FIRMS = ["CITY BUILD", "NORTHWORKS", "KERN SONS", "HAVEN HOMES"]


def write(draft: Draft) -> None:
    """Fence the site in beside a street, raise or dig what is built, then offices, stores, cranes and yards."""
    w, d = draft.half
    draft.step("level_grid", cell_m=1.5)
    draft.section("The street, and the fence with its gate")
    street = -d + 5.4
    half = street_along(draft, street)
    site = Box(-w + 1.6, street + half + 0.8, w - 1.6, d - 1.6)
    gate = draft.number(-0.5, 0.5, "gate") * w
    _fence(draft, site, gate)
    road = Box(gate - 3.4, street + 3.0, gate + 3.4, site.y1 - 4.0)
    draft.paint(road.rounded(), draft.material("haul"))
    cross = Box(site.x0 + 3.0, site.y0 + 2.0, site.x1 - 3.0, site.y0 + 7.6)
    draft.paint(cross.rounded(), draft.material("haul"))
    for box in (road, cross):
        draft.slots_over("haul", box.grown(-1.6), 11.0, (10.9, 3.6), yaw_deg=90.0 if box.upright else 0.0)
        draft.take(box.shape())
    left = Box(site.x0 + 1.5, site.y0 + 9.0, gate - 4.6, site.y1 - 1.5)
    right = Box(gate + 4.6, site.y0 + 9.0, site.x1 - 1.5, site.y1 - 1.5)
    _TOPOLOGIES[draft.topology](draft, *((left, right) if left.width > right.width else (right, left)))
    _stores(draft)
    _cranes(draft)
    draft.slots_over("yard", site.grown(-2.5), 5.4, (7.6, 4.6), free_m=2.5)
    draft.fill_slots()


def _fence(draft: Draft, site: Box, gate: float) -> None:
    """Put hoardings up about the site, open at the gate."""
    boards, name = draft.material("boards"), draft.pick(_FIRMS, "name")
    for k, line in enumerate(fence_lines(site, gate, 4.2)):
        draft.make("hoarding", line=line, boards=boards, **({"name": name} if k < 2 else {}))
        draft.take(shapely.LineString(line).buffer(0.6))
    for side in (-1, 1):
        draft.slot("gate", gate + side * 6.0, site.y0 + 2.2, 270.0, (3.6, 3.6))


def _frame(draft: Draft, box: Box, name: str, storeys: int) -> None:
    """Raise a frame of concrete: floors that step back, a core, walls in some bays, scaffolds at its sides."""
    pitch = draft.number(6.2, 7.2, name, "pitch")
    nx, ny = max(2, int(box.width // pitch)), max(2, int(box.depth // pitch))
    x, y = box.middle
    xs = [round(x + (k - nx / 2) * pitch, 2) for k in range(nx + 1)]
    ys = [round(y + (k - ny / 2) * pitch, 2) for k in range(ny + 1)]
    core_i, core_j = draft.whole(0, max(nx - 2, 0), name, "core_i"), draft.whole(0, ny - 1, name, "core_j")
    shaft = Box(xs[core_i] + 0.7, ys[core_j] + 0.9, xs[core_i] + 5.4, ys[core_j] + 5.6).rounded()
    slabs, floors, i, j = [], list[tuple[float | str, int, int]](), nx, ny
    for k in range(1, storeys + 1):
        draft.floors[f"{name}_{k}"] = round(k * _STOREY_M, 2)
        area = Box(xs[0], ys[0], xs[i], ys[j]).grown(0.8).rounded()
        slabs.append({"area": area, "z": f"{name}_{k}", **({"opening": shaft} if i > core_i and j > core_j else {})})
        floors.append((f"{name}_{k}", i, j))
        if k > 1 and draft.chance(0.6, name, "steps", k):
            if draft.chance(0.5, name, "way", k):
                i = max(core_i + 1, i - draft.whole(1, 2, name, "i", k))
            else:
                j = max(core_j + 1, j - 1)
    draft.section("A frame of concrete")
    draft.paint(box.grown(1.2).rounded(), draft.material("pad"))
    draft.make("concrete_frame", xs=xs, ys=ys, slabs=slabs, concrete=draft.material("concrete"))
    draft.make("stair_core", box=shaft, z=[0, f"{name}_{storeys} + 2.4"], floors=[f for f, _, _ in floors])
    walls = []
    for k, n in product(range(min(2, storeys)), range(nx)):
        z0, z1 = (f"{name}_{k}" if k else 0), f"{name}_{k + 1} - 0.6"
        for row, y in (("s", ys[0]), ("n", ys[-1])):
            covered = floors[k][1] > n and (row == "s" or floors[k][2] == ny)
            if covered and draft.chance(0.45 - 0.2 * k, name, "wall", k, n, row):
                ends = [[round(xs[n] + 0.3, 2), y], [round(xs[n + 1] - 0.3, 2), y]]
                walls.append([*ends, z0, z1, draft.material("masonry", name, k), 2])
    if walls:
        draft.make("infill_walls", walls=walls)
    nets = draft.material("nets").split("+")
    west, east = round(xs[0] - 1.2, 2), round(xs[-1] + 1.2, 2)
    south, north = round(ys[0] - 0.8, 2), round(ys[-1] + 0.8, 2)
    far = round(ys[floors[-1][2]] + 0.8, 2)
    draft.make("scaffold", line=[[west, south], [west, far]], z=[0, f"{name}_{storeys}"], net=nets[0])
    draft.make("scaffold", line=[[east, north], [east, south]], z=[0, f"{name}_1"], net=nets[-1])
    for level, (floor, ni, nj) in enumerate([(0.0, nx, ny), *floors]):
        for a, b in product(range(ni), range(nj)):
            if (a, b) != (core_i, core_j):
                yaw = draft.pick(SIDES, name, level, a, b)
                kind = "floor" if level else "ground floor"
                draft.slot(kind, xs[a] + pitch / 2, ys[b] + pitch / 2, yaw, (3.8, 3.8), on=floor)
    draft.take(shapely.box(xs[0] - 3.0, ys[0] - 1.5, xs[-1] + 3.0, ys[-1] + 1.5))


def _pit(draft: Draft, box: Box) -> None:
    """Dig a pit with a bench and a ramp, and cast a raft at its bottom."""
    deep = draft.number(4.6, 6.4, "pit")
    draft.areas["pit"] = box.rounded()
    draft.step("terraces", area="pit", steps=[[0, 0], [3.0, -deep / 2], [5.6, -deep / 2], [8.6, -deep]])
    inner = box.grown(-9.4)
    draft.section("The pit")
    draft.paint(box.grown(-1.0).rounded(), draft.material("mud"))
    if box.upright:
        start, end = point(box.x0 + 5.0, box.y0 - 1.0), point(box.x0 + 5.0, box.y1 - 12.0)
        raft = inner._replace(x0=inner.x0 + 4)
    else:
        start, end = point(box.x0 - 1.0, box.y0 + 5.0), point(box.x1 - 12.0, box.y0 + 5.0)
        raft = inner._replace(y0=inner.y0 + 4)
    draft.step("earth_ramp", start=[*start, 0], end=[*end, -deep], width_m=5, blend_m=1.8)
    x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    draft.slot("ramp", x, y, 90.0 if box.upright else 0.0, (8.6, 3.6), settle_m=0.5)
    if min(raft.width, raft.depth) > 6.0:
        draft.floors["raft"] = round(-deep + 0.7, 2)
        columns = [[round(x, 2), round(y, 2)] for x, y in raft.grown(-0.5).grid(4.6)]
        walls = [[[round(raft.x0 + 0.4, 2), round(raft.y0 + 2, 2)], [round(raft.x0 + 0.4, 2), round(raft.y1 - 2, 2)]]]
        draft.make("raft_foundation", area=raft.rounded(), z=[-deep, "raft"], columns=columns, walls=walls)
        for k, (x, y) in enumerate(columns[::2]):
            draft.slot("raft", x + 2.3, y + 2.3, draft.pick(SIDES, "raft", k), (3.2, 3.0), on="raft")
    for x, y in inner.grown(2.0).grid(6.0):
        draft.slot("pit", x, y, draft.pick(SIDES, "pit", x, y), (10.8, 5.2), settle_m=0.5)
    for x, y in Box(box.x0 + 3.2, box.y1 - 5.4, box.x1 - 3.2, box.y1 - 3.2).grid(8.0):
        draft.slot("bench", x, y, draft.pick([0.0, 180.0], "bench", x), (6.4, 2.6), settle_m=0.5)
    draft.take(box.grown(1.0).shape())


def _stores(draft: Draft) -> None:
    """Set up offices, bays of aggregate, racks and heaps where there is room."""
    draft.section("Offices and stores")
    wide = draft.whole(3, 5, "columns")
    if (at := spot_for(draft, 4.0 + 1.6 * wide, "offices")) is not None:
        colours = draft.shuffled(["#d9d6cc", "#3f78a8", "#c8842c", "#5f8a5a", "#8a3f3a"], "offices")[:3]
        storeys = draft.whole(2, 3, "office_storeys")
        office, roof = [round(at[0] - 4.0, 1), at[1]], {"as": "offices_roof"}
        draft.make("site_offices", at=office, columns=wide, storeys=storeys, colours=colours, **roof)
        draft.take_disc(at, 3.5 + 1.6 * wide)
        for k in (-1, 1):
            draft.slot("floor", at[0] - 1.5, at[1] + 2.2 * k, 0.0, (2.4, 2.4), on="offices_roof")
    if (at := spot_for(draft, 10.5, "bays")) is not None:
        heaps = ["gravel", "sand", "gravel:#7f7a72"]
        draft.make("aggregate_bays", at=[round(at[0] - 2.6, 1), at[1]], materials=heaps)
        draft.take_disc(at, 10.0)
    for k in range(2):
        if (at := spot_for(draft, 5.6, "racks", k)) is not None:
            draft.make("precast_racks", at=[[round(at[0] - 1.3, 1), at[1]]], panels=5, length_m=6)
            draft.take_disc(at, 5.2)


def _cranes(draft: Draft) -> None:
    """Set up cranes where there is room, on feet that nothing is near to."""
    draft.section("Landmarks")
    feet = ((k, spot_for(draft, 4.2, "crane", k)) for k in range(40))
    spots = [(*at, float(draft.whole(0, 359, "crane", k))) for k, at in feet if at is not None]
    if draft.chance(0.85, "tower_crane"):
        draft.landmark(spots, of=["tower_crane"])
    draft.landmark(spots)


def _tower(draft: Draft, large: Box, _small: Box) -> None:
    """One large frame, and a yard beside it."""
    deep = min(large.depth - 6.0, draft.number(24, 32, "deep"))
    wide = min(large.width - 6.0, draft.number(30, 42, "wide"))
    _frame(draft, Box.about(*large.middle, wide, deep), "frame", round(draft.knob("storeys")))


def _dig(draft: Draft, large: Box, small: Box) -> None:
    """A pit with a ramp, and a small frame beside it."""
    wide = min(large.width - 3.0, draft.number(34, 42, "wide"))
    deep = min(large.depth - 3.0, draft.number(30, 40, "deep"))
    if min(wide, deep) < 27.0:
        raise NoRoomError("no room for the pit")
    _pit(draft, Box.about(*large.middle, wide, deep))
    _annex(draft, small, "annex")


def _annex(draft: Draft, box: Box, name: str) -> None:
    wide, deep = min(box.width - 5.0, 22.0), min(box.depth - 8.0, 17.0)
    if min(wide, deep) > 12.6:
        _frame(draft, Box.about(box.x0 + 3.0 + wide / 2, box.y1 - 3.0 - deep / 2, wide, deep), name, 2)


def _twins(draft: Draft, large: Box, small: Box) -> None:
    """Two frames with a yard between them."""
    for k, box in enumerate((large, small)):
        wide, deep = min(box.width - 6.0, 30.0), min(box.depth - 8.0, draft.number(20, 28, "deep", k))
        if min(wide, deep) > 12.6:
            x = box.middle[0]
            low = box.y0 + 3.0 if k else box.y1 - 3.0 - deep
            storeys = max(2, round(draft.knob("storeys")) - k)
            _frame(draft, Box(x - wide / 2, low, x + wide / 2, low + deep), f"frame_{k}", storeys)


def _housing(draft: Draft, large: Box, small: Box) -> None:
    """A row of houses that are done, a row of frames that are not."""
    house, at = draft.number(8.0, 9.0, "house"), list[list[float]]()
    x, y = large.x0 + 6.0, large.y1 - 6.0
    while x < large.x1 - 5.0:
        at.append([round(x, 2), round(y, 2)])
        x += house + draft.number(2.0, 4.0, "gap", len(at) - 1)
    draft.section("Houses that are done")
    draft.make(
        "house_row", at=at, yaw_deg=270.0, walls=[draft.material("house", k) for k in range(4)],
        style={"width_m": 7.4, "depth_m": 7.6, "storeys": 2, "storey_m": 2.8, "roof_m": 2.6}, storeys=[2, 1, 2],
        roofs=[draft.material("roof", k) for k in range(2)], doors=["#7a3b36", "#2f5a46", "#2f5f9e"],
    )  # fmt: skip
    for n, p in enumerate(at):
        draft.take(shapely.Point(p).buffer(5.9))
        draft.slot("front", large.x0 + 6.0 + n * (house + 3.0), y - 7.6, 270.0, (3.4, 3.4))
    wide = min(large.width - 6.0, 40.0)
    if large.depth > 34.0:
        x = large.middle[0]
        _frame(draft, Box(x - wide / 2, large.y0 + 3.0, x + wide / 2, large.y0 + 17.0), "terrace", 2)
    _annex(draft, small, "annex")


def _station(draft: Draft, large: Box, small: Box) -> None:
    """A pit at one side, a frame that rises out of another at the other."""
    if min(small.width, small.depth) > 29.0:
        _pit(draft, Box.about(*small.middle, small.width, 34.0).grown(-1.0))
    _tower(draft, large, small)


_TOPOLOGIES = {
    "tower": _tower, "pit": _dig, "twins": _twins, "housing": _housing, "station": _station,
}  # fmt: skip
