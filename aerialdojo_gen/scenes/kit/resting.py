"""Who rests where: people on benches, chairs and seats of stands, birds on wires, vehicles and riders in lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.scenes.grammar import Frame, Pose
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.site import Site

Floats = NDArray[np.float64]
# Parts that are sat on; of a bench all of them make one seat, else each copy is one and faces the middle.
_SEATS = {"bench": "seat", "picnic_table": "bench", "cafe_table": "chair"}
_STAND = "grandstand"
_SEAT_M = (0.37, 0.52)  # heights that feet reach the ground from
_WIDE_M = 0.62  # room of one who sits
_BACK_M = 0.06  # in a seat of a stand one sits so far behind its middle
_SEAT_M2, _BACK_M2 = (0.06, 0.075), (0.008, 0.016)  # triangles of the tops of a stand's seats and of their backs
_WIRES = frozenset({"power_line", "overhead_wire", "light_string", "light_strings", "lift_ropes"})
_THIN_M, _LONG_M = 0.09, 0.9  # a wire's faces
_HIGH_M = (2.2, 16.0)
_TOGETHER = 4
_PERCHED_M = 0.45
_BIRD_M = 0.28  # two faces of a wire may both be chosen: birds are so far apart


def seat_people(site: Site, number: int, dressed: Sequence[str]) -> int:
    """Seat people on what there is to sit on, half of the places at most; returns how many."""
    rng = site.rng_for("life", "seats")
    spots = [spot for thing in site.instances for spot in seats_of(thing)]
    wardrobe = {variant.name: variant for variant in site.catalogue["person"].variants}
    boxes = [(_box_of(thing), thing) for thing in site.instances if thing.category in site.catalogue]
    placed = 0
    for k in rng.permutation(len(spots))[: (len(spots) + 1) // 2]:
        pose, seat_m, top, own = spots[int(k)]
        if placed == number:
            break
        if not _has_room(site, pose, top - seat_m, own, boxes):
            continue
        clothes = wardrobe[dressed[int(rng.integers(len(dressed)))]]
        params = {key: (low + high) / 2 for key, (low, high) in clothes.params.items()}
        # A child's feet would not reach the ground.
        params |= {"seat": seat_m, "bag": 0.0, "height": max(params.get("height", 1.72), 1.6)}
        one = site.place(Placement("sitter", *pose, z=top - seat_m, params=params, roles=clothes.roles, solid=False))
        boxes.append((_box_of(one), one))
        placed += 1
    return placed


def seats_of(thing: Instance) -> list[tuple[Pose, float, float, Instance]]:
    """List places to sit: pose of the hips, height over the feet and over z = 0 in metres, and what is sat on."""
    if thing.category == _STAND:
        return [(pose, 0.43, z, thing) for pose, z in _stand_seats(thing)]
    part = _SEATS.get(thing.category)
    if part is None or thing.anatomy is None:
        return []
    copies = thing.copies_of(part)
    if thing.category == "bench" and copies:
        copies = [np.concatenate(copies)]
    foot = float(thing.bounds[0, 2])
    out = []
    for faces in copies:
        corners = thing.vertices[thing.faces[faces]].reshape(-1, 3)
        top = float(corners[:, 2].max())
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        yaw = thing.anatomy.yaw_rad
        if thing.category != "bench":
            away = thing.centroid - middle
            yaw = math.atan2(away[1], away[0])
        if thing.category == "picnic_table":
            # Its benches run along its own y.
            turn = thing.anatomy.yaw_rad
            yaw = turn if math.cos(yaw - turn) > 0 else turn + math.pi
        across = np.array([-math.sin(yaw), math.cos(yaw)])
        reach = (corners[:, :2] - middle[:2]) * across
        long = float(np.ptp(reach.sum(axis=1)))
        count = max(math.floor(long / _WIDE_M), 1)
        if _SEAT_M[0] <= top - foot <= _SEAT_M[1]:
            for k in range(count):
                x, y = (middle[:2] + across * (k - (count - 1) / 2) * _WIDE_M).tolist()
                out.append((Pose(x, y, math.degrees(yaw)), top - foot, top, thing))
    return out


def _stand_seats(stand: Instance) -> list[tuple[Pose, float]]:
    """Seats of a stand: each faces away from its back."""
    corners = stand.vertices[stand.faces]
    sizes = areas(stand.vertices, stand.faces)
    level = np.ptp(corners[:, :, 2], axis=1) < 1e-3
    seats = _middles(corners[level & (sizes > _SEAT_M2[0]) & (sizes < _SEAT_M2[1])])
    backs = _middles(corners[level & (sizes > _BACK_M2[0]) & (sizes < _BACK_M2[1])])
    if not len(seats) or not len(backs):
        return []
    near = shapely.STRtree(shapely.points(backs[:, :2])).nearest(shapely.points(seats[:, :2]))
    out = []
    for (x, y, z), (u, v, _) in zip(seats.tolist(), backs[near].tolist(), strict=True):
        away = math.hypot(x - u, y - v)
        if 0.1 < away < 0.35:
            c, s = (x - u) / away, (y - v) / away
            out.append((Pose(x - _BACK_M * c, y - _BACK_M * s, math.degrees(math.atan2(s, c))), z))
    return out


def _middles(triangles: Floats) -> Floats:
    """Middles of the rectangles that pairs of triangles make, (n, 3): of the upper one of a box's two."""
    edges = np.stack([triangles[:, k] - triangles[:, k - 1] for k in range(3)], axis=1)
    longest = np.argmax((edges * edges).sum(axis=2), axis=1)
    rows = np.arange(len(triangles))
    middles = np.round((triangles[rows, longest] + triangles[rows, longest - 1]) / 2, 4)
    highest: dict[tuple[float, float], Floats] = {}
    for at in middles:
        key = (float(np.round(at[0], 2)), float(np.round(at[1], 2)))
        if key not in highest or at[2] > highest[key][2]:
            highest[key] = at
    return np.array(list(highest.values())).reshape(-1, 3)


def _has_room(
    site: Site, pose: Pose, foot_m: float, own: Instance, boxes: Sequence[tuple[Polygon, Instance]]
) -> bool:
    """Whether nobody and nothing is where one sits, and the feet are on level ground or on a deck."""
    frame = Frame(*pose)
    x, y = frame.at(0.45, 0.0)
    ground = site.ground_z(x, y)
    if foot_m < ground + 0.3 and abs(foot_m - ground) > 0.05:
        return False
    outline = frame.area(shapely.box(-0.2, -0.26, 0.62, 0.26))
    if own.category == "bench" and not site.is_free(*frame.at(0.75, 0.0), 0.2, foot_m + 0.05, 1.2):
        return False
    low, high = foot_m + 0.05, foot_m + 1.3
    return not any(
        thing is not own and box.intersects(outline) and thing.bounds[0, 2] < high and thing.bounds[1, 2] > low
        for box, thing in boxes
    )


def _box_of(thing: Instance) -> Polygon:
    return shapely.box(*thing.bounds[:, :2].ravel())


def perch_on_wires(site: Site, category: str, number: int, rng: np.random.Generator) -> int:
    """Place birds in rows on wires, turned across them; returns how many."""
    perches: list[Floats] = []
    for thing in site.instances:
        wires = _wires_of(site, thing) if thing.category in _WIRES else np.zeros((0, 2, 3))
        if not len(wires):
            continue
        caster = TriangleRayCaster(thing.vertices, thing.faces)
        for k in rng.permutation(len(wires))[:3]:
            (a, b), room = wires[int(k)], min(int(rng.integers(2, _TOGETHER + 1)), number - len(perches))
            long = math.hypot(b[0] - a[0], b[1] - a[1])
            first = float(rng.uniform(0.15, 0.5)) * long
            for j in range(room):
                along = first + j * _PERCHED_M + float(rng.uniform(0.0, 0.15))
                if along < long - 0.15:
                    _perched(site, category, a + (b - a) * (along / long), b - a, caster, rng, perches)
    return len(perches)


def _perched(
    site: Site, category: str, at: Floats, way: Floats, caster: TriangleRayCaster, rng: np.random.Generator,
    perches: list[Floats],
) -> None:  # fmt: skip
    """Place a bird on the ridge of a wire near a point, where it has room, and note its place."""
    yaw = math.atan2(way[1], way[0])
    across = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    from_above = at + np.linspace(-0.05, 0.05, 21)[:, None] * across + np.array([0.0, 0.0, 0.5])
    away, _ = caster.first_hit(from_above, np.tile([0.0, 0.0, -1.0], (len(from_above), 1)))
    top = 0.5 - away
    if not np.isfinite(away).any() or float(top.max()) < -0.1:
        return
    x, y, _ = from_above[top > float(top.max()) - 1e-3].mean(axis=0).tolist()
    z = float(at[2] + top.max())
    bird = np.array([x, y, z])
    if not site.is_free(x, y, 0.25, z + 0.05, 0.4) or any(np.abs(bird - one).max() < _BIRD_M for one in perches):
        return
    side = 90.0 if rng.random() < 0.7 else -90.0
    site.place(Placement(category, x, y, math.degrees(yaw) + side, z=z, solid=False))
    perches.append(bird)


def _wires_of(site: Site, thing: Instance) -> Floats:
    """Ends of a thing's long thin faces that are high up and nearly level, (n, 2, 3)."""
    corners = thing.vertices[thing.faces]
    edges = np.stack([corners[:, k] - corners[:, k - 1] for k in range(3)], axis=1)
    lengths = np.sqrt((edges * edges).sum(axis=2))
    longest, rows = np.argmax(lengths, axis=1), np.arange(len(corners))
    long = lengths[rows, longest]
    thin = 2.0 * areas(thing.vertices, thing.faces) / np.maximum(long, 1e-9) < _THIN_M
    ends = np.stack([corners[rows, longest - 1], corners[rows, longest]], axis=1)
    level = np.abs(ends[:, 1, 2] - ends[:, 0, 2]) < 0.15 * long
    out = ends[thin & level & (long > _LONG_M)]
    heights = [z - site.ground_z(x, y) for x, y, z in out.mean(axis=1).tolist()]
    return out[[_HIGH_M[0] <= h <= _HIGH_M[1] for h in heights]] if len(out) else out


# Length and width of what drives, metres, how far it stays from what tasks ask for, and how often it is drawn.
_DRIVES = {
    "estate_car": (4.7, 1.9, 2.2, 0.36),
    "cyclist": (1.8, 0.7, 1.5, 0.24),
    "motorcyclist": (2.1, 0.9, 1.5, 0.12),
    "minibus": (5.6, 2.1, 3.5, 0.12),
    "lorry": (7.4, 2.5, 6.0, 0.08),
    "coach": (11.2, 2.8, 7.0, 0.08),
}
_RIM_M = 2.0
_NEAR_M = 6.0  # a crossing that lies so far from a lane is across it
_STOP_M = 3.0  # from the middle of a crossing to the one who waits first
_BEHIND_M = (1.4, 2.6)
_APART_M = (16.0, 42.0)
_PER_LANE_M, _MOST = 30.0, 10
_WIDEST_M = 2.55  # a narrower lane takes no lorry
_LEVEL_M = 0.06
_AT_KERB_M = 0.75


def set_out_traffic(site: Site, number: int | None = None) -> int:
    """Place vehicles and riders one behind the other in the lanes of a site; returns how many.

    By default one for 30 m of lane, ten at most. There are fewer where there is no room.
    """
    length_m = sum(line.length for line, _ in site.lanes)
    number = min(round(length_m / _PER_LANE_M), _MOST) if number is None else number
    occupied = _occupied(site)
    placed = 0
    # Every lane has its turn before one has another.
    queues = [_spots(site, k) for k in range(len(site.lanes))]
    for turn in range(max(map(len, queues), default=0)):
        for k, queue in enumerate(queues):
            if turn < len(queue) and placed < number:
                placed += _placed(site, k, queue[turn], site.rng_for("traffic", k, turn), occupied)
    return placed


def _spots(site: Site, k: int) -> list[tuple[float, bool]]:
    """Where fronts of vehicles are along a lane, metres, and whether each waits behind the one before it."""
    line, lane_m = site.lanes[k]
    rng = site.rng_for("traffic", "spots", k)
    out = []
    for point in site.crossings:
        if line.distance(point) < max(_NEAR_M / 2, lane_m):
            front = line.project(point) - _STOP_M
            out += [(front - j * 6.6 - float(rng.uniform(*_BEHIND_M)) * bool(j), True) for j in range(3)]
    s = float(rng.uniform(6.0, 20.0))
    while s < line.length - _RIM_M:
        if all(abs(s - at) > 12.0 for at, _ in out):
            out.append((s, False))
        s += float(rng.uniform(*_APART_M))
    return out


def _placed(
    site: Site, k: int, spot: tuple[float, bool], rng: np.random.Generator, occupied: Sequence[tuple[Polygon, bool]]
) -> bool:
    """Place one vehicle or rider whose front is at a spot of a lane, the first kind that has room there."""
    line, lane_m = site.lanes[k]
    kinds = [kind for kind, (_, wide, _, _) in _DRIVES.items() if wide < _WIDEST_M - 0.2 or lane_m > _WIDEST_M]
    weights = np.array([_DRIVES[kind][3] for kind in kinds])
    for kind in rng.choice(kinds, len(kinds), replace=False, p=weights / weights.sum()).tolist():
        long, wide, clear_m, _ = _DRIVES[kind]
        aside = max(lane_m / 2 - _AT_KERB_M, 0.0) if kind == "cyclist" else 0.0
        pose = _pose(line, spot[0] - long / 2, long, aside)
        if pose is not None and _fits_lane(site, k, pose, (long, wide), clear_m, occupied):
            variants = site.catalogue[kind].variants
            choice = variants[int(rng.integers(len(variants)))].name
            return site.place(Placement(kind, *pose, choice), "skip") is not None
    return False


def _pose(line: LineString, s: float, long_m: float, aside_m: float) -> Pose | None:
    """Middle and direction of a vehicle on a line; None where it bends or ends under it."""
    if s < long_m / 2 + _RIM_M or s > line.length - long_m / 2 - _RIM_M:
        return None
    back, middle, front = (line.interpolate(s + d * long_m / 2) for d in (-1.0, 0.0, 1.0))
    yaw = math.atan2(front.y - back.y, front.x - back.x)
    if math.hypot((back.x + front.x) / 2 - middle.x, (back.y + front.y) / 2 - middle.y) > 0.15:
        return None
    return Pose(middle.x + aside_m * math.sin(yaw), middle.y - aside_m * math.cos(yaw), math.degrees(yaw))


def _fits_lane(
    site: Site,
    k: int,
    pose: Pose,
    size_m: tuple[float, float],
    clear_m: float,
    occupied: Sequence[tuple[Polygon, bool]],
) -> bool:
    """Whether a vehicle stands level on its own lane, off junctions, clear of all else."""
    long, wide = size_m
    frame = Frame(*pose)
    outline = frame.area(rectangle(-long / 2, -wide / 2, long / 2, wide / 2))
    corners = [frame.at(u * long / 2, v * wide / 2) for u in (-1, 0, 1) for v in (-1, 1)]
    heights = [site.ground_z(*at) for at in corners]
    if max(heights) - min(heights) > _LEVEL_M:
        return False
    for j, (line, lane_m) in enumerate(site.lanes):
        if j != k and outline.distance(line) < lane_m / 2 - 0.35:
            return False
    steps = [frame.at(u, 0.0) for u in np.linspace(-long / 2, long / 2, math.ceil(long / wide) + 1).tolist()]
    if not all(site.is_free(*at, wide / 2 + 0.3) for at in steps):
        return False
    return all(outline.distance(other) > (clear_m if is_target else 0.5) for other, is_target in occupied)


def _occupied(site: Site) -> list[tuple[Polygon, bool]]:
    """Boxes of the catalogue's things as they stand, moved ones too, and whether a task may ask for each."""
    targets = set(site.catalogue.targets)
    return [(_box_of(i), i.category in targets) for i in site.instances if i.category in site.catalogue]
