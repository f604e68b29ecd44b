"""What covers natural ground and grows on it: patches, scree, the sea and its shores; woods and undergrowth."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely import contains_xy
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.scenes.grammar import blob, poisson_disc
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.mesh import Mesh, merge, posed, rotation, translated
from aerialdojo_gen.scenes.placement import DRAWN, Placement
from aerialdojo_gen.scenes.plans.model import ScalarField
from aerialdojo_gen.scenes.plans.values import Area, Box, Line, Material, Materials, Number, Positive, Spacing
from aerialdojo_gen.scenes.shapes import crown, cylinder
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain

_Radius = Annotated[Number, Field(ge=0.1)]


@site_builder
def paint_patches(
    site: Site, *, materials: Materials, count: Annotated[int, Field(ge=0, le=1000)],
    radius_m: tuple[_Radius, _Radius], seed: int = 0, ragged: Number = 0.55, stream: str = "patches",
    box: Box | None = None, skip: Annotated[int, Field(ge=0, le=1000)] = 0,
) -> None:  # fmt: skip
    """Paint patches about the site, or a box of it, of the materials in turn.

    `seed` is that of the first one's outline; `skip` leaves out patches that another entry of the stream has drawn.
    """
    rng = site.rng_for(stream)
    rng.uniform(size=3 * skip)
    x0, y0, x1, y1 = box or site.extent.bounds
    for k in range(count):
        x, y = float(rng.uniform(x0, x1)), float(rng.uniform(y0, y1))
        patch = blob(x, y, float(rng.uniform(*radius_m)), seed + k, ragged)
        site.paint(patch, materials[k % len(materials)])


@site_builder
def paint_shore(
    site: Site, *, water: Area, material: Material, count: Annotated[int, Field(ge=1, le=1000)] = 60,
    lobe_m: _Radius = 1.4, seed: int = 0, grow_m: Number = 0.6,
) -> None:  # fmt: skip
    """Paint the shore of waters with an uneven outline; the water itself is painted over it."""
    lobes = _lobes([water.boundary.interpolate(k / count, normalized=True) for k in range(count)], lobe_m, seed, 0.4)
    site.paint(shapely.union_all([water.buffer(grow_m, quad_segs=3), *lobes]), material)


@site_builder
def paint_scree(site: Site, *, areas: list[Area], material: Material, seed: int = 0) -> None:
    """Paint what fell from rocks about their feet."""
    for area in areas:
        lobes = _lobes(shapely.points(shapely.get_coordinates(area)[::3]), 1.5, seed, 0.4)
        site.paint(shapely.union_all([area.buffer(1.1), *lobes]), material)


@site_builder
def strips_beside(site: Site, *, line: Line, offsets_m: list[Number], width_m: Positive, material: Material) -> None:
    """Paint strips beside a line, such as ruts or the marks of a groomer, left of it at positive offsets."""
    for offset_m in offsets_m:
        strip = LineString(line).offset_curve(offset_m)
        if not strip.is_empty:
            site.paint(strip.buffer(width_m / 2, cap_style="flat", quad_segs=2), material)


@site_builder
def paint_sea(
    site: Site, *, land: Area, shallow_m: Spacing = 9.0, deep: Material = "water:#2f7d9a",
    shallow: Material = "water:#55a9ac", lagoon: Material = "water:#7cc4bd", foam: Material = "water:#dcebe8",
    wet: Material = "sand:#b99c6c",
) -> None:  # fmt: skip
    """Paint the sea about a land: deep water, ragged belts of shallows and lagoon, foam, and wet sand on the land."""
    seed = site.head.seed
    sea = site.extent.difference(land)
    site.paint(sea, deep)
    shore = land.boundary.intersection(site.extent)
    spots = _points(shore, 0.8 * shallow_m)
    belt = _lobes(spots, shallow_m, seed + 300, 0.4)
    site.paint(shapely.union_all(belt).intersection(sea), shallow)
    near = _lobes(spots, 0.4 * shallow_m, seed + 500, 0.4)
    calm = shapely.union_all([*near, land.buffer(0.25 * shallow_m, quad_segs=3)]).intersection(sea)
    site.paint(calm, lagoon)
    froth = _lobes(_points(shore, 2.1), 0.9, seed + 700, 0.5)
    site.paint(shapely.union_all(froth).difference(land.buffer(-0.35)), foam)
    site.paint(land.difference(land.buffer(-1.5, quad_segs=3)), wet)


@site_builder
def paint_beach(
    site: Site, *, land: Area, width_m: Number, material: Material, lobe_m: Number = 3.2, spacing_m: Spacing = 4.0,
    seed: int = 0,
) -> None:  # fmt: skip
    """Paint a beach along a coastline, its inner edge ragged."""
    inner = land.buffer(-width_m)
    lobes = _lobes(_points(inner.boundary, spacing_m), lobe_m, seed, 0.5)
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


def downhill_deg(site: Site, x: float, y: float) -> float:
    """Give the direction in which the ground falls, degrees counter-clockwise from +x."""
    east = site.ground_z(x + 1.5, y) - site.ground_z(x - 1.5, y)
    north = site.ground_z(x, y + 1.5) - site.ground_z(x, y - 1.5)
    return math.degrees(math.atan2(-north, -east))


def steep_area(terrain: Terrain, degrees: float) -> BaseGeometry:
    """Give the area where the ground is steeper than an angle, its outline rounded off by about 0.7 m."""
    corners, faces = terrain.corners(), terrain.triangles()
    a, b, c = (corners[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    steep = normal[:, 2] < np.cos(np.radians(degrees)) * norm(normal)
    tiles = shapely.polygons(corners[faces[steep]][:, :, :2])
    return shapely.union_all(tiles).buffer(1.4, quad_segs=2).buffer(-0.7, quad_segs=2)


@site_builder
def strew_rocks(
    site: Site, *, area: Area, spacing_m: Spacing, radius_m: tuple[Number, Number], material: Material,
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


def _lobes(points: Iterable[shapely.Point], radius_m: float, seed: int, ragged: float) -> list[shapely.Polygon]:
    """Make blobs about points, with consecutive seeds."""
    return [blob(p.x, p.y, radius_m, seed + k, ragged) for k, p in enumerate(points)]


def _points(line: BaseGeometry, spacing_m: float) -> list[shapely.Point]:
    count = max(int(line.length / spacing_m), 1)
    return [line.interpolate(k / count, normalized=True) for k in range(count)]


@dataclass(frozen=True)
class Zone:
    """What grows in an area, category after category; anywhere where it has none."""

    of: list[str]
    area: Area | None = None
    steepest_m: Number = 100.0  # Greatest rise of the ground over 2 m


@site_builder
def keep_free(site: Site, *, areas: list[Area], z: tuple[Number, Number] = (-100.0, 1000.0)) -> None:
    """Take areas, between two heights, so that nothing that looks for room stands there later."""
    for area in areas:
        site.occupy(area, *z)


@site_builder
def strew_trees(
    site: Site, *, area: Area, of: Annotated[list[str], Field(min_length=1)], spacing_m: Spacing,
    stream: str = "trees", limit: Annotated[int, Field(ge=1, le=10_000)] = 10_000,
) -> None:  # fmt: skip
    """Strew trees over an area, of categories in turn; a spot without room stays empty."""
    for k, spot in enumerate(poisson_disc(area, spacing_m, site.rng_for(stream), limit=limit)):
        site.place(Placement(of[k % len(of)], *spot, DRAWN), "skip")


@site_builder
def growth(
    site: Site, *, area: Area, zones: list[Zone], spacing_m: Number, room_m: Number, limit: int,
    settle_m: Number = 0.5, stream: str = "growth", by_pose: bool = False,
) -> None:  # fmt: skip
    """Strew plants over an area where there is room about them; each is of the first zone that it lies in.

    The limit and the categories of a zone count those that stand; `by_pose`, those without room too.
    """
    count = 0
    for k, pose in enumerate(poisson_disc(area, spacing_m, site.rng_for(stream))):
        x, y, _ = pose
        count = k if by_pose else count
        zone = next((one for one in zones if one.area is None or contains_xy(one.area, x, y)), None)
        if count >= limit or zone is None:
            continue
        z = site.foot_z(x, y, settle_m)
        steep = abs(site.ground_z(x + 1.0, y) - site.ground_z(x - 1.0, y))
        if steep <= zone.steepest_m and site.is_free(x, y, room_m, z=z):
            plant = Placement(zone.of[count % len(zone.of)], *pose, DRAWN, z)
            count += site.place(plant, "skip") is not None


# Where not even a stem has room, nothing need be grown to find that out.
_STEM_M = 0.3


@dataclass(frozen=True)
class Species:
    """A tree, how well places suit it, and at which share of them it stands: less than 1 for broad crowns."""

    of: str
    habitat: ScalarField
    share: Number = 1.0


@dataclass(frozen=True)
class Strewn:
    """What is strewn, how far apart, and at most how many; the rest as of `strew`."""

    of: str
    spacing_m: Annotated[Number, Field(ge=0.2)]
    limit: Annotated[int, Field(ge=0, le=10_000)]
    scale: Annotated[Number, Field(ge=0.05, le=20)] = 1.0
    roles: dict[str, Material] | None = None
    params: dict[str, Number] | None = None
    attributes: dict[str, str] | None = None


@site_builder
def woods(
    site: Site, *, area: Area, spacing_m: Spacing,
    species: Annotated[list[Species], Field(min_length=1)], density: ScalarField | None = None, place: str = "",
) -> None:  # fmt: skip
    """Grow trees over an area where there is room, of a species drawn by habitat at every place.

    They stand `spacing_m` apart where the density is 1, and further where it is less.
    """
    named = [one.of.partition(":") for one in species]
    habitats = [one.habitat(site) for one in species]
    rng = site.rng_for("woods", named[0][0], spacing_m)
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density(site) if density else None):
        if not site.is_free(x, y, _STEM_M):
            continue
        suits = np.array([habitat(x, y) for habitat in habitats])
        pick = int(rng.choice(len(species), p=suits / suits.sum()))
        if rng.random() > species[pick].share:
            continue
        category, _, variant = named[pick]
        site.place(Placement(category, x, y, yaw, variant or DRAWN, place=place, settle_m=0.3), "skip")


@site_builder
def strew(
    site: Site, *, of: str, area: Area, spacing_m: Annotated[Number, Field(ge=0.2)],
    limit: Annotated[int, Field(ge=0, le=10_000)], density: ScalarField | None = None, place: str = "",
    scale: Annotated[Number, Field(ge=0.05, le=20)] = 1.0, roles: dict[str, Material] | None = None,
    params: dict[str, Number] | None = None, attributes: dict[str, str] | None = None, solid: bool = True,
) -> None:  # fmt: skip
    """Strew undergrowth or stones over an area, where there is room; things that lie are turned along the slope."""
    category, _, variant = of.partition(":")
    rng = site.rng_for("strew", category)
    words = ({"place": place} if place else {}) | (attributes or {})
    count = 0
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density(site) if density else None, limit * 3):
        if count >= limit:
            break
        if not site.is_free(x, y, _STEM_M):
            continue
        turn = downhill_deg(site, x, y) if category == "fallen_log" else yaw
        thing = Placement(
            category, x, y, turn, variant or DRAWN, scale=scale, roles=roles, params=params, attributes=words,
            solid=solid, settle_m=0.5,
        )  # fmt: skip
        count += site.place(thing, "skip") is not None


@site_builder
def undergrowth(
    site: Site, *, area: Area, kinds: list[Strewn], density: ScalarField | None = None, place: str = ""
) -> None:
    """Strew several things over an area, a kind after the other."""
    for kind in kinds:
        strew(site, area=area, density=density, place=place, **vars(kind))


@site_builder
def broadleaves(
    site: Site, *, area: Area, spacing_m: Spacing, limit: Annotated[int, Field(ge=1, le=2000)],
    height_m: tuple[Number, Number], density: ScalarField | None = None, leaves: Material = "foliage:#4a7a32",
) -> None:  # fmt: skip
    """Grow round-crowned trees where there is room, as one structure: background that nothing refers to."""
    rng = site.rng_for("broadleaves", round(area.area, 2))
    stems: list[Mesh] = []
    crowns: list[Mesh] = []
    plans: list[BaseGeometry] = []
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density(site) if density else None, 3 * limit):
        high = float(rng.uniform(*height_m))
        if len(stems) >= limit or not site.is_free(x, y, 0.18 * high):
            continue
        z, reach = site.ground_z(x, y), 0.3 * high
        stem = cylinder(radius=0.035 * high, radius_top=0.02 * high, height=0.62 * high + 0.4, segments=7)
        stems.append(translated(stem, (x, y, z - 0.4)))
        for k, (out, share, up) in enumerate(((0.0, 1.0, 0.72), (0.75, 0.7, 0.6), (0.75, 0.6, 0.66))):
            turn = np.radians(yaw + 170.0 * k)
            at = (x + out * reach * float(np.cos(turn)), y + out * reach * float(np.sin(turn)), z + up * high)
            size = [share * reach, share * reach, share * reach * 0.8]
            body = crown(radii=size, noise=0.25, subdivisions=1, seed=int(rng.integers(1, 40)))
            crowns.append(translated(body, at))
        plans.append(shapely.Point(x, y).buffer(0.5, quad_segs=2))
    if stems:
        parts = [("bark", merge(stems)), (leaves, merge(crowns))]
        site.add(None, "broadleaf_trees", parts, footprint=shapely.union_all(plans))
