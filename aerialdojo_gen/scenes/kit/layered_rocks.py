"""Dry country: dunes shaped by the wind, valleys between stepped banks, layered rock that stands on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import norm, power
from aerialdojo_gen.scenes.grammar import slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.mesh import Floats, Mesh, Parts
from aerialdojo_gen.scenes.plans.values import Area, Line, Material, Number
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
