"""Dry and cold country: dunes, stepped valleys, layered rock; banks of snow, moguls, ice, a rink, cableways."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import exp, norm, power, unit
from aerialdojo_gen.scenes.grammar import Frame, slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.mesh import Floats, Mesh, Parts, rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, Line, Material, Number
from aerialdojo_gen.scenes.shapes import box, crown, cylinder, sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain

# Share of a dune's length that is its long windward slope; the slip face takes the rest.
_WINDWARD = 0.7


_Cell = Annotated[Number, Field(ge=0.5)]


@ground_builder
def dunes(
    site: Site, _terrain: Terrain, *, cell_m: _Cell, height_m: Number, wavelength_m: Annotated[Number, Field(ge=1)],
    wind_deg: Number,
) -> Terrain:  # fmt: skip
    """Make a sand sea: wavy crests across the wind, gentle windward slopes and steep slip faces."""
    seed = site.head.seed
    ground = rolling_terrain(site.head.size_m, cell_m, seed, 0.25 * height_m, 2.6 * wavelength_m, octaves=2)
    x, y = ground.corners()[:, :2].T
    c, s = np.cos(np.radians(wind_deg)), np.sin(np.radians(wind_deg))
    along, across = c * x + s * y, -s * x + c * y
    bend = _noise_at(seed + 1, along / (2.2 * wavelength_m), across / (1.3 * wavelength_m))
    swell = _noise_at(seed + 2, along / (1.1 * wavelength_m), across / (0.9 * wavelength_m))
    phase = along / wavelength_m + 0.55 * bend
    s01 = phase - np.floor(phase)
    rise = power(np.clip(s01 / _WINDWARD, 0.0, 1.0), 1.25)
    fall = np.clip((s01 - _WINDWARD) / (1.0 - _WINDWARD), 0.0, 1.0)
    ridge = rise * (1.0 - fall * fall * (3.0 - 2.0 * fall))
    high = height_m * (0.75 + 0.4 * swell) * ridge
    return ground.raised(high)


@ground_builder
def stepped_valley(
    site: Site, _terrain: Terrain, *, cell_m: _Cell, bed: Line, steps: list[tuple[Number, Number, Number]],
    roughness_m: Number,
) -> Terrain:  # fmt: skip
    """Make a valley along the middle line of its bed, from which the ground climbs in steps (from, to, rise)."""
    if any(far - near < 0.05 for near, far, _ in steps):
        raise AssetError("steps: a step ends 0.05 m or more beyond where it begins")
    seed = site.head.seed
    ground = rolling_terrain(site.head.size_m, cell_m, seed, roughness_m, 16.0, octaves=3)
    xy = ground.corners()[:, :2]
    d = shapely.distance(shapely.LineString(bed), shapely.points(xy))
    d = d + 2.2 * _noise_at(seed + 5, xy[:, 0] / 9.0, xy[:, 1] / 9.0)
    rise = np.zeros(len(d))
    for near, far, height in steps:
        t = np.clip((d - near) / (far - near), 0.0, 1.0)
        rise += height * t * t * (3.0 - 2.0 * t)
    calm = np.clip(d / 6.0, 0.25, 1.0)
    shape = ground.heights_m.shape
    return replace(ground, heights_m=ground.heights_m * calm.reshape(shape) + rise.reshape(shape))


def _noise_at(seed: int, x: Floats, y: Floats) -> Floats:
    field = OpenSimplex(seed=seed)
    return np.array([field.noise2(float(a), float(b)) for a, b in zip(x, y, strict=True)])


_CAP_M = 0.22


@dataclass(frozen=True)
class Rock:
    """A rock of layers."""

    area: Area  # At its foot
    name: str  # Of its random streams
    height_m: Annotated[Number, Field(gt=0, le=100)]
    batter: Annotated[Number, Field(ge=0, le=1)] = 0.14  # How far its walls lean back, metres a metre of height


@site_builder
def layered_rocks(
    site: Site, *, rocks: list[Rock], bands: Annotated[list[Material], Field(min_length=1)],
    cap: Material | None = None,
) -> list[float]:  # fmt: skip
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
        d = np.array(
            [[noise.noise3(x / 2.2, y / 2.2, phase), noise.noise3(x / 2.2, y / 2.2, phase + 40.0)] for x, y in xy]
        )
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


@ground_builder
def profile_slope(
    _site: Site, terrain: Terrain, *, profile: Annotated[list[tuple[Number, Number]], Field(min_length=2)],
    lean: Number = 0.0, smooth_m: Annotated[Number, Field(gt=0)] = 4.0,
) -> Terrain:  # fmt: skip
    """Raise the ground by a profile from south to north, (y, z), and by `lean` metres a metre eastwards."""
    from scipy.ndimage import gaussian_filter1d

    corners = terrain.corners()
    y = np.linspace(corners[:, 1].min(), corners[:, 1].max(), 600)
    z = np.interp(y, [p[0] for p in profile], [p[1] for p in profile])
    z = gaussian_filter1d(z, smooth_m / float(y[1] - y[0]), mode="nearest")
    rise = np.interp(corners[:, 1], y, z) + lean * corners[:, 0]
    return terrain.raised(rise)


@ground_builder
def banks_beside(_site: Site, terrain: Terrain, *, line: Line, width_m: Number, height_m: Number) -> Terrain:
    """Pile snow along both sides of a way, where ploughs and groomers leave it."""
    d = terrain.distance(LineString(line))
    bump = exp(-(((d - width_m / 2 - 1.4) / 1.1) ** 2))
    return terrain.raised(height_m * bump)


@ground_builder
def moguls(
    _site: Site, terrain: Terrain, *, area: Area, height_m: Number, pitch_m: Annotated[Number, Field(ge=0.5)] = 4.4
) -> Terrain:
    """Cover an area with the bumps that turning skis leave."""
    x, y = terrain.corners()[:, :2].T
    fade = np.clip(terrain.inside(area).ravel() / 2.0, 0.0, 1.0)
    k = 2 * np.pi / pitch_m
    bump = 0.5 + 0.5 * np.sin(k * x + 0.8 * np.sin(k * y / 2)) * np.sin(k * y)
    return terrain.raised(height_m * fade * bump)


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


@site_builder
def rink_boards(site: Site, *, rink: Area, boards: Material = "#eef2f6", cap: Material = "#2f5f9e") -> None:
    """Put boards round a level rink, with a gap to step in by."""
    if not isinstance(rink, Polygon):
        raise AssetError("rink: must be an area in one piece")
    z = site.ground_z(rink.centroid.x, rink.centroid.y)
    ring = shapely.get_coordinates(shapely.segmentize(rink.exterior, 3.0))
    gate = len(ring) // 8
    path = [(float(x), float(y), z + 0.45) for x, y in (*ring[gate + 1 :], *ring[1:gate])]
    top = [(x, y, z + 0.96) for x, y, _ in path]
    parts: Parts = [(boards, sweep(path=path, section=(0.12, 1.0))), (cap, sweep(path=top, section=(0.16, 0.08)))]
    site.add(None, "rink_boards", parts, footprint=rink.boundary.buffer(0.25))


# The sag of a rope, as a share of its length.
_SAG = 0.045


@site_builder
def cableway(
    site: Site, *, masts: Line, cabins: Annotated[int, Field(ge=0, le=1000)] = 8, mast_m: Number = 11.6,
    terminal_m: Number = 5.6, gauge_m: Annotated[Number, Field(gt=0)] = 6.4,
    paints: Annotated[list[Material], Field(min_length=1)] = ["#d8342c", "#2f5f9e", "#e9b52a", "#3f7d4e"],  # noqa: B006
) -> None:  # fmt: skip
    """Hang two ropes with cabins between the heads of masts; the first and the last are terminals with a wheel."""
    last = len(masts) - 1
    heads = [
        (x, y, site.ground_z(x, y) + (terminal_m if k in (0, last) else mast_m)) for k, (x, y) in enumerate(masts)
    ]
    parts: Parts = []
    hung = 0
    for a, b in pairwise(np.array(heads)):
        along = unit((b - a)[:2])
        side = np.array([-along[1], along[0], 0.0]) * gauge_m / 2
        length = float(norm((b - a)[:2]))
        t = np.linspace(0.0, 1.0, 9)
        sag = -_SAG * length * 4 * t * (1 - t)
        for way in (-1.0, 1.0):
            line = a + (b - a) * t[:, None] + side * way + np.column_stack([0 * t, 0 * t, sag])
            parts.append(("iron", sweep(path=[tuple(map(float, p)) for p in line], radius=0.045, sides=4)))
            count = max(int(length // 16), 1) if hung < cabins else 0
            for k in range(count):
                s = (k + 0.5 + 0.22 * way) / count
                p = a + (b - a) * s + side * way
                z = float(p[2] - _SAG * length * 4 * s * (1 - s))
                yaw_deg = math.degrees(math.atan2(along[1], along[0]))
                parts += _cabin(Frame(float(p[0]), float(p[1]), yaw_deg), z, paints[hung % len(paints)])
                hung += 1
    for x, y, z in (heads[0], heads[-1]):
        foot = site.ground_z(x, y)
        wheel = cylinder(radius=gauge_m / 2, height=0.3, segments=20)
        parts.append(("#3f7d4e", translated(wheel, (x, y, z - 0.15))))
        shaft = cylinder(radius=0.4, height=z - foot + 0.6, segments=10)
        parts.append(("steel", translated(shaft, (x, y, foot - 0.5))))
        parts.append(("concrete", translated(box(size=(2.2, 2.2, 0.5)), (x, y, foot - 0.3))))
    site.add(None, "lift_ropes", parts)


def _cabin(frame: Frame, z: float, paint: str) -> Parts:
    body: Parts = [
        (paint, translated(box(size=(1.5, 1.3, 0.75), taper=(1.1, 1.1)), (0, 0, -3.1))),
        ("glass", translated(box(size=(1.6, 1.4, 0.75), taper=(0.94, 0.92)), (0, 0, -2.35))),
        (paint, translated(box(size=(1.55, 1.35, 0.18), taper=(0.8, 0.8)), (0, 0, -1.6))),
        ("steel", translated(cylinder(radius=0.05, height=1.45, segments=6), (0, 0, -1.42))),
    ]
    return frame.parts(body, z)
