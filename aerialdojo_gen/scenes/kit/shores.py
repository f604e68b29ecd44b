"""Shores: the sea painted level before a coastline, beaches, cliffs, rocks; the sea is level at z = 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.mesh import merge, posed, rotation
from aerialdojo_gen.scenes.plans.values import Area, Box, Material, Number
from aerialdojo_gen.scenes.shapes import crown
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain

_Spacing = Annotated[Number, Field(ge=0.5)]


@site_builder
def paint_sea(
    site: Site, *, land: Area, shallow_m: _Spacing = 9.0, deep: Material = "water:#2f7d9a",
    shallow: Material = "water:#55a9ac", lagoon: Material = "water:#7cc4bd", foam: Material = "water:#dcebe8",
    wet: Material = "sand:#b99c6c",
) -> None:  # fmt: skip
    """Paint the sea about a land: deep water, ragged belts of shallows and lagoon, foam, and wet sand on the land."""
    seed = site.head.seed
    sea = site.extent.difference(land)
    site.paint(sea, deep)
    shore = land.boundary.intersection(site.extent)
    spots = _points(shore, 0.8 * shallow_m)
    belt = [blob(p.x, p.y, shallow_m, seed + 300 + k, 0.4) for k, p in enumerate(spots)]
    site.paint(shapely.union_all(belt).intersection(sea), shallow)
    near = [blob(p.x, p.y, 0.4 * shallow_m, seed + 500 + k, 0.4) for k, p in enumerate(spots)]
    calm = shapely.union_all([*near, land.buffer(0.25 * shallow_m, quad_segs=3)]).intersection(sea)
    site.paint(calm, lagoon)
    froth = [blob(p.x, p.y, 0.9, seed + 700 + k, 0.5) for k, p in enumerate(_points(shore, 2.1))]
    site.paint(shapely.union_all(froth).difference(land.buffer(-0.35)), foam)
    site.paint(land.difference(land.buffer(-1.5, quad_segs=3)), wet)


@site_builder
def paint_beach(
    site: Site, *, land: Area, width_m: Number, material: Material, lobe_m: Number = 3.2, spacing_m: _Spacing = 4.0,
    seed: int = 0,
) -> None:  # fmt: skip
    """Paint a beach along a coastline, its inner edge ragged."""
    inner = land.buffer(-width_m)
    lobes = [blob(p.x, p.y, lobe_m, seed + k, 0.5) for k, p in enumerate(_points(inner.boundary, spacing_m))]
    site.paint(land.difference(inner).union(shapely.union_all(lobes).intersection(land)), material)


@dataclass(frozen=True)
class Patches:
    """Patches of one material, painted as one area."""

    material: Material
    count: Annotated[int, Field(ge=0, le=1000)]
    radius_m: tuple[Number, Number]
    box: Box  # Where their middles are drawn
    within: Area
    ragged: Number = 0.5
    seed: int = 0  # Of the first one's outline


@site_builder
def paint_heath(site: Site, *, layers: list[Patches], stream: str = "heath") -> None:
    """Paint layers of patches that run into one another, such as heather, moss and grass."""
    rng = site.rng_for(stream)
    for layer in layers:
        low, high = layer.box[:2], layer.box[2:]
        patches = []
        for k in range(layer.count):
            x, y = rng.uniform(low, high)
            radius_m = float(rng.uniform(*layer.radius_m))
            patches.append(blob(float(x), float(y), radius_m, layer.seed + k, layer.ragged))
        site.paint(shapely.union_all(patches).intersection(layer.within), layer.material)


@site_builder
def paint_cliffs(site: Site, *, material: Material, steeper_deg: Number, within: Area | None = None) -> None:
    """Paint the ground that is steeper than an angle."""
    area = steep_area(site.terrain, steeper_deg)
    site.paint(area if within is None else area.intersection(within), material)


@site_builder
def paint_heights(site: Site, *, material: Material, above_m: Number) -> None:
    """Paint the ground that lies higher than a height."""
    corners, faces = site.terrain.corners(), site.terrain.triangles()
    high = (corners[faces][:, :, 2] > above_m).all(axis=1)
    tiles = shapely.polygons(corners[faces[high]][:, :, :2])
    site.paint(shapely.union_all(tiles).buffer(1.6, quad_segs=2).buffer(-1.0, quad_segs=2), material)


def steep_area(terrain: Terrain, degrees: float, over_m: float = 0.7) -> BaseGeometry:
    """Give the area where the ground is steeper than an angle, its outline rounded off by about `over_m` metres."""
    corners, faces = terrain.corners(), terrain.triangles()
    a, b, c = (corners[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    steep = normal[:, 2] < np.cos(np.radians(degrees)) * norm(normal)
    tiles = shapely.polygons(corners[faces[steep]][:, :, :2])
    return shapely.union_all(tiles).buffer(2 * over_m, quad_segs=2).buffer(-over_m, quad_segs=2)


@site_builder
def strew_rocks(
    site: Site, *, area: Area, spacing_m: _Spacing, radius_m: tuple[Number, Number], material: Material,
    category: str = "shore_rocks", limit: Annotated[int, Field(ge=1, le=2000)] = 200, flat: Number = 0.75,
) -> None:  # fmt: skip
    """Strew rocks over an area where it is free, half sunk, as one structure; `flat` is their height over width."""
    rng = site.rng_for("boulders", category, round(area.area, 2))
    bodies, plans = [], []
    for x, y, yaw in poisson_disc(area, spacing_m, rng, limit=limit):
        r = float(rng.uniform(*radius_m))
        z = site.ground_z(x, y)
        if not site.is_free(x, y, r * 0.9, z=z, height_m=r):
            continue
        rock = crown(radii=[r, r * float(rng.uniform(0.7, 1.0)), r * flat], noise=0.3, subdivisions=1,
                     seed=int(rng.integers(1, 60)))  # fmt: skip
        bodies.append(posed(rock, rotation(0.0, 0.0, yaw), (x, y, z + 0.15 * r)))
        plans.append(shapely.Point(x, y).buffer(r, quad_segs=3))
    if bodies:
        site.add(None, category, [(material, merge(bodies))], footprint=shapely.union_all(plans))


def _points(line: BaseGeometry, spacing_m: float) -> list[shapely.Point]:
    count = max(int(line.length / spacing_m), 1)
    return [line.interpolate(k / count, normalized=True) for k in range(count)]
