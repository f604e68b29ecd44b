"""Buildings after a disaster: torn open, pancaked, leaning, or stripped to their frame.

Everything is made in the building's own frame; see `aerialdojo_gen.scenes.kit.wreckage`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Point, Polygon

from aerialdojo_gen.scenes.grammar import Frame, leg, slab
from aerialdojo_gen.scenes.ground import disc, polygons_of, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.buildings import wall_with_openings
from aerialdojo_gen.scenes.kit.structures import block, columns
from aerialdojo_gen.scenes.kit.wreckage import (
    XY,
    Bite,
    Style,
    Wreck,
    bars,
    broken_edge,
    hanging_slab,
    remains,
    torn_floor,
    torn_wall,
)
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, At, Material, Number
from aerialdojo_gen.scenes.shapes import box, extrude, sweep
from aerialdojo_gen.scenes.site import Site

Extent = Annotated[Number, Field(ge=3, le=200)]
_FOOT_M = 0.9
_PARAPET_M = 0.6


@site_builder
def damaged_building(
    site: Site, *, node: str, at: At, yaw_deg: Number = 0.0, size_m: tuple[Extent, Extent],
    storeys: Annotated[int, Field(ge=1, le=40)], style: Style, bites: tuple[Bite, ...] = (), lean_deg: Number = 0.0,
    ridge_m: Number = 0.0, rooms_m: Extent = 6.8, balconies: bool = False, category: str = "damaged_building",
    sunk_m: Number = 0.0,
) -> float:  # fmt: skip
    """Put up what a disaster left of a building, `sunk_m` deep; gives its ground floor's height; see `Wreck`."""
    base = site.ground_z(*at) - sunk_m
    wreck = Wreck(Frame(*at, yaw_deg), *size_m, storeys, style, bites, ridge_m, rooms_m)
    rng = site.rng_for("wreck", round(at[0], 2), round(at[1], 2))
    parts = [*_shell(wreck, rng), *_floors(wreck, rng), *_partitions(wreck, rng)]
    if wreck.style.columns:
        parts += _columns(wreck)
    if wreck.ridge_m:
        parts += _pitched(wreck, rng)
    if balconies:
        parts += _balconies(wreck, rng)
    if lean_deg:
        # It tips over its front edge and digs in there.
        edge = np.array([0.0, wreck.depth_m / 2, 0.0])
        turn = rotation(lean_deg, 0.0, 0.0)
        parts = [(m, posed(translated(b, edge), turn, -edge)) for m, b in parts]
    footprint = wreck.frame.area(remains(wreck.plan, 0.5, wreck.bites))
    site.add(node, category, wreck.frame.parts(parts, base), footprint=footprint)
    return base


@site_builder
def broken_arcade(
    site: Site, *, node: str, plan: Area, at: At, height_m: Extent, hole: Bite, material: Material,
    posts: Annotated[list[At], Field(min_length=1, max_length=200)],
    stubs: Annotated[list[tuple[Number, Number, Number]], Field(max_length=200)],
) -> float:  # fmt: skip
    """Put up an arcade with a hole in its flat roof; gives the height of that roof, metres.

    `plan` is that of the roof, `at` a point of the ground at its floor's height. `posts` reach the roof, `stubs` (x,
    y, height) do not; the hole is in the world frame, torn at all heights below its head.
    """
    base = site.ground_z(*at)
    top = base + height_m
    bodies = [
        torn_floor(plan, top, [replace(hole, z0_m=-99.0)], 0.45),
        columns(posts, base - 0.6, top - 0.4, 0.36, 10),
    ]
    bodies += [columns([(x, y)], base - 0.6, base + h, 0.36, 10) for x, y, h in stubs]
    site.add(node, "arcade", [(material, merge(bodies))])
    for x, y in [*posts, *((x, y) for x, y, _ in stubs)]:
        site.occupy(disc(x, y, 0.5, 8), -100.0, top - 0.3)
    return top


@dataclass(frozen=True)
class Shored:
    """A damaged building whose front is propped, as of `damaged_building`; `props` are at x of its own frame."""

    at: At
    depth_m: Extent
    props: Annotated[list[Number], Field(min_length=1, max_length=50)]
    yaw_deg: Number = 0.0
    leans: bool = False


@site_builder
def raking_shores(
    site: Site, *, node: str, fronts: Annotated[list[Shored], Field(min_length=1, max_length=100)],
    height_m: Number = 5.4,
) -> None:  # fmt: skip
    """Prop leaning and cracked fronts with raking timbers that reach `height_m` over the ground floor."""
    timber = []
    for front in fronts:
        frame, v = Frame(*front.at, front.yaw_deg), -front.depth_m / 2
        reach = 3.2 + (1.1 if front.leans else 0.0)
        for u in front.props:
            foot, head = frame.at(u, v - reach), frame.at(u, v - (0.75 if front.leans else 0.1))
            z0, z1 = site.ground_z(*foot), site.ground_z(*frame.at(u, 0.0)) + height_m
            timber.append(sweep(path=[(*foot, z0 - 0.2), (*head, z1)], section=(0.2, 0.24)))
            low = frame.at(u, v - 0.25)
            tie = [(*frame.at(u, v - reach * 0.55), z0 + 2.2), (*low, z0 + 2.3)]
            timber.append(sweep(path=tie, section=(0.14, 0.16)))
            site.occupy(LineString([foot, head]).buffer(0.3))
    site.add(node, "shores", [("wood", merge(timber))])


def _edges(wreck: Wreck) -> list[tuple[XY, XY]]:
    # Middle lines of the walls, half a wall inside the plan: front, right, back, left.
    x, y = wreck.length_m / 2 - wreck.style.wall_m / 2, wreck.depth_m / 2 - wreck.style.wall_m / 2
    return [((-x, -y), (x, -y)), ((x, -y), (x, y)), ((x, y), (-x, y)), ((-x, y), (-x, -y))]


def _shell(wreck: Wreck, rng: np.random.Generator) -> Parts:
    style, parts = wreck.style, []
    top = wreck.height_m + (0.0 if wreck.ridge_m else _PARAPET_M)
    for side, (a, b) in enumerate(_edges(wreck)):
        (length, _), half = leg(a, b), style.wall_m / 2
        # Front and back run over the corners; the ends stand between them, so that nothing overlaps.
        out = half if side % 2 == 0 else -half
        outline = [(-out, -_FOOT_M), (length + out, -_FOOT_M), (length + out, top), (-out, top)]
        if side % 2 and wreck.ridge_m:
            outline.insert(3, (length / 2, top + wreck.ridge_m * (1.0 - 2 * half / length)))
        openings = _openings(wreck, length, side)
        parts.append((style.wall, torn_wall(a, b, Polygon(outline), wreck.bites, rng, openings, style.wall_m)))
        parts += _windows(wreck, a, b, openings, rng)
    return parts


def _openings(wreck: Wreck, length: float, side: int) -> list[tuple[float, float, float, float]]:
    style = wreck.style
    count = max(round((length - 0.8) / style.bay_m), 1)
    pitch = length / count
    wide, sill, head = style.window_m
    out = []
    for storey in range(wreck.storeys):
        z = storey * style.storey_m
        for k in range(count):
            u = (k + 0.5) * pitch
            if storey == 0 and side == 0 and style.shops:
                out.append((u - 0.4 * pitch, u + 0.4 * pitch, 0.45 if k % 3 else 0.02, 2.6))
            elif storey == 0 and side in (0, 2) and k % 3 == 1:
                out.append((u - 0.65, u + 0.65, 0.02, 2.2))
            elif side % 2 == 0 or k % 2 == 0:
                out.append((u - wide / 2, u + wide / 2, z + sill, z + head))
    return out


def _windows(
    wreck: Wreck, a: XY, b: XY, openings: Sequence[tuple[float, float, float, float]], rng: np.random.Generator
) -> Parts:
    style = wreck.style
    along = (np.array(b) - a) / leg(a, b)[0]
    out = np.array([along[1], -along[0]])
    turn = rotation(0.0, 0.0, math.degrees(math.atan2(along[1], along[0])))
    panes, trims, plumes = [], [], []
    for u0, u1, sill, head in openings:
        at = np.array(a) + along * (u0 + u1) / 2
        near = Point(at).buffer((u1 - u0) / 2 + 0.35)
        draws = rng.uniform(size=2)
        if any(near.intersects(bite.area(z)) for bite in wreck.bites for z in (sill, head + 0.3)):
            continue
        w = u1 - u0
        if sill > 0.1:
            edge = at + out * (style.wall_m / 2 + 0.03)
            trims.append(posed(box(size=[w + 0.24, 0.16, 0.1]), turn, (*edge, sill - 0.1)))
        if draws[0] < style.panes:
            panes.append(posed(box(size=[w, 0.05, head - sill]), turn, (*at, sill)))
            trims.append(posed(box(size=[0.07, 0.1, head - sill]), turn, (*at, sill)))
        if draws[1] < style.soot:
            face = at + out * (style.wall_m / 2 + 0.012)
            plume = box(size=[w * 1.05, 0.02, 0.9 + w * 0.3], taper=(0.55, 1.0))
            plumes.append(posed(plume, turn, (*face, head + 0.01)))
    return [("window", merge(panes)), (style.band, merge(trims)), ("#2a2827", merge(plumes))]


def _floors(wreck: Wreck, rng: np.random.Generator) -> Parts:
    style, parts = wreck.style, []
    inner = wreck.plan.buffer(-style.wall_m, join_style="mitre")
    steel, plates = [], []
    last = wreck.storeys - (1 if wreck.ridge_m else 0)
    for k in range(last + 1):
        z = k * style.storey_m
        body = torn_floor(inner, z, wreck.bites if k else [])
        if not len(body.faces):
            continue
        parts.append((style.floor, body))
        cover = torn_floor(inner.buffer(-0.05), z + 0.03, wreck.bites if k else [], 0.03)
        finish = (style.roof if not wreck.ridge_m else style.floor) if k == wreck.storeys else style.inner[k % 4]
        if k:
            parts.append((finish, cover))
        for n, (at, yaw) in enumerate(broken_edge(inner, z, wreck.bites) if k else ()):
            if style.columns or n % 2:
                steel.append(bars(at, z - 0.12, yaw, rng))
            if n % 7 == 3:
                plates.append(hanging_slab(at, z - 0.02, yaw + float(rng.uniform(-15, 15)), rng))
    return [*parts, ("rust" if style.columns else "wood", merge(steel)), (style.floor, merge(plates))]


def _partitions(wreck: Wreck, rng: np.random.Generator) -> Parts:
    style, parts = wreck.style, []
    count = max(round(wreck.length_m / wreck.rooms_m), 1)
    y = wreck.depth_m / 2 - style.wall_m
    for storey in range(wreck.storeys):
        z0, z1 = storey * style.storey_m, (storey + 1) * style.storey_m - 0.25
        if wreck.ridge_m and storey == wreck.storeys - 1:
            z1 += 0.25
        for k in range(1, count):
            x = -wreck.length_m / 2 + k * wreck.length_m / count
            face = rectangle(0, z0, 2 * y, z1)
            u = y * (0.6 + 0.8 * ((storey + k) % 2))
            wall = torn_wall((x, -y), (x, y), face, wreck.bites, rng, [(u, u + 1.3, z0 + 0.02, z0 + 2.2)], 0.16)
            parts.append((style.inner[(storey + k) % len(style.inner)], wall))
    return parts


def _columns(wreck: Wreck) -> Parts:
    style = wreck.style
    nx, ny = max(round(wreck.length_m / 5.2), 1), max(round(wreck.depth_m / 5.0), 1)
    inset = style.wall_m + 0.25
    bodies = []
    for x in np.linspace(-wreck.length_m / 2 + inset, wreck.length_m / 2 - inset, nx + 1):
        for y in np.linspace(-wreck.depth_m / 2 + inset, wreck.depth_m / 2 - inset, ny + 1):
            for k in range(wreck.storeys):
                z = k * style.storey_m
                # A column stands while the floor that it carries does.
                if wreck.bears(float(x), float(y), k + 1):
                    bodies.append(block(x - 0.2, y - 0.2, x + 0.2, y + 0.2, z - 0.02, z + style.storey_m - 0.24))
    return [(style.floor, merge(bodies))]


def _pitched(wreck: Wreck, rng: np.random.Generator) -> Parts:
    style, over = wreck.style, 0.4
    x, y, rise = wreck.length_m / 2 + over, wreck.depth_m / 2, wreck.ridge_m
    pitch = rise / y
    covers, rafters = [], []
    for side in (-1, 1):
        half = rectangle(-x, min(0.0, side * (y + over)), x, max(0.0, side * (y + over)))
        for piece in polygons_of(remains(half, wreck.height_m + rise / 2, wreck.bites)):
            if piece.area > 1.0:
                flat = extrude(piece, 0.14)
                v = flat.vertices.copy()
                v[:, 2] += wreck.height_m + rise - np.abs(v[:, 1]) * pitch
                covers.append(Mesh(v, flat.faces))
        # Rafters outlast the tiles: some still span the gap.
        for u in np.arange(-x + over + 0.6, x - over, 0.9):
            hole = not wreck.bears(float(u), side * y / 2, wreck.storeys)
            if hole and rng.uniform() < 0.6:
                length = float(np.hypot(y, rise)) * float(rng.uniform(0.5, 1.0))
                beam = box(size=[0.12, length, 0.16])
                slope = rotation(math.degrees(math.atan2(rise, y)), 0.0, 0.0 if side < 0 else 180.0)
                beam = rotated(translated(beam, (0, length / 2, 0)), slope)
                rafters.append(translated(beam, (float(u), side * (y - 0.15), wreck.height_m - 0.1)))
    return [(style.roof, merge(covers)), ("wood", merge(rafters))]


def _balconies(wreck: Wreck, rng: np.random.Generator) -> Parts:
    style = wreck.style
    y, count = -wreck.depth_m / 2, max(round((wreck.length_m - 0.8) / style.bay_m), 1)
    floors, panels = [], []
    for storey in range(1, wreck.storeys):
        z = storey * style.storey_m
        for k in range(0, count, 2):
            x = -wreck.length_m / 2 + (k + 0.5) * wreck.length_m / count
            reach = rectangle(x - 1.6, y - 1.4, x + 1.6, y + 1.0)
            if any(reach.intersects(bite.area(z)) for bite in wreck.bites) or rng.uniform() < 0.12:
                continue
            floors.append(block(x - 1.5, y - 1.3, x + 1.5, y, z - 0.2, z))
            panels.append(block(x - 1.5, y - 1.3, x + 1.5, y - 1.22, z, z + 0.95))
            panels += [block(u, y - 1.22, u + 0.07, y, z, z + 0.95) for u in (x - 1.5, x + 1.43)]
    return [("concrete", merge(floors)), (style.band, merge(panels))]


@dataclass(frozen=True)
class RuinedWall:
    """A wall between two points of the ruin's frame, and its openings (from, to, sill, head), metres."""

    ends: tuple[At, At]
    height_m: Number
    openings: list[tuple[Number, Number, Number, Number]] = field(default_factory=list)


@site_builder
def roofless_walls(
    site: Site, *, node: str, at: At, yaw_deg: Number = 0.0, walls: Annotated[list[RuinedWall], Field(min_length=1)],
    stone: Material, stream: str = "walls", columns: Sequence[At] = (),
    thickness_m: Annotated[Number, Field(ge=0.2, le=3)] = 0.7,
) -> None:  # fmt: skip
    """Put up what is left of a stone building: walls under shorter and shorter courses, and stumps of columns."""
    frame, rng = Frame(*at, yaw_deg), site.rng_for(stream)
    base = min(site.ground_z(*frame.at(*end)) for wall in walls for end in wall.ends) - 0.3
    bodies: list[Mesh] = []
    for wall in walls:
        a, b = (frame.at(*end) for end in wall.ends)
        z = base + wall.height_m + 0.3
        bodies.append(wall_with_openings(a, b, base, z, wall.openings, thickness_m))
        start, way = np.array(wall.ends[0]), np.array(wall.ends[1]) - np.array(wall.ends[0])
        u0, u1 = 0.0, 1.0
        for course in range(3):
            u0 += float(rng.uniform(0.05, 0.3)) * (u1 - u0)
            u1 -= float(rng.uniform(0.05, 0.3)) * (u1 - u0)
            # Each piece is set in a little, and starts inside the course below.
            piece = LineString([frame.at(*(start + way * u)) for u in (u0, u1)])
            piece = piece.buffer(thickness_m / 2 - 0.02, cap_style="flat")
            bodies.append(slab(piece, z + 0.45 * course - 0.05, z + 0.45 * course + 0.45))
    for column in columns:
        middle = Point(frame.at(*column))
        bodies.append(slab(middle.buffer(0.42, quad_segs=3), base, base + float(rng.uniform(0.7, 1.6))))
        site.occupy(middle.buffer(0.6))
    feet = [LineString([frame.at(*end) for end in wall.ends]).buffer(thickness_m) for wall in walls]
    site.add(node, node, [(stone, merge(bodies))], footprint=shapely.union_all(feet))
