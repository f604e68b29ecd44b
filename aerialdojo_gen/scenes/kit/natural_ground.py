"""How natural ground looks and falls: organic outlines, slopes."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely.geometry import LinearRing, Polygon

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.arrays import Floats
from aerialdojo_gen.geometry.portable import unit
from aerialdojo_gen.scenes.site import Site


def downhill_deg(site: Site, x: float, y: float) -> float:
    """Give the direction in which the ground falls, degrees counter-clockwise from +x."""
    east = site.ground_z(x + 1.5, y) - site.ground_z(x - 1.5, y)
    north = site.ground_z(x, y + 1.5) - site.ground_z(x, y - 1.5)
    return math.degrees(math.atan2(-north, -east))


def noise_around(seed: int, angles: Floats, bends: float) -> Floats:
    """Noise from -1 to 1 at angles (n,), radians, that closes around a circle: the more bends, the rougher."""
    noise = OpenSimplex(seed=seed)
    return np.array([noise.noise2(bends * float(np.cos(a)), bends * float(np.sin(a))) for a in angles])


def blob(x: float, y: float, radius_m: float, seed: int, ragged: float = 0.25, corners: int = 28) -> Polygon:
    """Make a round area with a wavy outline (a clearing, a pond, a patch of moss), metres, world frame."""
    angles = np.arange(corners) * 2 * np.pi / corners
    r = radius_m * (1.0 + ragged * noise_around(seed, angles, 1.3) / 0.6)
    return Polygon(np.column_stack([x + r * np.cos(angles), y + r * np.sin(angles)]))


def ragged_outline(ring: LinearRing, seed: int, amplitude_m: float, step_m: float) -> Polygon:
    """Make a natural outline from a coarse one: resampled every `step_m` and pushed in and out by noise, metres."""
    count = int(ring.length / step_m)
    at = shapely.get_coordinates([ring.interpolate(k / count, normalized=True) for k in range(count)])
    before, after = np.roll(at, 1, axis=0), np.roll(at, -1, axis=0)
    along = unit(after - before)
    wave = noise_around(seed, np.arange(count) / count * 2 * np.pi, ring.length / (2 * np.pi * 14.0))
    out = at + amplitude_m * 1.5 * wave[:, None] * np.column_stack([along[:, 1], -along[:, 0]])
    outline = Polygon(out).buffer(0)
    smooth = outline.buffer(1.5, quad_segs=3).buffer(-3.0, quad_segs=3).buffer(1.5, quad_segs=3)
    return smooth if isinstance(smooth, Polygon) else max(smooth.geoms, key=lambda g: g.area)
