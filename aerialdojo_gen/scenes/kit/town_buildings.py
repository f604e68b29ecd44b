"""Real places: buildings of a town as maps have them, with roofs; surveyed heights, and what shows on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import contourpy
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.grammar import box_between, slab
from aerialdojo_gen.scenes.ground import edge_strip, polygons_of, rectangle
from aerialdojo_gen.scenes.kit import ground_builder, part_builder, site_builder
from aerialdojo_gen.scenes.kit.buildings import facade, pitched_roof
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, mesh, translated
from aerialdojo_gen.scenes.plans import HEIGHTS_SUFFIX
from aerialdojo_gen.scenes.plans.values import Area, Box, Material, Number
from aerialdojo_gen.scenes.shapes import triangulate
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, read_heights

_SHOP_M = 4.0
# A shop window wants storeys above it, or it is the whole house.
_MIN_ABOVE_M = 2.8
_SUNK_M, _MIN_M2 = 0.3, 0.5


@dataclass(frozen=True)
class Body:
    """A part of a building, between two heights over the lowest ground about the building."""

    outline: Area
    top_m: Annotated[Number, Field(ge=0.5, le=500)]  # The roof is within it
    base_m: Annotated[Number, Field(ge=0, le=400)] = 0.0
    roof: Literal["flat", "gabled", "hipped", "dome"] = "flat"
    roof_m: Annotated[Number, Field(ge=0, le=60)] = 0.0  # Height of the roof over the eaves

    @property
    def plan(self) -> Polygon:
        """Its outline, in one piece."""
        if not isinstance(self.outline, Polygon) or self.outline.area < _MIN_M2:
            raise AssetError(f"outline: must be an area in one piece, of {_MIN_M2:g} square metres or more")
        return self.outline


@dataclass(frozen=True)
class Building:
    """A building of one body or several."""

    bodies: Annotated[list[Body], Field(min_length=1, max_length=100)]
    wall: Material
    roofing: Material = "concrete:#77787a"
    category: str = "building"
    colour: str = ""  # Of its walls, and the street that it is on, as a person says it
    street: str = ""
    name: str = ""  # As on the map
    shops: bool = False  # Whether there are shop windows along its ground floor
    canopy: bool = False  # A roof on posts


@site_builder
def buildings(site: Site, *, buildings: list[Building]) -> None:
    """Put up buildings; each takes its ground.

    Its floor is the lowest ground about it, as maps count heights, and its walls reach a little below.
    """
    for one in buildings:
        plans = [body.plan for body in one.bodies]
        base = min(site.ground_z(x, y) for plan in plans for x, y in plan.exterior.coords)
        parts: Parts = []
        for body, plan in zip(one.bodies, plans, strict=True):
            parts += _canopy(body, plan, base, one) if one.canopy else _body(site, body, plan, base, one)
        attributes = {"colour": one.colour} if one.colour else {}
        attributes |= {"place": f"on {one.street}"} if one.street else {}
        instance = site.add(None, one.category, parts, attributes)
        low = float(instance.bounds[0, 2])
        for plan, body in zip(plans, one.bodies, strict=True):
            # What stands on a flat roof stands within its parapet.
            top = base + body.top_m - (PARAPET_M if body.roof == "flat" else 0.0)
            site.occupy(plan.buffer(0.15), low if body.base_m < 3.0 else base + body.base_m, top - 0.01)


def _body(site: Site, body: Body, plan: Polygon, base: float, building: Building) -> Parts:
    top, foot = base + body.top_m, base + body.base_m
    rise = min(body.roof_m, body.top_m - body.base_m - 1.0) if body.roof != "flat" else 0.0
    rise = rise if rise >= 0.3 else 0.0
    eaves, parts = top - rise, Parts()
    tile = site.catalogue.materials.tile_m
    if body.base_m <= 0.0:
        parts.append(("stone", facade(plan, foot - _SUNK_M, foot, tile("stone"))))
    else:
        parts += [(building.wall, slab(p, foot, foot + 0.2)) for p in polygons_of(plan.buffer(-0.01))]
    if building.shops and body.base_m <= 0.0 and eaves - foot >= _SHOP_M + _MIN_ABOVE_M:
        parts.append(("shopfront", facade(plan, foot, foot + _SHOP_M, tile("shopfront"))))
        foot += _SHOP_M
    parts.append((building.wall, facade(plan, foot, eaves, tile(building.wall))))
    return parts + any_roof(plan, top, rise, body.roof if rise else "flat", building.wall, building.roofing)


def _canopy(body: Body, plan: Polygon, base: float, building: Building) -> Parts:
    top = base + body.top_m
    parts = [(building.roofing, slab(p, top - 0.35, top)) for p in polygons_of(plan)]
    inner = plan.buffer(-0.4, join_style="mitre")
    corners = [c for p in polygons_of(inner) for c in p.simplify(1.0).exterior.coords[:-1]]
    post = box_between(-0.12, -0.12, 0.12, 0.12, base - _SUNK_M, top - 0.3)
    return parts + [("steel", translated(post, (x, y, 0.0))) for x, y in corners]


# Of a rectangle around it that a plan must fill, for a ridge from gable to gable.
_RECTANGLE = 0.93
_GABLE_THICK_M = 0.18
_STEPS = 8
_ON_M = 1e-6
PARAPET_M, _PARAPET_THICK_M = 0.45, 0.3


@part_builder
def gable_roof(
    box: Box, z: Number, rise_m: Number, wall: Material, roof: Material, hip: bool = False, overhang_m: Number = 0.4
) -> Parts:
    """Make a gable or hip roof over a rectangle, the ridge along its longer side."""
    return pitched_roof(rectangle(*box), z, rise_m, wall, roof, hip=hip, overhang_m=overhang_m)


def any_roof(plan: Polygon, top_m: float, rise_m: float, form: str, wall: str, roofing: str) -> Parts:
    """Make a roof over a plan of any outline.

    `top_m` is its highest point, over a flat roof that of the parapet; the eaves lie `rise_m` below. A gable over
    anything but a rectangle is hipped.
    """
    if form == "flat" or rise_m < 0.3:
        return _flat(plan, top_m, roofing)
    around = plan.minimum_rotated_rectangle
    if form == "gabled" and not plan.interiors and plan.area > _RECTANGLE * around.area:
        height = max(rise_m - _GABLE_THICK_M, 0.1)
        return pitched_roof(plan, top_m - rise_m, height, wall, roofing, overhang_m=0.3)
    return [(roofing, _inset(plan, top_m - rise_m, rise_m, round_=form == "dome"))]


def _flat(plan: Polygon, top_m: float, roofing: str) -> Parts:
    # The lid's sides must not lie in the walls' plane, where both would flicker.
    lid = plan.buffer(-0.02, join_style="mitre")
    level = top_m - PARAPET_M
    rim = edge_strip(plan, _PARAPET_THICK_M).buffer(-0.004, join_style="mitre")
    parts = [(roofing, slab(p, level - 0.25, level)) for p in polygons_of(lid)]
    return parts + [("concrete", slab(p, level - 0.05, top_m)) for p in polygons_of(rim)]


def _inset(plan: Polygon, eaves_m: float, rise_m: float, *, round_: bool) -> Mesh:
    """Raise every point by its distance from the outline: hips, ridges and valleys come of themselves."""
    reach = float(shapely.maximum_inscribed_circle(plan, tolerance=0.05).length)
    levels = [reach * k / _STEPS for k in range(_STEPS)] + [reach * 0.985]
    pieces: list[Mesh] = []
    inner: BaseGeometry = plan
    for low, high in zip(levels, [*levels[1:], math.inf], strict=True):
        outer = inner
        inner = plan.buffer(-high, join_style="mitre", mitre_limit=3.0) if math.isfinite(high) else Polygon()
        for ring in polygons_of(outer.difference(inner)):
            flat, faces = triangulate(ring)
            # By the ring that a corner is of: where it points inwards it lies farther from the walls.
            on_outer = shapely.distance(outer.boundary, shapely.points(flat)) < _ON_M
            share = np.where(on_outer, low, min(high, reach)) / reach
            up = np.sqrt(np.maximum(1.0 - (1.0 - share) ** 2, 0.0)) if round_ else share
            pieces.append(mesh(np.column_stack([flat, eaves_m + rise_m * up]), faces))
    whole = merge(pieces)
    top = float(whole.vertices[:, 2].max())
    z = whole.vertices[:, 2]
    # The ridge is as high as was asked for, though the last inset ends a little before it.
    stretched = eaves_m + (z - eaves_m) * (rise_m / max(top - eaves_m, 1e-6))
    return Mesh(np.column_stack([whole.vertices[:, :2], stretched]), whole.faces)


Floats = NDArray[np.float64]

# Edges of rock and snow are no contour lines: they waver by so much of a slope, and of a metre of height.
_WAVER, _WAVER_M, _WAVER_LONG_M = 0.12, 1.6, 18.0
_DARK_ROCK = 1.55
_SCREE = 0.8
_SNOW_HOLDS = 1.1
_SMALLEST_M2 = 2.0
_THIN_M = 0.35
_BANK_M = 0.6


@ground_builder
def surveyed_heights(site: Site, _terrain: Terrain) -> Terrain:
    """Read heights from the table beside the plan: SCENE.heights.asc, an ESRI ASCII grid about the origin, metres."""
    if site.folder is None:
        raise AssetError("the scene has no folder that a table of heights could lie in")
    path = site.folder / f"{site.name}{HEIGHTS_SUFFIX}"
    terrain = read_heights(path)
    (x0, y0), (x1, y1) = terrain.corners()[[0, -1], :2]
    x, y = (side / 2 - 1e-6 for side in site.head.size_m)
    if x0 > -x or y0 > -y or x1 < x or y1 < y:
        raise AssetError(
            f"{path.name} covers x {x0:g} to {x1:g}, y {y0:g} to {y1:g} m, the site has {2 * x:g} by {2 * y:g} m"
        )
    return terrain


@site_builder
def surveyed_surfaces(
    site: Site, *, rock_slope: Annotated[Number, Field(ge=0.1, le=5)] = 0.75, sand_to_m: Number | None = None,
    snow_from_m: Number | None = None, patches: Material = "grass:#5f8a3c", sand: Material = "sand",
    scree: Material = "gravel:#9a958a", snow: Material = "snow", rock: Material = "rock:#8b8881",
    dark_rock: Material = "rock:#77756f",
) -> None:  # fmt: skip
    """Paint the ground: sand and snow by height; rock where it rises more than `rock_slope`, metres a metre."""
    areas = surface_areas(site, rock_slope, sand_to_m, snow_from_m)
    materials = {
        "patches": patches, "sand": sand, "scree": scree, "snow": snow, "rock": rock, "dark_rock": dark_rock,
    }  # fmt: skip
    for key, material in materials.items():
        if not areas[key].is_empty:
            site.paint(areas[key], material)


@site_builder
def water_over_low_ground(site: Site, *, to_m: Number, material: Material = "water") -> None:
    """Lay a level sheet of water where the ground is lower: it ends within the ground, so that no gap shows."""
    pool = where_above(to_m - site.terrain.heights_m + 0.05, site.terrain).intersection(site.extent)
    parts = [part for part in shapely.get_parts(pool) if isinstance(part, Polygon)]
    if parts:
        site.add(None, "water_surface", [(material, slab(part, to_m - 0.08, to_m)) for part in parts])
        site.occupy(shapely.union_all(parts))


def surface_areas(
    site: Site, rock_slope: float, sand_to_m: float | None = None, snow_from_m: float | None = None,
    water_to_m: float | None = None,
) -> dict[str, BaseGeometry]:  # fmt: skip
    """Find what shows where, in the order of painting, and what is wet."""
    ground, seed = site.terrain, site.head.seed
    dy, dx = np.gradient(ground.heights_m, ground.cell_m)
    slope, z = np.hypot(dx, dy), ground.heights_m
    waver = _waver(seed, ground)
    steep = slope + _WAVER * waver
    areas: dict[str, BaseGeometry] = dict.fromkeys(("sand", "snow", "wet"), Polygon())
    areas["patches"] = where_above(0.9 * _waver(seed + 7, ground, 31.0) - 0.42, ground)
    if sand_to_m is not None:
        areas["sand"] = where_above(sand_to_m - z + _WAVER_M / 4 * waver, ground)
    if snow_from_m is not None:
        high = np.minimum(z - snow_from_m + _WAVER_M * waver, 4.0 * (_SNOW_HOLDS - slope))
        areas["snow"] = where_above(high, ground)
    if water_to_m is not None:
        areas["wet"] = where_above(water_to_m + _BANK_M - z, ground)
    for key, share in (("scree", _SCREE), ("rock", 1.0), ("dark_rock", _DARK_ROCK)):
        areas[key] = where_above(steep - share * rock_slope, ground)
    return areas


def where_above(value: Floats, ground: Terrain) -> BaseGeometry:
    """Outline where a value on the terrain's corners is above 0, without scraps."""
    rows, columns = value.shape
    x, y = ground.x0_m + np.arange(columns) * ground.cell_m, ground.y0_m + np.arange(rows) * ground.cell_m
    lines = contourpy.contour_generator(x, y, value, fill_type="OuterOffset").filled(0.0, np.inf)
    plans = []
    for points, offsets in zip(*lines, strict=True):
        rings = [points[a:b] for a, b in pairwise(offsets)]
        if len(rings[0]) > 3:
            plans.append(Polygon(rings[0], [r for r in rings[1:] if len(r) > 3]))
    area = shapely.union_all([shapely.make_valid(plan) for plan in plans])
    # Slivers along contours would only be triangles.
    area = area.buffer(-_THIN_M, quad_segs=1).buffer(_THIN_M, quad_segs=1).simplify(ground.cell_m * 0.15)
    return shapely.union_all([part for part in shapely.get_parts(area) if part.area > _SMALLEST_M2])


def _waver(seed: int, ground: Terrain, long_m: float = _WAVER_LONG_M) -> Floats:
    rows, columns = ground.heights_m.shape
    x, y = (np.arange(n) * ground.cell_m / long_m for n in (columns, rows))
    noise = OpenSimplex(seed=seed)
    return np.asarray(noise.noise2array(x, y) + 0.5 * OpenSimplex(seed=seed + 1).noise2array(3 * x, 3 * y))
