"""Open country of surveyed heights: a table beside the plan, and what shows by slope and height."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

import contourpy
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.grammar import slab
from aerialdojo_gen.scenes.height_table import read_heights
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.plans import HEIGHTS_SUFFIX
from aerialdojo_gen.scenes.plans.values import Material, Number
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain

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
