"""Standing traffic: cars, coaches, lorries and riders in their lanes, and queues at crossings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.scenes.grammar import Frame, Pose
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.site import Site

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
    taken = _taken(site)
    placed = 0
    # Every lane has its turn before one has another.
    queues = [_spots(site, k) for k in range(len(site.lanes))]
    for turn in range(max(map(len, queues), default=0)):
        for k, queue in enumerate(queues):
            if turn < len(queue) and placed < number:
                placed += _placed(site, k, queue[turn], site.rng_for("traffic", k, turn), taken)
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
    site: Site, k: int, spot: tuple[float, bool], rng: np.random.Generator, taken: Sequence[tuple[Polygon, bool]]
) -> bool:
    """Place one vehicle or rider whose front is at a spot of a lane, the first kind that has room there."""
    line, lane_m = site.lanes[k]
    kinds = [kind for kind, (_, wide, _, _) in _DRIVES.items() if wide < _WIDEST_M - 0.2 or lane_m > _WIDEST_M]
    weights = np.array([_DRIVES[kind][3] for kind in kinds])
    for kind in rng.choice(kinds, len(kinds), replace=False, p=weights / weights.sum()).tolist():
        long, wide, clear_m, _ = _DRIVES[kind]
        aside = max(lane_m / 2 - _AT_KERB_M, 0.0) if kind == "cyclist" else 0.0
        pose = _pose(line, spot[0] - long / 2, long, aside)
        if pose is not None and _has_room(site, k, pose, (long, wide), clear_m, taken):
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


def _has_room(
    site: Site, k: int, pose: Pose, size_m: tuple[float, float], clear_m: float, taken: Sequence[tuple[Polygon, bool]]
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
    return all(outline.distance(other) > (clear_m if asked else 0.5) for other, asked in taken)


def _taken(site: Site) -> list[tuple[Polygon, bool]]:
    """Boxes of the catalogue's things as they stand, moved ones too, and whether a task may ask for each."""
    known = set(site.catalogue.targets)
    out = []
    for thing in site.instances:
        if thing.category in site.catalogue:
            (x0, y0, _), (x1, y1, _) = thing.bounds
            out.append((shapely.box(x0, y0, x1, y1), thing.category in known))
    return out
