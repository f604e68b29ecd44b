"""Earthworks: pits with benches and ramps, tipped heaps, on the grid of a terrain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.terrain import Terrain


def grid_terrain(size_m: tuple[float, float], cell_m: float) -> Terrain:
    """Make level ground at z = 0 that is fine enough to be dug in, about the origin."""
    columns, rows = (int(np.ceil(s / cell_m - 1e-9)) for s in size_m)
    cell = max(size_m[0] / columns, size_m[1] / rows)
    return Terrain(-size_m[0] / 2, -size_m[1] / 2, cell, np.zeros((rows + 1, columns + 1)))


def shaped(terrain: Terrain, area: BaseGeometry, steps: Sequence[tuple[float, float]]) -> Terrain:
    """Add a profile to an area's ground: a pit, a heap, or terraces.

    Parameters
    ----------
    terrain : Terrain
        Old ground.
    area : shapely geometry
        Outline, world frame, metres.
    steps : sequence of (inside, height)
        Change of height over the distance inside the outline, both in metres, linear in between.
    """
    xy = terrain.corners()[:, :2]
    inside = np.where(shapely.contains_xy(area, *xy.T), shapely.distance(area.boundary, shapely.points(xy)), 0.0)
    d, h = np.array(steps, dtype=np.float64).T
    return replace(terrain, heights_m=terrain.heights_m + np.interp(inside, d, h).reshape(terrain.heights_m.shape))


def ramped(
    terrain: Terrain,
    a: tuple[float, float, float],
    b: tuple[float, float, float],
    width_m: float,
    blend_m: float = 2.0,
) -> Terrain:
    """Lay a straight ramp into the ground from `a` to `b` (x, y, z), with slopes of `blend_m` beside it, metres."""
    line = LineString([a[:2], b[:2]])
    points = shapely.points(terrain.corners()[:, :2])
    shape = terrain.heights_m.shape
    t = (line.project(points) / line.length).reshape(shape)
    away = np.asarray(shapely.distance(line.buffer(width_m / 2, cap_style="flat"), points)).reshape(shape)
    share = np.clip(1.0 - away / blend_m, 0.0, 1.0)
    ramp = a[2] + (b[2] - a[2]) * t
    return replace(terrain, heights_m=terrain.heights_m * (1.0 - share) + ramp * share)


def roughened(terrain: Terrain, area: BaseGeometry, height_m: float, rng: np.random.Generator) -> Terrain:
    """Make an area's ground uneven by up to `height_m`, as tracked machines leave it."""
    xy = terrain.corners()[:, :2]
    inside = shapely.contains_xy(area, *xy.T).reshape(terrain.heights_m.shape)
    bumps = rng.uniform(-1.0, 1.0, size=terrain.heights_m.shape) * height_m
    return replace(terrain, heights_m=terrain.heights_m + np.where(inside, bumps, 0.0))
