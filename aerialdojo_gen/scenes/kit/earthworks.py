"""Earthworks: pits with benches and ramps, tipped heaps, ruts, each on the grid of the terrain before."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString

from aerialdojo_gen.scenes.kit import ground_builder
from aerialdojo_gen.scenes.kit.landforms import grid
from aerialdojo_gen.scenes.plans.values import Area, Number, Point3
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain

_Steps = Annotated[list[tuple[Number, Number]], Field(min_length=2, max_length=100)]


@ground_builder
def level_grid(site: Site, _terrain: Terrain, *, cell_m: Annotated[Number, Field(ge=0.5)]) -> Terrain:
    """Make level ground at z = 0 that is fine enough to be dug in, in place of what was there."""
    size_m = site.head.size_m
    columns, rows = (int(np.ceil(s / cell_m - 1e-9)) for s in size_m)
    cell = max(size_m[0] / columns, size_m[1] / rows)
    return Terrain(-size_m[0] / 2, -size_m[1] / 2, cell, np.zeros((rows + 1, columns + 1)))


@ground_builder
def ground_profile(_site: Site, terrain: Terrain, *, points: _Steps, axis: Literal["x", "y"] = "x") -> Terrain:
    """Raise the ground by a profile along an axis: (distance along it, height), linear in between."""
    along, heights = np.array(points, dtype=np.float64).T
    return terrain.raised(np.interp(grid(terrain)["xy".index(axis)], along, heights))


@ground_builder
def terraces(_site: Site, terrain: Terrain, *, area: Area, steps: _Steps) -> Terrain:
    """Raise or sink an area by how far inside its outline: (inside, height), linear in between; a pit or a heap."""
    d, h = np.array(steps, dtype=np.float64).T
    return terrain.raised(np.interp(terrain.inside(area), d, h))


@ground_builder
def earth_ramp(
    _site: Site, terrain: Terrain, *, start: Point3, end: Point3, width_m: Number,
    blend_m: Annotated[Number, Field(gt=0)] = 2.0,
) -> Terrain:  # fmt: skip
    """Lay a straight ramp into the ground from one point to another, with slopes beside it."""
    line = LineString([start[:2], end[:2]])
    away = terrain.distance(line.buffer(width_m / 2, cap_style="flat"))
    t = line.project(shapely.points(terrain.corners()[:, :2])).reshape(away.shape) / line.length
    return terrain.blended(start[2] + (end[2] - start[2]) * t, np.clip(1.0 - away / blend_m, 0.0, 1.0))


@ground_builder
def rough_area(site: Site, terrain: Terrain, *, area: Area, height_m: Number, stream: str = "ruts") -> Terrain:
    """Make an area uneven by up to `height_m`, as tracked machines leave it."""
    xy = terrain.corners()[:, :2]
    inside = shapely.contains_xy(area, *xy.T).reshape(terrain.heights_m.shape)
    bumps = site.rng_for(stream).uniform(-1.0, 1.0, size=terrain.heights_m.shape) * height_m
    return terrain.raised(np.where(inside, bumps, 0.0))
