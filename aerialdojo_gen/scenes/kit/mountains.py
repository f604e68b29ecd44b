"""Mountain ground: ridges, faces of rock, crags; gorges and valleys along y, with the stream at their bottom."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import distances_along, power
from aerialdojo_gen.scenes.ground import ribbon
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.kit.landforms import grid
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.shapes import crown
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, level_terrain, rolling_terrain, smooth

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
    ground = level_terrain(size_m, cell_m)
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
            body = rotated(body, rotation(*tilt))
            # The lower half is cut away where it would lie deep in the ground, so that no triangle is wasted.
            body = Mesh(np.maximum(body.vertices, (-np.inf, -np.inf, body.vertices[:, 2].min() * 0.45)), body.faces)
            parts.append((materials[k % 2], translated(body, (x, y, site.ground_z(x, y) - 0.15 * tall))))
        by_material = {m: merge([b for n, b in parts if n == m]) for m in dict.fromkeys(m for m, _ in parts)}
        area = Point(crag.at).buffer(crag.radius_m * 1.15, quad_segs=4)
        site.add(None, "crag", list(by_material.items()), footprint=area)


@dataclass(frozen=True)
class Stream:
    """A stream that winds northwards."""

    swing_m: Number = 3.2  # To either side
    bend_m: Annotated[Number, Field(gt=0)] = 11.0  # Northing a radian of its waves
    x_m: Number = 0.0  # What it winds about

    def x(self, y: float) -> float:
        """Where it runs, metres east, at a northing in metres."""
        return self.x_m + self.swing_m * float(np.sin(y / self.bend_m))


_STREAM = Stream()


@ground_builder
def gorge(
    site: Site, terrain: Terrain, *, depth_m: Number, half_m: Number, ledge_m: Number, stream: Stream = _STREAM
) -> Terrain:
    """Cut a gorge with a ledge in both its faces, which are straight about y = 0, where a bridge may stand."""
    t, (x, y), seed = terrain, grid(terrain), site.head.seed
    rough = OpenSimplex(seed=seed + 5).noise2array(x[0] / 7.0, y[:, 0] / 7.0)
    ledge = OpenSimplex(seed=seed + 6).noise2array(x[0] / 15.0, y[:, 0] / 12.0)
    beyond = np.clip((np.abs(y) - 5.0) / 6.0, 0.0, 1.0)
    middle = stream.x_m + stream.swing_m * np.sin(y / stream.bend_m)
    away = np.abs(x - middle * beyond) + beyond * (1.6 * rough + 2.2 * ledge)
    drop = 0.56 * smooth((half_m - away) / 4.6) + 0.44 * smooth((ledge_m - away) / 5.5)
    bed = 0.7 * smooth((4.0 - np.abs(x - middle)) / 1.6)
    scree = beyond * np.clip(drop, 0.0, 1.0) * (1.0 - drop) * 3.0 * rough
    floor = 0.5 * rough * beyond * smooth((np.abs(x - middle) - 5.0) / 3.0)
    return replace(t, heights_m=t.heights_m * (1.0 - drop) - (depth_m - floor) * drop - bed + scree)


@site_builder
def paint_gorge(
    site: Site, *, half_m: Number, rock: Material, bank: Material, water: Material, stream: Stream = _STREAM
) -> None:
    """Paint the rock of a gorge up to a wavy rim, gravel banks, and the stream, whose bed stays free."""
    half = site.head.size_m[1] / 2
    ys = [float(y) for y in np.arange(-half, half + 1.0, 2.5)]
    edge = [half_m + 1.2 + 1.3 * float(np.sin(y * 0.9) + np.sin(y * 0.37 + 1.0)) for y in ys]
    rims = [
        [(s * (e if s > 0 else edge[-1 - k]), y) for k, (e, y) in enumerate(zip(edge, ys, strict=True))]
        for s in (-1, 1)
    ]
    site.paint(Polygon([*rims[0], *rims[1][::-1]]), rock)
    line = [(stream.x(y), y) for y in ys]
    site.paint(ribbon(line, 15.0), bank)
    site.paint(ribbon(line, 5.4), water)
    site.occupy(LineString([(stream.x(float(y)), float(y)) for y in np.arange(-half, half + 1.0, 3.0)]).buffer(3.2))


@site_builder
def by_stream(
    site: Site, *, things: list[tuple[str, Number, Number, Number]], phrase: str, on: Number | None = None,
    stream: Stream = _STREAM,
) -> None:  # fmt: skip
    """Place things by how far east of a winding stream they are, y, and yaw; on its banks, or at a height."""
    for category, dx, y, yaw in things:
        x = stream.x(y) + dx
        margin_m = 1.6 if on is None else 0.0
        site.place(Placement(category, x, y, yaw, z=on, place=phrase, settle_m=0.5, margin_m=margin_m))


@ground_builder
def valley(
    _site: Site, terrain: Terrain, *, depth_m: Number, half_m: Number, stream: Stream,
    slope_m: Annotated[Number, Field(gt=0)], bed_m: Number = 0.6,
) -> Terrain:  # fmt: skip
    """Cut a valley with soft slopes along a stream, whose bed lies a little lower."""
    x, y = grid(terrain)
    away = np.abs(x - (stream.x_m + stream.swing_m * np.sin(y / stream.bend_m)))
    deep = smooth((half_m - away) / slope_m)
    bed = smooth((4.4 - away) / 2.0) * bed_m
    return replace(terrain, heights_m=terrain.heights_m * (1.0 - deep) - depth_m * deep - bed)


@site_builder
def paint_brook(
    site: Site, *, stream: Stream, bank: Material, water: Material, path: Material, path_offset_m: Number,
    width_m: Number = 4.6, free_z: tuple[Number, Number] = (-100.0, 1000.0),
) -> None:  # fmt: skip
    """Paint a brook with gravel banks and a path beside it; nothing grows in it between two heights."""
    half = site.head.size_m[1] / 2
    line = [(stream.x(float(y)), float(y)) for y in (*np.arange(-half, half, 3.0), half)]
    site.paint(ribbon(line, width_m + 2.0), bank)
    site.paint(ribbon(line, width_m), water)
    site.paint(ribbon([(x + path_offset_m, y) for x, y in line], 1.6), path)
    site.occupy(LineString(line).buffer(width_m / 2 + 1.1), *free_z)
