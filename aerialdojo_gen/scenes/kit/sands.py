"""Ground of dry country: dunes shaped by the wind, valleys between stepped banks."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import power
from aerialdojo_gen.scenes.kit import ground_builder
from aerialdojo_gen.scenes.mesh import Floats
from aerialdojo_gen.scenes.plans.values import Line, Number
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
    bend = _noise(seed + 1, along / (2.2 * wavelength_m), across / (1.3 * wavelength_m))
    swell = _noise(seed + 2, along / (1.1 * wavelength_m), across / (0.9 * wavelength_m))
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
    d = d + 2.2 * _noise(seed + 5, xy[:, 0] / 9.0, xy[:, 1] / 9.0)
    rise = np.zeros(len(d))
    for near, far, height in steps:
        t = np.clip((d - near) / (far - near), 0.0, 1.0)
        rise += height * t * t * (3.0 - 2.0 * t)
    calm = np.clip(d / 6.0, 0.25, 1.0)
    shape = ground.heights_m.shape
    return replace(ground, heights_m=ground.heights_m * calm.reshape(shape) + rise.reshape(shape))


def _noise(seed: int, x: Floats, y: Floats) -> Floats:
    field = OpenSimplex(seed=seed)
    return np.array([field.noise2(float(a), float(b)) for a, b in zip(x, y, strict=True)])
