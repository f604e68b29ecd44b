"""Mountains and dry and cold country: massifs, crags, gorges, streams; layered rock, ridges of ice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import distances_along, norm, power
from aerialdojo_gen.scenes.grammar import slab
from aerialdojo_gen.scenes.ground import polygons_of, ribbon
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.kit.landforms import grid
from aerialdojo_gen.scenes.mesh import Floats, Mesh, Parts, rotated, rotation, translated
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import Area, At, Line, Material, Materials, Number, Positive, Spacing
from aerialdojo_gen.scenes.shapes import box, crown
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, level_terrain, rolling_terrain, smooth

_SMOOTH_MAX = 5.0


@dataclass(frozen=True)
class Ridge:
    """A crest of points (x, y, z), or a peak of one; its flanks reach so far, hollow above 1 and bulging below."""

    line: Annotated[list[tuple[Number, Number, Annotated[Number, Field(ge=0)]]], Field(min_length=1, max_length=1000)]
    width_m: Positive
    hollow: Annotated[Number, Field(ge=0.1, le=4)] = 1.3


@dataclass(frozen=True)
class Crag:
    """A crag that stands on the ground, of so many blocks."""

    at: At
    radius_m: Positive
    height_m: Positive
    blocks: Annotated[int, Field(ge=1, le=12)] = 5


@ground_builder
def massif(
    site: Site, _terrain: Terrain, *, ridges: list[Ridge], cell_m: Spacing = 1.6,
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
        benched = (np.floor(level) + smooth((part - 0.5) / 0.4)) * bench_m - 0.03 * corners[:, 0]
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
        area = Point(crag.at).buffer(crag.radius_m * 1.15, quad_segs=4)
        site.add(None, "crag", parts, footprint=area)


@dataclass(frozen=True)
class Stream:
    """A stream that winds northwards."""

    swing_m: Number = 3.2  # To either side
    bend_m: Positive = 11.0  # Northing a radian of its waves
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
    ys = np.arange(-half, half + 1.0, 2.5).tolist()
    edge = [half_m + 1.2 + 1.3 * float(np.sin(y * 0.9) + np.sin(y * 0.37 + 1.0)) for y in ys]
    west = [(-out, y) for out, y in zip(edge[::-1], ys, strict=True)]
    site.paint(Polygon([*west, *zip(edge[::-1], ys[::-1], strict=True)]), rock)
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
    slope_m: Positive, bed_m: Number = 0.6,
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


_CAP_M = 0.22


@dataclass(frozen=True)
class Rock:
    """A rock of layers."""

    area: Area  # At its foot
    name: str  # Of its random streams
    height_m: Annotated[Number, Field(gt=0, le=100)]
    batter: Annotated[Number, Field(ge=0, le=1)] = 0.14  # How far its walls lean back, metres a metre of height


@site_builder
def layered_rocks(site: Site, *, rocks: list[Rock], bands: Materials, cap: Material | None = None) -> list[float]:
    """Put up rocks in layers of alternating hardness, from the foot up; gives the heights of their tops, metres.

    A thin `cap`, such as snow, lies over each.
    """
    return [_layered_rock(site, rock, bands, cap) for rock in rocks]


def _layered_rock(site: Site, rock: Rock, bands: Sequence[str], cap: str | None) -> float:
    area = rock.area
    ring = [site.ground_z(float(x), float(y)) for x, y in shapely.get_coordinates(area)]
    low, top = min(ring) - 0.6, float(np.mean(ring)) + rock.height_m
    rng = site.rng_for("strata", rock.name)
    count = max(round((top - low) / 1.3), 2)
    cuts = np.linspace(low, top, count + 1)
    cuts[1:-1] += rng.uniform(-0.5, 0.5, size=count - 1)
    noise = OpenSimplex(seed=site.head.seed * 13 + _number(rock.name))
    parts: Parts = []
    for k in range(count):
        # Hard layers jut out over soft ones; the topmost is hard, and caps the rest: things stand on it.
        last = k == count - 1
        hard = 0.28 if (count - 1 - k) % 2 == 0 else -0.12
        inset = rock.batter * (float(cuts[k]) - low) - hard + float(rng.uniform(-1.0, 1.0)) * (0.1 if last else 0.3)
        gullies = 0.9 * (1.0 - k / (count - 1))
        outline = _weathered(area.buffer(-max(inset, -0.3)), noise, float(k) * 0.35, gullies)
        for p in polygons_of(outline.intersection(site.extent)):
            layer = slab(p, float(cuts[k]), float(cuts[k + 1]))
            parts.append((bands[k % len(bands)], _broken(layer, p, noise, level=last)))
    if cap is not None:
        parts += [(cap, slab(p, top, top + _CAP_M)) for p in polygons_of(outline.buffer(0.1))]
        top += _CAP_M
    site.add(None, "rock", parts, footprint=area.buffer(0.3))
    return top


def _weathered(area: BaseGeometry, noise: OpenSimplex, phase: float, gullies: float) -> BaseGeometry:
    """Notch an outline: every 1.5 m of it moves by up to half a metre, similarly in neighbouring layers.

    Gullies of a width of some metres, so deep, run down through all layers.
    """
    pieces = []
    for p in polygons_of(area):
        xy = shapely.get_coordinates(shapely.segmentize(orient(p).exterior, 1.5))[:-1]
        d = np.array([[noise.noise3(x / 2.2, y / 2.2, phase + off) for off in (0.0, 40.0)] for x, y in xy])
        wide = np.array([noise.noise3(x / 5.0, y / 5.0, 80.0 + 0.2 * phase) for x, y in xy])
        moved = Polygon(xy + 0.5 * d + (gullies * np.minimum(wide, 0.15))[:, None] * _outwards(xy))
        pieces += polygons_of(moved if moved.is_valid else moved.buffer(0))
    return shapely.union_all(pieces)


def _broken(layer: Mesh, plan: Polygon, noise: OpenSimplex, level: bool) -> Mesh:
    """Slope the walls of a layer unevenly, and let its upper edge rise and fall unless it is to be level."""
    n = len(layer.vertices) // 2
    v = layer.vertices.copy()
    high = v[n:]
    wide = np.array([noise.noise3(x / 3.1, y / 3.1, 7.0 + 0.9 * z) for x, y, z in high])
    if not plan.interiors:
        high[:, :2] -= ((0.12 if level else 0.3) * (1.0 + wide))[:, None] * _outwards(high[:, :2])
    if not level:
        high[:, 2] += 0.35 * wide
    # Its foot reaches down into the layer below, whose edge falls in places.
    v[:n, 2] -= 0.35
    return replace(layer, vertices=v)


def _outwards(ring: Floats) -> Floats:
    """Directions out of a counter-clockwise ring at its corners, (n, 2)."""
    along = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    return np.column_stack([along[:, 1], -along[:, 0]]) / np.maximum(norm(along), 1e-9)[:, None]


def _number(name: str) -> int:
    """Turn a name into a small number that is the same on every machine."""
    return sum((k + 1) * ord(c) for k, c in enumerate(name)) % 997


@site_builder
def ice_ridges(
    site: Site, *, lines: list[Line], height_m: Annotated[Number, Field(gt=0, le=20)], material: Material
) -> None:
    """Push broken slabs of ice or snow up into ridges along lines."""
    for number, points in enumerate(lines):
        line, rng = LineString(points), site.rng_for("ridge", number)
        parts: Parts = []
        for s in np.arange(0.4, line.length, 1.1):
            p = line.interpolate(float(s))
            h = height_m * float(rng.uniform(0.55, 1.0))
            z = site.ground_z(p.x, p.y)
            if rng.random() < 0.6:
                body = box(size=(float(rng.uniform(1.0, 1.8)), float(rng.uniform(0.4, 0.8)), h * 1.25))
                turn = rotation(float(rng.uniform(-24, 24)), float(rng.uniform(-18, 18)), float(rng.uniform(0, 180)))
                body = rotated(body, turn)
            else:
                body = crown(radii=(0.9, 0.8, h * 0.7), noise=0.35, subdivisions=1, seed=int(rng.integers(1000)))
            wander = rng.uniform(-0.35, 0.35, size=2)
            parts.append((material, translated(body, (p.x + wander[0], p.y + wander[1], z - 0.35))))
        site.add(None, "ice_ridge", parts, footprint=line.buffer(1.0))
