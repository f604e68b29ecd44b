"""Open country from a height model: grass, rock where it is steep, snow high up, sand and water where it is low."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

import contourpy
import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.grammar_props import next_variant
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.kit.natural_ground import settled_z
from aerialdojo_gen.scenes.layouts.places.parts.heights import Heights
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain
from aerialdojo_gen.scenes.values import Metres

Floats = NDArray[np.float64]

# Edges of rock and snow are no contour lines: they waver by so much of a slope, and of a metre of height.
_WAVER, _WAVER_M, _WAVER_LONG_M = 0.12, 1.6, 18.0
_DARK_ROCK = 1.55
_SCREE = 0.8
_SNOW_HOLDS = 1.1
_SMALLEST_M2 = 2.0
_THIN_M = 0.35
_BANK_M = 0.6
_LANDMARKS = ("summit_cross", "fire_tower", "radio_mast")
# Category, least distance, most of them, on which ground.
_GROWTH = (
    ("spruce_tree", 7.0, 70, "grass"), ("oak_tree", 12.0, 18, "grass"), ("birch_tree", 9.0, 24, "grass"),
    ("bush", 6.0, 40, "grass"), ("boulder", 9.0, 36, "rock"), ("boulder", 16.0, 16, "grass"),
    ("dead_tree", 26.0, 8, "rock"), ("tree_stump", 20.0, 10, "grass"), ("fallen_log", 22.0, 8, "grass"),
    ("driftwood", 18.0, 8, "sand"),
    ("reed_clump", 6.0, 20, "sand"),
)  # fmt: skip
_CAMP = ("picnic_set", "log_bench", "backpack", "direction_sign", "cooler_box", "camp_chair")


class Parameters(BaseModel):
    """What a recipe may say of a relief.

    Attributes
    ----------
    heights : Heights
        The ground's.
    rock_slope : float
        Rock shows where the ground rises more than this, metres a metre.
    water_z_m, sand_z_m, snow_z_m : float, optional
        There is water up to, sand up to, snow from this z, metres.
    trees_z_m : float
        Trees grow below it, metres.
    bare : bool
        Nothing grows or lies about.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    heights: Heights
    rock_slope: Annotated[float, Field(ge=0.1, le=5)] = 0.75
    water_z_m: Metres | None = None
    sand_z_m: Metres | None = None
    snow_z_m: Metres | None = None
    trees_z_m: Metres = 2000.0
    bare: bool = False


def build(site: Site) -> None:
    """Build the relief."""
    p: Parameters = site.parameters
    ground = p.heights.terrain(site.recipe.size_m)
    site.set_ground(ground, site.material("grass", "meadow:#7a9148"))
    areas = _paint(site, p, ground)
    if p.water_z_m is not None:
        _water(site, p.water_z_m, ground)
    if not p.bare:
        _grow(site, p, ground, areas)


def _paint(site: Site, p: Parameters, ground: Terrain) -> dict[str, BaseGeometry]:
    """Paint what is seen by height and slope; later ones cover earlier ones."""
    dy, dx = np.gradient(ground.heights_m, ground.cell_m)
    slope, z = np.hypot(dx, dy), ground.heights_m
    waver = _waver(site.recipe.seed, ground)
    steep = slope + _WAVER * waver
    nothing: BaseGeometry = Polygon()
    sand = _where(p.sand_z_m - z + _WAVER_M / 4 * waver, ground) if p.sand_z_m is not None else nothing
    snow = nothing
    if p.snow_z_m is not None:
        snow = _where(np.minimum(z - p.snow_z_m + _WAVER_M * waver, 4.0 * (_SNOW_HOLDS - slope)), ground)
    rock = _where(steep - p.rock_slope, ground)
    patches = _where(0.9 * _waver(site.recipe.seed + 7, ground, 31.0) - 0.42, ground)
    layers = (
        (patches, site.material("grass_dark", "grass:#5f8a3c")),
        (sand, site.material("sand", "sand")),
        (_where(steep - _SCREE * p.rock_slope, ground), site.material("scree", "gravel:#9a958a")),
        (snow, site.material("snow", "snow")),
        (rock, site.material("rock", "rock:#8b8881")),
        (_where(steep - _DARK_ROCK * p.rock_slope, ground), site.material("rock_dark", "rock:#77756f")),
    )
    for area, material in layers:
        if not area.is_empty:
            site.paint(area, material)
    wet = _where(p.water_z_m + _BANK_M - z, ground) if p.water_z_m is not None else nothing
    bare = shapely.union_all([sand, snow, rock, wet])
    return {"grass": site.extent.difference(bare), "rock": rock.difference(wet), "sand": sand.difference(wet)}


def _waver(seed: int, ground: Terrain, long_m: float = _WAVER_LONG_M) -> Floats:
    rows, columns = ground.heights_m.shape
    x, y = (np.arange(n) * ground.cell_m / long_m for n in (columns, rows))
    noise = OpenSimplex(seed=seed)
    return np.asarray(noise.noise2array(x, y) + 0.5 * OpenSimplex(seed=seed + 1).noise2array(3 * x, 3 * y))


def _where(value: Floats, ground: Terrain) -> BaseGeometry:
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


def _water(site: Site, level_m: float, ground: Terrain) -> None:
    """Lay a level sheet where the ground is lower: it ends within the ground, so that no gap shows at its shore."""
    pool = _where(level_m - ground.heights_m + 0.05, ground).intersection(site.extent)
    parts = [part for part in shapely.get_parts(pool) if isinstance(part, Polygon)]
    if parts:
        from aerialdojo_gen.scenes.grammar_scatter import slab

        body = [(site.material("water", "water"), slab(part, level_m - 0.08, level_m)) for part in parts]
        site.add(None, "water_surface", body)
        site.occupy(shapely.union_all(parts))


def _grow(site: Site, p: Parameters, ground: Terrain, areas: dict[str, BaseGeometry]) -> None:
    """Grow and strew what such ground has, a landmark on the highest free place, a resting place on level grass."""
    _landmark(site, p, ground)
    level = _level_places(site, ground, areas["grass"])
    for k, (x, y) in enumerate(level):
        category = _CAMP[k % len(_CAMP)]
        site.try_place(category, x, y, 37.0 * k, z=settled_z(site, x, y), variant=next_variant(site, category))
    tree_line = _where(p.trees_z_m - ground.heights_m, ground) if p.trees_z_m < 1999.0 else None
    for category, spacing, most, kind in _GROWTH:
        area = areas[kind].intersection(site.extent.buffer(-1.5))
        if category.endswith("_tree") and tree_line is not None:
            area = area.intersection(tree_line)
        if area.is_empty:
            continue
        rng = site.rng_for("grow", category, kind)
        for x, y, yaw in poisson_disc(area, spacing, rng, limit=most):
            site.try_place(category, x, y, yaw, z=settled_z(site, x, y))


def _landmark(site: Site, p: Parameters, ground: Terrain) -> None:
    inner = site.extent.buffer(-8.0)
    corners = ground.corners()
    inside = shapely.contains_xy(inner, corners[:, 0], corners[:, 1])
    spots = corners[inside]
    for k, category in enumerate(_LANDMARKS):
        if not len(spots):
            return
        dry = spots if p.water_z_m is None else spots[spots[:, 2] > p.water_z_m + 1.0]
        if not len(dry):
            return
        x, y, _ = dry[int(np.argmax(dry[:, 2]))]
        site.try_place(category, float(x), float(y), 90.0 * k, z=settled_z(site, float(x), float(y), 1.0))
        # The next one stands far from it.
        spots = spots[np.hypot(spots[:, 0] - x, spots[:, 1] - y) > 0.45 * max(site.recipe.size_m)]


def _level_places(site: Site, ground: Terrain, grass: BaseGeometry) -> list[tuple[float, float]]:
    inner = grass.intersection(site.extent.buffer(-4.0)).buffer(-1.0)
    rng = site.rng_for("level")
    spots = poisson_disc(inner, 14.0, rng, limit=120)

    def tilt(pose: tuple[float, float, float]) -> float:
        x, y, _ = pose
        return float(abs(ground.z(x + 1, y) - ground.z(x - 1, y)) + abs(ground.z(x, y + 1) - ground.z(x, y - 1)))

    return [(x, y) for x, y, _ in sorted(spots, key=tilt)[: 2 * len(_CAMP)]]
