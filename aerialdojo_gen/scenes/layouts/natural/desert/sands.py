"""Ground of dry country: dunes shaped by the wind, dry river beds between stepped banks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.mesh import Floats
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain

# Share of a dune's length that is its long windward slope; the slip face takes the rest.
_WINDWARD = 0.7


def dunes(
    size_m: tuple[float, float], cell_m: float, seed: int, height_m: float, wavelength_m: float, wind_deg: float
) -> Terrain:
    """Make a sand sea: wavy crests across the wind, gentle windward slopes and steep slip faces.

    Parameters
    ----------
    size_m, cell_m, seed
        As in `rolling_terrain`.
    height_m, wavelength_m : float
        Of the highest dunes, and from crest to crest, metres.
    wind_deg : float
        Where the wind blows to, degrees counter-clockwise from +x.
    """
    ground = rolling_terrain(size_m, cell_m, seed, 0.25 * height_m, 2.6 * wavelength_m, octaves=2)
    x, y = ground.corners()[:, :2].T
    c, s = np.cos(np.radians(wind_deg)), np.sin(np.radians(wind_deg))
    along, across = c * x + s * y, -s * x + c * y
    bend = _noise(seed + 1, along / (2.2 * wavelength_m), across / (1.3 * wavelength_m))
    swell = _noise(seed + 2, along / (1.1 * wavelength_m), across / (0.9 * wavelength_m))
    phase = along / wavelength_m + 0.55 * bend
    s01 = phase - np.floor(phase)
    rise = np.clip(s01 / _WINDWARD, 0.0, 1.0) ** 1.25
    fall = np.clip((s01 - _WINDWARD) / (1.0 - _WINDWARD), 0.0, 1.0)
    ridge = rise * (1.0 - fall * fall * (3.0 - 2.0 * fall))
    shape = ground.heights_m.shape
    high = height_m * (0.75 + 0.4 * swell) * ridge
    return replace(ground, heights_m=ground.heights_m + high.reshape(shape))


def wash(
    size_m: tuple[float, float],
    cell_m: float,
    seed: int,
    bed: Sequence[tuple[float, float]],
    steps: Sequence[tuple[float, float, float]],
    roughness_m: float,
) -> Terrain:
    """Make a dry river bed: the ground climbs away from it in steps.

    Parameters
    ----------
    size_m, cell_m, seed
        As in `rolling_terrain`.
    bed : sequence of (x, y)
        Middle line of the bed, metres.
    steps : sequence of (from, to, rise)
        Between these distances from the middle line the ground rises by so much, metres.
    roughness_m : float
        Of the noise over it all, metres.
    """
    ground = rolling_terrain(size_m, cell_m, seed, roughness_m, 16.0, octaves=3)
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
