"""Amusement parks and sports grounds: halls, booths, lights, flumes, cableways; pitches, running tracks, a rink."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely import contains_xy
from shapely.geometry import LineString, Point, Polygon
from shapely.ops import unary_union

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.portable import distances_along, norm, unit
from aerialdojo_gen.scenes.grammar import Frame, slab, smooth_path
from aerialdojo_gen.scenes.ground import disc, polygons_of, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import block, columns, letters
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, translated
from aerialdojo_gen.scenes.plans.values import Area, At, Line, Material, Materials, Number, Positive
from aerialdojo_gen.scenes.shapes import box, cone, cylinder, prism, sphere, sweep
from aerialdojo_gen.scenes.site import Site

_Words = Annotated[list[str], Field(min_length=1)]
_Count = Annotated[int, Field(ge=1, le=50)]
FLOOR_M, EAVE_M = 0.3, 3.9


@site_builder
def ride_hall(
    site: Site, *, at: At, yaw_deg: Number, size_m: tuple[Number, Number], sign: str, roof: Material,
    trim: Material, floor: Material, node: str | None = None,
) -> float:  # fmt: skip
    """Put up a roofed hall with open sides, as dodgems have, its front along `yaw_deg`; gives its floor's height.

    The flat of the roof lies 3.8 m over the floor.
    """
    frame = Frame(*at, yaw_deg)
    base = site.ground_z(*at)
    u, v = size_m[0] / 2, size_m[1] / 2
    posts = [(s * (u - 0.3), t) for s in (-1, 1) for t in np.linspace(-v + 0.3, v - 0.3, 4)]
    low, high = EAVE_M - 0.4, EAVE_M + 0.35
    rims = [block(t - 0.06, -v - 0.5, t + 0.06, v + 0.5, low, high) for t in (-u - 0.5, u + 0.5)]
    rims += [block(-u - 0.5, t - 0.06, u + 0.5, t + 0.06, low, high) for t in (-v - 0.5, v + 0.5)]
    top = FLOOR_M + 0.28
    bumpers = [block(-u + 0.05, -v, -u + 0.25, v, FLOOR_M, top)]
    bumpers += [block(-u, t - 0.1, u, t + 0.1, FLOOR_M, top) for t in (-v + 0.15, v - 0.15)]
    parts: Parts = [
        (floor, block(-u, -v, u, v, FLOOR_M - 0.05, FLOOR_M)),
        ("concrete", block(-u - 0.1, -v - 0.1, u + 0.1, v + 0.1, -0.3, FLOOR_M - 0.05)),
        (trim, columns(posts, FLOOR_M, EAVE_M, 0.14)),
        (roof, block(-u - 0.5, -v - 0.5, u + 0.5, v + 0.5, EAVE_M, EAVE_M + 0.2)),
        (trim, merge(rims)),
        ("#26282c", block(u + 0.5, -v * 0.8, u + 0.72, v * 0.8, EAVE_M - 0.1, EAVE_M + 1.0)),
        ("light", letters(sign, 0.66, (u + 0.73, 0.0, EAVE_M + 0.1), 0.0, 0.05)),
        ("rubber", merge(bumpers)),
    ]  # fmt: skip
    bulbs = [
        translated(sphere(radius=0.09, subdivisions=0), (u + 0.62, t, EAVE_M - 0.48)) for t in np.linspace(-v, v, 12)
    ]
    parts.append(("light", merge(bulbs)))
    site.add(node, "ride_hall", frame.parts(parts, base), {"material": "metal"})
    return base + FLOOR_M


@site_builder
def booths(
    site: Site, *, at: At, yaw_deg: Number, count: _Count, colours: Materials, words: _Words, node: str | None = None
) -> None:
    """Put up a row of game booths, 3 m wide each, open along `yaw_deg`: counters, prizes, striped roofs, signs."""
    frame = Frame(*at, yaw_deg)
    base = site.ground_z(*at)
    half = count * 1.5
    parts: Parts = []
    for k in range(count):
        a, b = -half + 3.0 * k, -half + 3.0 * (k + 1)
        colour, middle = colours[k % len(colours)], (a + b) / 2
        roof = prism(size=(2.9, 3.2, 0.9))
        parts += [
            (f"boards:{colour}", block(-1.2, a + 0.05, -1.1, b - 0.05, 0.0, 2.5)),
            (f"boards:{colour}", merge([block(-1.2, v - 0.05, 1.0, v + 0.05, 0.0, 2.5) for v in (a + 0.1, b - 0.1)])),
            (f"boards:{colour}", block(0.9, a + 0.15, 1.0, b - 0.15, 0.0, 0.95)),
            ("wood", block(0.7, a + 0.1, 1.25, b - 0.1, 0.95, 1.02)),
            (f"stripes:{colour}", translated(roof, (0.0, middle, 2.5))),
            ("#f1f0ea", block(1.3, a + 0.3, 1.4, b - 0.3, 2.3, 2.75)),
            (colour, letters(words[k % len(words)], 0.3, (1.41, middle, 2.38), 0.0, 0.03)),
            ("wood", merge([block(-1.1, a + 0.15, -0.7, b - 0.15, z, z + 0.05) for z in (1.1, 1.7)])),
        ]
        for j, tone in enumerate(("#e9b52a", "#d8342c", "#2f6fc0", "#e58fb0", "#3f9a5a")):
            toys = [
                translated(sphere(radius=0.17, subdivisions=0), (-0.9, a + 0.5 + 0.5 * j, z + 0.2))
                for z in (1.1, 1.7)
            ]
            parts.append((tone, merge(toys)))
    area = frame.area(rectangle(-1.3, -half, 1.4, half))
    site.add(node, "game_booth", frame.parts(parts, base), {"material": "wooden"}, footprint=area)


@site_builder
def queue_rails(
    site: Site, *, at: At, length_m: Number, lanes: _Count, yaw_deg: Number = 0.0, node: str | None = None
) -> None:
    """Lay a zigzag of barriers for a queue, lanes 1.2 m wide that run along `yaw_deg`."""
    frame = Frame(*at, yaw_deg)
    base = site.ground_z(*at)
    rails, posts = [], []
    for k in range(lanes + 1):
        v = k * 1.2
        a, b = (0.0, length_m - 1.2) if k % 2 else (1.2, length_m)
        if k in (0, lanes):
            a, b = 0.0, length_m
        rails += [sweep(path=[(a, v, z), (b, v, z)], radius=0.035) for z in (0.5, 1.0)]
        posts += [(float(u), v) for u in np.linspace(a, b, 4)]
    parts: Parts = [("steel", merge([*rails, columns(posts, -0.1, 1.03, 0.04, 6)]))]
    site.add(node, "queue_rails", frame.parts(parts, base))


@site_builder
def festoons(site: Site, *, poles: list[At], height_m: Number = 4.6, node: str | None = None) -> None:
    """Put up poles, and hang strings of coloured bulbs from one to the next."""
    tones = ("#e9b52a", "#d8342c", "#2f6fc0", "#3f9a5a")
    bulbs: dict[str, list[Mesh]] = {tone: [] for tone in tones}
    wires = []
    tops = [(x, y, site.ground_z(x, y) + height_m) for x, y in poles]
    mast = cylinder(radius=0.08, height=height_m + 0.1, segments=8)
    masts = [translated(mast, (x, y, z - height_m - 0.05)) for x, y, z in tops]
    for a, b in pairwise(tops):
        t = np.linspace(0.0, 1.0, 9)
        sag = 0.9 * 4.0 * t * (1.0 - t)
        line = np.outer(1.0 - t, a) + np.outer(t, b) - np.column_stack([0 * t, 0 * t, sag])
        wires.append(sweep(path=line.tolist(), radius=0.025, sides=3))
        for k, p in enumerate(line[1:-1]):
            bulbs[tones[k % 4]].append(translated(sphere(radius=0.12, subdivisions=0), p - (0, 0, 0.12)))
    parts: Parts = [("iron", merge([*wires, *masts]))]
    parts += [(tone, merge(many)) for tone, many in bulbs.items()]
    site.add(node, "light_strings", parts)


@site_builder
def entrance_gate(
    site: Site, *, at: At, yaw_deg: Number, name: str, width_m: Number, wall: Material, roof: Material,
    sign: Material,
) -> None:  # fmt: skip
    """Put up an entrance: two round towers with pointed roofs, and an arched board with a name between them."""
    frame = Frame(*at, yaw_deg)
    base = site.ground_z(*at)
    half = width_m / 2 + 1.6
    parts: Parts = []
    for s in (-1, 1):
        foot = (0.0, s * half, 0.0)
        parts += [
            (wall, translated(cylinder(radius=1.5, height=5.2, segments=14), foot)),
            (roof, translated(cone(radius=2.0, height=3.0, segments=14), (0.0, s * half, 5.2))),
            (sign, translated(cylinder(radius=1.56, height=0.5, segments=14), (0.0, s * half, 3.2))),
            ("window", translated(box(size=(3.06, 0.6, 1.2)), (0.0, s * half, 1.4))),
            ("#e9b52a", translated(sphere(radius=0.22), (0.0, s * half, 8.3))),
        ]
    t = np.linspace(0.0, np.pi, 9)
    arch = [(0.0, -(width_m / 2 + 0.2) * float(np.cos(a)), 4.0 + 0.9 * float(np.sin(a))) for a in t]
    parts.append((sign, sweep(path=arch, section=(0.3, 0.5))))
    parts.append((wall, block(-0.15, -width_m / 2 - 0.2, 0.15, width_m / 2 + 0.2, 4.0, 4.25)))
    parts.append(
        (roof, merge([letters(name, 0.75, (s * 0.16, 0.0, 4.95), 0.0 if s > 0 else 180.0, 0.08) for s in (1, -1)]))
    )
    parts.append((sign, block(-0.12, -2.4, 0.12, 2.4, 4.7, 5.85)))
    area = unary_union([frame.area(rectangle(-1.6, s * half - 1.6, 1.6, s * half + 1.6)) for s in (-1, 1)])
    site.add("entrance_gate", "entrance_gate", frame.parts(parts, base), {"material": "stone"}, footprint=area)


@site_builder
def flume(
    site: Site, *, path: Annotated[list[tuple[Number, Number, Number]], Field(min_length=2)], trough: Material,
    leg: Material, smooth: Annotated[int, Field(ge=0, le=4)] = 1, free_m: Number = 2.0, node: str | None = None,
) -> None:  # fmt: skip
    """Lead a water channel along a path (x, y, underside), its corners rounded: a trough on legs, brim full.

    The ground within `free_m` of it stays free.
    """
    corners = LineString([(x, y) for x, y, _ in path])
    xy = smooth_path([(x, y) for x, y, _ in path], smooth)
    marks = [corners.project(Point(x, y)) for x, y, _ in path]
    heights = np.interp([corners.project(Point(p)) for p in xy], marks, [z for _, _, z in path])
    line = np.column_stack([xy, heights])
    parts: Parts = [(trough, sweep(path=(line + np.array([0.0, 0.0, 0.1])).tolist(), section=(2.2, 0.2)))]
    parts.append(("water", sweep(path=(line + np.array([0.0, 0.0, 0.3])).tolist(), section=(1.8, 0.2))))
    flat = LineString(line[:, :2])
    for side in (-1, 1):
        offset = flat.offset_curve(side * 1.05, join_style="mitre")
        if not isinstance(offset, LineString):
            raise ValueError("the path of a flume bends too sharply, or crosses itself")
        rim = np.array(offset.coords)
        s = [flat.project(Point(x, y)) for x, y in rim]
        z = np.interp(s, distances_along(line[:, :2]), line[:, 2])
        edge = np.column_stack([rim, z + 0.45])
        parts.append((trough, sweep(path=edge.tolist(), section=(0.14, 0.7))))
    legs = []
    for d in np.arange(1.0, flat.length, 3.2):
        p = flat.interpolate(d)
        z = float(np.interp(d, distances_along(line[:, :2]), line[:, 2]))
        ground = site.ground_z(p.x, p.y) - 0.2
        if z - ground > 0.4:
            legs.append(block(p.x - 0.14, p.y - 0.14, p.x + 0.14, p.y + 0.14, ground, z + 0.02))
    parts.append((leg, merge(legs)))
    site.add(node, "log_flume", parts, {"material": "metal"})
    site.occupy(flat.buffer(free_m))


@site_builder
def football_pitch(
    site: Site, *, at: At, half_m: tuple[Number, Number], turf: Material, light: Material,
    stripes: Annotated[int, Field(ge=1, le=60)] = 12, border_m: Number = 1.2,
    penalty_m: tuple[Number, Number] = (7.0, 8.0),
    goal_m: tuple[Number, Number] = (2.6, 4.2), circle_m: Number = 5.0, mark: Material = "marking",
) -> None:  # fmt: skip
    """Paint a football pitch along x about `at`: mown stripes, and marks; its areas are (depth, half width)."""
    (cx, cy), (x, y) = at, half_m
    site.paint(rectangle(cx - x - border_m, cy - y - border_m, cx + x + border_m, cy + y + border_m), turf)
    wide = 2 * x / stripes
    for k in range(0, stripes, 2):
        site.paint(rectangle(cx - x + wide * k, cy - y, cx - x + wide * (k + 1), cy + y), light)
    lines = [rectangle(cx - x, cy - y, cx + x, cy + y).exterior, disc(cx, cy, circle_m, 32).exterior]
    for depth, half in (penalty_m, goal_m):
        lines += [rectangle(cx + s * x, cy - half, cx + s * (x - depth), cy + half).exterior for s in (-1, 1)]
    marks = [line.buffer(0.07, cap_style="flat", join_style="mitre") for line in lines]
    spots = [disc(u, cy, 0.2, 10) for u in (cx - x + 5.0, cx, cx + x - 5.0)]
    for area in polygons_of(unary_union([*marks, *spots, rectangle(cx - 0.07, cy - y, cx + 0.07, cy + y)])):
        site.paint(area, mark)


@site_builder
def running_track(
    site: Site, *, line: Line, inner_m: Number, lanes: Annotated[int, Field(ge=1, le=12)], lane_m: Number,
    track: Material, apron: Material, turf: Material, apron_m: Number = 1.6, mark: Material = "marking",
) -> None:  # fmt: skip
    """Paint a running track about a line, with an apron around it and turf within; `inner_m` is its inner radius."""
    outer_m = inner_m + lanes * lane_m
    site.paint(_about(line, outer_m + apron_m), apron)
    site.paint(_about(line, outer_m), track)
    for k in range(1, lanes):
        site.paint(_about(line, inner_m + k * lane_m).exterior.buffer(0.05), mark)
    site.paint(_about(line, inner_m + 0.12), mark)
    site.paint(_about(line, inner_m), turf)


@site_builder
def track_railing(
    site: Site, *, line: Line, away_m: Number, within: Area, bars: list[tuple[Number, Number]], post_m: Number = 1.0,
    node: str | None = None, material: Material = "#f1f0ea",
) -> None:  # fmt: skip
    """Put up a railing about a line: bars between two heights each, and posts."""
    ring = _about(line, away_m + 0.06).difference(_about(line, away_m - 0.06))
    pieces = polygons_of(ring.intersection(within))
    posts = [(x, y) for x, y in _about(line, away_m).exterior.simplify(0.05).coords if contains_xy(within, x, y)]
    parts: Parts = [(material, merge([slab(piece, *z) for z in bars for piece in pieces]))]
    site.add(node, "track_railing", [*parts, (material, columns(posts, 0.0, post_m, 0.06, 6))])


@site_builder
def bank_kerbs(
    site: Site, *, line: Line, away_m: list[Number], within: Area, gaps_y: list[Number], gap_m: Number = 3.2,
    section: tuple[Number, Number] = (0.3, 0.7), node: str | None = None, material: Material = "planks",
) -> None:  # fmt: skip
    """Set low walls into a bank about a line, at distances from it, open about some y."""
    kerbs = []
    for away in away_m:
        ring = _about(line, away).exterior.intersection(within)
        for leg in getattr(ring, "geoms", [ring]):
            runs: list[list[tuple[float, float, float]]] = [[]]
            for p in (leg.interpolate(s) for s in np.arange(0.0, leg.length, 2.0)):
                if any(abs(p.y - y) < gap_m / 2 for y in gaps_y):
                    runs.append([])
                else:
                    runs[-1].append((p.x, p.y, site.ground_z(p.x, p.y) + 0.15))
            kerbs += [sweep(path=run, section=section) for run in runs if len(run) > 1]
    site.add(node, "bank_steps", [(material, merge(kerbs))])


def _about(line: Line, radius_m: float) -> Polygon:
    if radius_m <= 0.0:
        raise ValueError(f"the distance from a line must be above 0, got {radius_m:g}")
    return LineString(line).buffer(radius_m, quad_segs=12)


@site_builder
def rink_boards(site: Site, *, rink: Area, boards: Material = "#eef2f6", cap: Material = "#2f5f9e") -> None:
    """Put boards round a level rink, with a gap to step in by."""
    if not isinstance(rink, Polygon):
        raise AssetError("rink: must be an area in one piece")
    z = site.ground_z(rink.centroid.x, rink.centroid.y)
    ring = shapely.get_coordinates(shapely.segmentize(rink.exterior, 3.0))
    gate = len(ring) // 8
    path = [(float(x), float(y), z + 0.45) for x, y in (*ring[gate + 1 :], *ring[1:gate])]
    top = [(x, y, z + 0.96) for x, y, _ in path]
    parts: Parts = [(boards, sweep(path=path, section=(0.12, 1.0))), (cap, sweep(path=top, section=(0.16, 0.08)))]
    site.add(None, "rink_boards", parts, footprint=rink.boundary.buffer(0.25))


# The sag of a rope, as a share of its length.
_SAG = 0.045


@site_builder
def cableway(
    site: Site, *, masts: Line, cabins: Annotated[int, Field(ge=0, le=1000)] = 8, mast_m: Number = 11.6,
    terminal_m: Number = 5.6, gauge_m: Positive = 6.4,
    paints: Materials = ["#d8342c", "#2f5f9e", "#e9b52a", "#3f7d4e"],  # noqa: B006
) -> None:  # fmt: skip
    """Hang two ropes with cabins between the heads of masts; the first and the last are terminals with a wheel."""
    last = len(masts) - 1
    heads = [
        (x, y, site.ground_z(x, y) + (terminal_m if k in (0, last) else mast_m)) for k, (x, y) in enumerate(masts)
    ]
    parts: Parts = []
    hung = 0
    for a, b in pairwise(np.array(heads)):
        along = unit((b - a)[:2])
        side = np.array([-along[1], along[0], 0.0]) * gauge_m / 2
        length = float(norm((b - a)[:2]))
        t = np.linspace(0.0, 1.0, 9)
        sag = -_SAG * length * 4 * t * (1 - t)
        for way in (-1.0, 1.0):
            line = a + (b - a) * t[:, None] + side * way + np.column_stack([0 * t, 0 * t, sag])
            parts.append(("iron", sweep(path=[tuple(map(float, p)) for p in line], radius=0.045, sides=4)))
            count = max(int(length // 16), 1) if hung < cabins else 0
            for k in range(count):
                s = (k + 0.5 + 0.22 * way) / count
                p = a + (b - a) * s + side * way
                z = float(p[2] - _SAG * length * 4 * s * (1 - s))
                yaw_deg = math.degrees(math.atan2(along[1], along[0]))
                parts += _cabin(Frame(float(p[0]), float(p[1]), yaw_deg), z, paints[hung % len(paints)])
                hung += 1
    for x, y, z in (heads[0], heads[-1]):
        foot = site.ground_z(x, y)
        wheel = cylinder(radius=gauge_m / 2, height=0.3, segments=20)
        parts.append(("#3f7d4e", translated(wheel, (x, y, z - 0.15))))
        shaft = cylinder(radius=0.4, height=z - foot + 0.6, segments=10)
        parts.append(("steel", translated(shaft, (x, y, foot - 0.5))))
        parts.append(("concrete", translated(box(size=(2.2, 2.2, 0.5)), (x, y, foot - 0.3))))
    site.add(None, "lift_ropes", parts)


def _cabin(frame: Frame, z: float, paint: str) -> Parts:
    body: Parts = [
        (paint, translated(box(size=(1.5, 1.3, 0.75), taper=(1.1, 1.1)), (0, 0, -3.1))),
        ("glass", translated(box(size=(1.6, 1.4, 0.75), taper=(0.94, 0.92)), (0, 0, -2.35))),
        (paint, translated(box(size=(1.55, 1.35, 0.18), taper=(0.8, 0.8)), (0, 0, -1.6))),
        ("steel", translated(cylinder(radius=0.05, height=1.45, segments=6), (0, 0, -1.42))),
    ]
    return frame.parts(body, z)
