"""Mountain ground: ridges and peaks that fall away in benches, faces of rock where it is steep, and crags."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.geometry.portable import distances_along, power
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.mesh import Floats, Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.shapes import crown
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, flat_terrain, rolling_terrain

_SMOOTH_MAX = 5.0


@dataclass(frozen=True)
class Ridge:
    """A crest of points (x, y, z), or a peak of one; its flanks reach so far, hollow above 1 and bulging below."""

    line: Annotated[list[tuple[Number, Number, Annotated[Number, Field(ge=0)]]], Field(min_length=1, max_length=1000)]
    width_m: Annotated[Number, Field(gt=0)]
    hollow: Annotated[Number, Field(ge=0.1, le=4)] = 1.3


@dataclass(frozen=True)
class Crag:
    """A crag that stands on the ground, of so many blocks."""

    at: At
    radius_m: Annotated[Number, Field(gt=0)]
    height_m: Annotated[Number, Field(gt=0)]
    blocks: Annotated[int, Field(ge=1, le=12)] = 5


@ground_builder
def massif(
    site: Site, _terrain: Terrain, *, ridges: list[Ridge], cell_m: Annotated[Number, Field(ge=0.5)] = 1.6,
    bench_m: Annotated[Number, Field(ge=0)] = 4.5, rough_m: Number = 2.0,
) -> Terrain:  # fmt: skip
    """Make mountains in place of what was there; where ridges overlap, the higher shows, with a soft valley between.

    The flanks fall in steps of `bench_m`, if any; gullies and spurs on the steepest ground are `rough_m` high.
    """
    size_m, seed = site.head.size_m, site.head.seed
    columns, rows = (int(np.ceil(s / cell_m - 1e-9)) for s in size_m)
    cell = max(size_m[0] / columns, size_m[1] / rows)
    ground = replace(flat_terrain(size_m), cell_m=cell, heights_m=np.zeros((rows + 1, columns + 1)))
    corners = ground.corners()
    places = shapely.points(corners[:, :2])
    total = np.zeros(len(corners))
    for ridge in ridges:
        line = np.array(ridge.line)
        if len(line) == 1:
            away = np.hypot(*(corners[:, :2] - line[0, :2]).T)
            crest = np.full(len(corners), line[0, 2])
        else:
            path = LineString(line[:, :2])
            stations = distances_along(line[:, :2])
            crest = np.interp(shapely.line_locate_point(path, places), stations, line[:, 2])
            away = shapely.distance(path, places)
        total += power(crest * power(np.clip(1.0 - away / ridge.width_m, 0.0, 1.0), ridge.hollow), _SMOOTH_MAX)
    height = power(total, 1.0 / _SMOOTH_MAX)
    share = height / max(float(height.max()), 1e-9)
    folds = rolling_terrain(size_m, cell_m, seed, rough_m, 26.0, octaves=3, ridged=True).heights_m.ravel()
    height = height + folds * np.clip(share * 1.6, 0.12, 1.0)
    if bench_m > 0.0:
        # Benches follow the contour but not quite: strata dip.
        level = (height + 0.03 * corners[:, 0]) / bench_m
        part = level - np.floor(level)
        riser = np.clip((part - 0.5) / 0.4, 0.0, 1.0)
        benched = (np.floor(level) + riser * riser * (3.0 - 2.0 * riser)) * bench_m - 0.03 * corners[:, 0]
        height = 0.3 * height + 0.7 * benched
    return replace(ground, heights_m=height.reshape(ground.heights_m.shape))


def _cells_where(terrain: Terrain, chosen: np.ndarray) -> BaseGeometry:
    """Join the cells about chosen corners into areas with round outlines; single corners are left out."""
    points = terrain.corners()[chosen.ravel(), :2]
    if not len(points):
        return Point(0, 0).buffer(0.0)
    half = terrain.cell_m * 0.62
    area = shapely.union_all(shapely.box(*(points - half).T, *(points + half).T))
    return area.buffer(-0.8, quad_segs=2).buffer(1.3, quad_segs=2).simplify(0.25)


@site_builder
def steep_ground(site: Site, *, slope: Number) -> BaseGeometry:
    """Give the ground that rises more than `slope` metres a metre, to be named by `as`."""
    dy, dx = np.gradient(site.terrain.heights_m, site.terrain.cell_m)
    return _cells_where(site.terrain, np.hypot(dx, dy) > slope)


@site_builder
def high_ground(site: Site, *, above_m: Number, slope: Number) -> BaseGeometry:
    """Give the ground above a height that is gentle enough for snow to lie, to be named by `as`."""
    dy, dx = np.gradient(site.terrain.heights_m, site.terrain.cell_m)
    return _cells_where(site.terrain, (site.terrain.heights_m > above_m) & (np.hypot(dx, dy) < slope))


@site_builder
def crags(site: Site, *, crags: list[Crag], materials: tuple[Material, Material]) -> None:
    """Pile crags of angular blocks, the tallest in the middle of each; they take their ground."""
    for number, crag in enumerate(crags):
        rng = site.rng_for("crag", number)
        parts: list[tuple[str, Mesh]] = []
        for k in range(crag.blocks):
            angle = float(rng.uniform(0, 2 * np.pi))
            out = 0.0 if k == 0 else crag.radius_m * float(rng.uniform(0.45, 0.7))
            x, y = crag.at[0] + out * float(np.cos(angle)), crag.at[1] + out * float(np.sin(angle))
            tall = crag.height_m * (1.0 if k == 0 else float(rng.uniform(0.35, 0.75)))
            wide = crag.radius_m * (0.62 if k == 0 else float(rng.uniform(0.35, 0.5)))
            # A crown reaches as far below its middle as above: half of it stays in the ground.
            body = crown(radii=(wide, wide * 0.8, tall), noise=0.34, subdivisions=2, seed=int(rng.integers(1 << 20)))
            tilt = (float(rng.uniform(-8, 8)), float(rng.uniform(-8, 8)), float(rng.uniform(0, 360)))
            body = _faceted(rotated(body, rotation(*tilt)))
            parts.append((materials[k % 2], translated(body, (x, y, site.ground_z(x, y) - 0.15 * tall))))
        by_material = {m: merge([b for n, b in parts if n == m]) for m in dict.fromkeys(m for m, _ in parts)}
        area = Point(crag.at).buffer(crag.radius_m * 1.15, quad_segs=4)
        site.add(None, "crag", list(by_material.items()), footprint=area)


def _faceted(body: Mesh) -> Mesh:
    """Cut the lower half away where it would lie deep in the ground, so that no triangle is wasted."""
    low = float(body.vertices[:, 2].min()) * 0.45
    v: Floats = body.vertices.copy()
    v[:, 2] = np.maximum(v[:, 2], low)
    return Mesh(v, body.faces)
