"""Buildings on an outline: façades of whole windows, roofs, openings; what hangs on their walls and across lanes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.scenes.grammar import Frame, Pose, leg, plates
from aerialdojo_gen.scenes.ground import edge_strip, polygons_of, rectangle, without
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Point, block, deck, railing, stairs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, mesh, posed, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import Area, At, Bodies, Material, Materials, Number
from aerialdojo_gen.scenes.shapes import box, prism, profile, sphere, sweep, upright
from aerialdojo_gen.scenes.site import Site

_RoofKind = Literal["flat", "gable", "hip"]


@site_builder
def building(
    site: Site, *, outline: Area, wall: Material, roof: Material, storeys: int = 2, storey_m: Number = 3.2,
    roof_kind: _RoofKind = "flat", roof_m: Number = 2.5, parapet_m: Number = 0.6, overhang_m: Number = 0.4,
    on: Number | None = None, category: str = "building", attributes: dict[str, str] = {}, extra: Bodies = [],  # noqa: B006
) -> float:  # fmt: skip
    """Put up a building on an outline, on its lowest corner's ground; gives the height of its walls' top, metres."""
    if not isinstance(outline, Polygon):
        raise AssetError("outline: must be an area in one piece")
    z = min(site.ground_z(x, y) for x, y in outline.exterior.coords) if on is None else on
    height_m, form = storeys * storey_m, Roof(roof, roof_kind, roof_m, parapet_m, overhang_m)
    put_up_building(site, outline, wall, form, height_m, z=z, category=category, attributes=attributes, extra=extra)
    return z + height_m


@dataclass(frozen=True)
class Block:
    """One of several plain buildings."""

    outline: Area
    wall: Material
    storeys: int = 2
    roof: Material | None = None  # Its own, and the kind of it
    roof_kind: _RoofKind = "flat"


@site_builder
def town_blocks(
    site: Site, *, blocks: list[Block], roof: Material, storey_m: Number = 3.2, roof_m: Number = 2.5,
    overhang_m: Number = 0.4, on: Number | None = None, category: str = "town_block",
) -> None:  # fmt: skip
    """Put up plain buildings, each on its own outline; their roofs are flat where they say no other kind."""
    for one in blocks:
        building(
            site, outline=one.outline, wall=one.wall, storeys=one.storeys, storey_m=storey_m, roof=one.roof or roof,
            roof_kind=one.roof_kind, roof_m=roof_m, overhang_m=overhang_m, on=on, category=category,
        )  # fmt: skip


class Roof(NamedTuple):
    """A building's roof: the rise and overhang of a pitched one, the parapet of a flat one, metres."""

    material: str
    kind: _RoofKind = "flat"
    rise_m: float = 2.5
    parapet_m: float = 0.6
    overhang_m: float = 0.4


def put_up_building(
    site: Site, plan: Polygon, wall: str, roof: Roof, height_m: float = 6.4, *, z: float | None = None,
    node: str | None = None, category: str = "building", attributes: Mapping[str, str] | None = None,
    extra: Sequence[tuple[str, Mesh]] = (),
) -> Instance:  # fmt: skip
    """Put up a building on an outline (world metres).

    The windows of a façade are stretched to whole ones on every wall.
    """
    base = min(site.ground_z(x, y) for x, y in plan.exterior.coords) if z is None else z
    top = base + height_m
    parts: list[tuple[str, Mesh]] = [(wall, facade(plan, base, top, site.catalogue.materials.tile_m(wall)))]
    if roof.kind == "flat":
        # The roof's sides must not lie in the walls' plane, where both would flicker.
        lid = plan.buffer(-0.02 if roof.parapet_m > 0.0 else 0.15, join_style="mitre")
        parts.append((roof.material, plates(lid, top - 0.3, top)))
        if roof.parapet_m > 0.0:
            parts.append(("concrete", plates(edge_strip(plan, 0.3), top, top + roof.parapet_m)))
    else:
        hip, overhang_m = roof.kind == "hip", roof.overhang_m
        parts += pitched_roof(plan, top, roof.rise_m, wall, roof.material, hip=hip, overhang_m=overhang_m)
    return site.add(node, category, [*parts, *extra], attributes, footprint=plan)


def facade(plan: Polygon, z0_m: float, z1_m: float, tile_m: float) -> Mesh:
    """Make the outer walls of a plan, each a whole number of half texture tiles across and of quarters up.

    A façade's tile is four storeys high and an even number of bays wide, so that no window is cut at a corner or an
    eave; walls that meet begin with its two halves in turn.
    """
    half, quarter = tile_m / 2, tile_m / 4
    up = max(round((z1_m - z0_m) / quarter), 1) * quarter
    vertices: list[tuple[float, float, float]] = []
    faces: list[tuple[int, int, int]] = []
    uvs: list[tuple[tuple[float, float], ...]] = []
    outline = orient(plan)
    for ring in (outline.exterior, *outline.interiors):
        xy = [(float(x), float(y)) for x, y in ring.coords]
        for n, ((ax, ay), (bx, by)) in enumerate(pairwise(xy)):
            length, _ = leg((ax, ay), (bx, by))
            u0 = n % 2 * half
            u1 = u0 + (max(round(length / half), 1) * half if length > 0.7 * half else length)
            k = len(vertices)
            vertices += [(ax, ay, z0_m), (bx, by, z0_m), (bx, by, z1_m), (ax, ay, z1_m)]
            faces += [(k, k + 1, k + 2), (k, k + 2, k + 3)]
            uvs += [((u0, 0.0), (u1, 0.0), (u1, up)), ((u0, 0.0), (u1, up), (u0, up))]
    return mesh(vertices, faces, np.array(uvs))


def pitched_roof(
    plan: Polygon, z_m: float, height_m: float, wall: str, roof: str, *, hip: bool = False, overhang_m: float = 0.4
) -> list[tuple[str, Mesh]]:
    """Make a gable or hip roof over a rectangle, the ridge along its longer side.

    (material, mesh) pairs in world metres.
    """
    centre, length, width, yaw = oriented_rectangle(plan)
    pitch = height_m / (width / 2)
    eave, out = -overhang_m * pitch, width / 2 + overhang_m
    parts: list[tuple[str, Mesh]] = []
    if hip:
        # A short ridge even over a square: an apex would stand twice.
        ridge = max(length - width, 0.2) / 2
        far = length / 2 + overhang_m
        points = [(-far, -out, eave), (far, -out, eave), (far, out, eave), (-far, out, eave),
                  (-ridge, 0.0, height_m), (ridge, 0.0, height_m)]  # fmt: skip
        faces = [(0, 1, 5), (0, 5, 4), (1, 2, 5), (2, 3, 4), (2, 4, 5), (3, 0, 4), (0, 3, 2), (0, 2, 1)]
        parts.append((roof, mesh(points, faces)))
    else:
        thick = 0.18
        under = [(-out, eave), (0.0, height_m), (out, eave)]
        chevron = [*under, *((x, z + thick) for x, z in under[::-1])]
        quarter = rotation(0.0, 0.0, 90.0)
        parts.append((roof, rotated(profile(points=chevron, width=length + 2 * overhang_m), quarter)))
        gable = profile(points=[(-width / 2, 0.0), (width / 2, 0.0), (0.0, height_m)], width=length)
        parts.append((wall, rotated(gable, quarter)))
    return Frame(*centre, yaw).parts(parts, z_m)


def wall_with_openings(
    a: tuple[float, float],
    b: tuple[float, float],
    z0_m: float,
    z1_m: float,
    openings: Sequence[tuple[float, float, float, float]],
    thickness_m: float = 0.3,
) -> Mesh:
    """Make a straight wall from `a` to `b` with openings (from, to, sill, head), metres, to look and fly through."""
    length, yaw = leg(a, b)
    wall = upright(polygons_of(opened(rectangle(0, 0, length, z1_m - z0_m), openings)), thickness_m)
    return posed(wall, rotation(0.0, 0.0, yaw), (*a, z0_m))


def opened(face: BaseGeometry, openings: Sequence[tuple[float, float, float, float]]) -> BaseGeometry:
    """Cut openings (from, to, sill, head) out of a wall's side view."""
    return without(face, [rectangle(u0, sill, u1, head) for u0, u1, sill, head in openings])


def before_walls(plan: Polygon, spacing_m: float, offset_m: float, inset_m: float = 1.0) -> list[Pose]:
    """List poses along a plan's walls, `offset_m` outside them and facing away from them."""
    poses = []
    for p, q in pairwise(orient(plan).exterior.coords):
        wall = LineString([p, q])
        count = int((wall.length - 2 * inset_m) // spacing_m) + 1 if wall.length > 2 * inset_m else 0
        yaw = leg(p, q)[1] - 90.0
        c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
        for k in range(count):
            at = wall.interpolate((wall.length - (count - 1) * spacing_m) / 2 + k * spacing_m)
            poses.append(Pose(float(at.x + c * offset_m), float(at.y + s * offset_m), yaw))
    return poses


def oriented_rectangle(plan: Polygon) -> tuple[tuple[float, float], float, float, float]:
    """Give the least rectangle about a plan: centre, length, width (metres), and yaw of its length (degrees)."""
    corners = np.array(plan.minimum_rotated_rectangle.exterior.coords)[:4]
    legs = np.diff(corners[:3], axis=0)
    lengths = norm(legs)
    long = int(lengths[1] > lengths[0])
    x, y = corners.mean(axis=0)
    return (float(x), float(y)), float(lengths[long]), float(lengths[1 - long]), leg((0.0, 0.0), legs[long])[1]


# A point of a wall's foot, and what the wall faces.
_OnWall = tuple[Number, Number, Number]
# Both ends on walls, and their height.
_Across = tuple[Number, Number, Number, Number, Number]


@dataclass(frozen=True)
class Balcony:
    """A balcony, and the thing that stands on it."""

    at: At
    yaw_deg: Number
    z_m: Number  # Height of its floor
    thing: str | None = None  # Category of the catalogue
    turn_deg: Number = 0.0  # Of the thing, from what the wall faces
    width_m: Number | None = None  # Where they differ from those of the others
    depth_m: Number | None = None


@site_builder
def balconies(
    site: Site, *, on_walls: list[Balcony], width_m: Number = 3.0, depth_m: Number = 1.3,
    floor: Material = "concrete", rail: Material = "iron", phrase: str = "",
) -> None:  # fmt: skip
    """Hang balconies with a door behind each on walls that face `yaw_deg`; the phrase says where the things are."""
    for one in on_walls:
        w, d = (one.width_m or width_m) / 2, one.depth_m or depth_m
        parts = deck(rectangle(0.0, -w, d, w), 0.0, floor=floor, under=floor, thickness_m=0.18)
        path = [(0.05, -w + 0.05), (d - 0.05, -w + 0.05), (d - 0.05, w - 0.05), (0.05, w - 0.05)]
        parts += railing(path, 0.0, pane=None, frame=rail)
        parts.append(("#e9e4d8", block(-0.02, -0.62, 0.06, 0.62, 0.0, 2.25)))
        parts.append(("window", block(-0.02, -0.5, 0.09, 0.5, 0.05, 2.1)))
        parts += [(rail, block(0.0, v - 0.04, d * 0.7, v + 0.04, -0.42, -0.18)) for v in (-w + 0.4, w - 0.4)]
        hung = site.add(None, "balcony", Frame(*one.at, one.yaw_deg).parts(parts, one.z_m))
        if one.thing:
            x, y = (float(c) for c in hung.centroid[:2])
            yaw_deg = one.yaw_deg + one.turn_deg
            site.place(Placement(one.thing, x, y, yaw_deg, z=one.z_m, place=phrase, solid=False))


@site_builder
def fire_escapes(
    site: Site, *, at: list[_OnWall], storeys: Annotated[int, Field(ge=2, le=30)] = 4, storey_m: Number = 3.0,
    frame: Material = "iron",
) -> None:  # fmt: skip
    """Hang fire escapes on walls (x, y, yaw_deg): platforms, flights between them, a ladder."""
    for x, y, yaw_deg in at:
        parts: Parts = []
        for k in range(1, storeys):
            z = k * storey_m + 0.1
            parts += deck(rectangle(0.0, -2.9, 1.35, 2.9), z, floor="rust:#5a4a42", under=frame, thickness_m=0.12)
            parts += railing(
                [(0.05, -2.85), (1.3, -2.85), (1.3, 2.85), (0.05, 2.85)], z, pane="chain_link", frame=frame
            )
            parts.append(("window", block(-0.02, -0.5, 0.08, 0.5, z, z + 1.9)))
            if k + 1 < storeys:
                side = 1 if k % 2 else -1
                parts += stairs(
                    (0.75, -side * 2.3), side * 90.0, 0.7, storey_m, 4.2, z_m=z, tread="iron", stringer=frame
                )
        ladder = [block(1.12, v - 0.03, 1.18, v + 0.03, 0.9, storey_m + 1.1) for v in (2.0, 2.5)]
        ladder += [block(1.12, 2.0, 1.18, 2.5, z, z + 0.04) for z in np.arange(1.1, storey_m + 0.2, 0.32)]
        parts.append((frame, merge(ladder)))
        site.add(None, "fire_escape", Frame(x, y, yaw_deg).parts(parts))


@site_builder
def awnings(site: Site, *, at: list[_OnWall], cloths: Materials, width_m: Number = 3.0, z_m: Number = 2.6) -> None:
    """Hang sloping awnings on walls (x, y, yaw_deg), their lower edges at `z_m`; the cloths are dealt in turn."""
    for k, pose in enumerate(at):
        cloth = cloths[k % len(cloths)]
        slope = rotated(prism(size=(width_m, 1.5, 0.6), section="wedge"), rotation(0.0, 0.0, 90.0))
        parts: Parts = [
            (cloth, translated(slope, (0.75, 0.0, z_m))),
            (cloth, block(1.45, -width_m / 2, 1.5, width_m / 2, z_m - 0.25, z_m)),
        ]
        site.add(None, "awning", Frame(*pose).parts(parts))


@site_builder
def washing_lines(
    site: Site, *, across: list[_Across],
    cloths: Materials = ["#e8e4da", "#b8443a", "#3f6fa8", "#e0b64a", "#6f9a6a", "#d98aa0"],  # noqa: B006
) -> None:  # fmt: skip
    """Hang washing on sagging cords across lanes: (x, y, x, y, z) of each; the cloths are drawn."""
    for x0, y0, x1, y1, z_m in across:
        rng = site.rng_for("washing", x0, y0, z_m)
        line = _sagging((x0, y0), (x1, y1), z_m, 0.35)
        parts: Parts = [("#d8d4c8", sweep(path=line, radius=0.02, sides=4))]
        length, yaw = leg((x0, y0), (x1, y1))
        at = 0.5
        while at < length - 1.0:
            width, drop = float(rng.uniform(0.45, 0.95)), float(rng.uniform(0.6, 1.1))
            t = (at + width / 2) / length
            middle = (x0 + (x1 - x0) * t, y0 + (y1 - y0) * t, z_m - 1.4 * t * (1 - t) - drop)
            cloth = posed(box(size=(width, 0.03, drop)), rotation(0.0, 0.0, yaw), middle)
            parts.append((cloths[int(rng.integers(len(cloths)))], cloth))
            at += width + float(rng.uniform(0.1, 0.4))
        site.add(None, "washing_line", parts)


@site_builder
def light_strings(site: Site, *, across: list[_Across]) -> None:
    """Hang strings of bulbs across lanes: (x, y, x, y, z) of each."""
    for x0, y0, x1, y1, z_m in across:
        line = _sagging((x0, y0), (x1, y1), z_m, 0.6)
        bulbs = [translated(sphere(radius=0.09, subdivisions=0), (x, y, z - 0.1)) for x, y, z in line[1:-1]]
        cord = sweep(path=line, radius=0.02, sides=4)
        site.add(None, "light_string", [("iron", cord), ("light", merge(bulbs))])


def _sagging(a: Point, b: Point, z_m: float, sag_m: float) -> list[tuple[float, float, float]]:
    t = np.linspace(0.0, 1.0, 9)
    return [(a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * s, z_m - 4 * sag_m * s * (1 - s)) for s in t.tolist()]
