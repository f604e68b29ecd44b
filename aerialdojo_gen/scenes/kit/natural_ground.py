"""How things sit on natural ground: organic outlines, slopes, and room about things."""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely.geometry import LinearRing, Polygon

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import unit
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.site import Site

_BELOW_M = 100.0


def keep_clear(site: Site, instance: Instance, margin_m: float) -> None:
    """Take the ground within `margin_m` of an instance's plan, over all heights up to 8 m above its top."""
    (x0, y0, _), (x1, y1, z1) = instance.bounds
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    site.occupy(Polygon(corners).buffer(margin_m, quad_segs=2), -_BELOW_M, float(z1) + 8.0)


def settled_z(site: Site, x: float, y: float, radius_m: float = 0.5) -> float:
    """Give the height at which a prop of that radius neither floats nor is buried on a slope, metres."""
    angles = np.arange(6) * np.pi / 3
    ring = [site.ground_z(x + radius_m * float(np.cos(a)), y + radius_m * float(np.sin(a))) for a in angles]
    return (site.ground_z(x, y) + min(ring)) / 2.0


def downhill_deg(site: Site, x: float, y: float, reach_m: float = 1.5) -> float:
    """Give the direction in which the ground falls, degrees counter-clockwise from +x."""
    east = site.ground_z(x + reach_m, y) - site.ground_z(x - reach_m, y)
    north = site.ground_z(x, y + reach_m) - site.ground_z(x, y - reach_m)
    return math.degrees(math.atan2(-north, -east))


def blob(x: float, y: float, radius_m: float, seed: int, ragged: float = 0.25, corners: int = 28) -> Polygon:
    """Make a round area with a wavy outline (a clearing, a pond, a patch of moss), metres, world frame."""
    noise = OpenSimplex(seed=seed)
    angles = np.arange(corners) * 2 * np.pi / corners
    wave = np.array([noise.noise2(1.3 * float(np.cos(a)), 1.3 * float(np.sin(a))) for a in angles])
    r = radius_m * (1.0 + ragged * wave / 0.6)
    return Polygon(np.column_stack([x + r * np.cos(angles), y + r * np.sin(angles)]))


def ragged_outline(ring: LinearRing, seed: int, amplitude_m: float, step_m: float) -> Polygon:
    """Make a natural outline from a coarse one: resampled every `step_m` and pushed in and out by noise, metres."""
    count = int(ring.length / step_m)
    at = shapely.get_coordinates([ring.interpolate(k / count, normalized=True) for k in range(count)])
    before, after = np.roll(at, 1, axis=0), np.roll(at, -1, axis=0)
    along = after - before
    along = unit(along)
    noise, angles = OpenSimplex(seed=seed), np.arange(count) / count * 2 * np.pi
    bends = ring.length / (2 * np.pi * 14.0)
    wave = [noise.noise2(bends * float(np.cos(t)), bends * float(np.sin(t))) for t in angles]
    out = at + amplitude_m * 1.5 * np.asarray(wave)[:, None] * np.column_stack([along[:, 1], -along[:, 0]])
    outline = Polygon(out).buffer(0)
    smooth = outline.buffer(1.5, quad_segs=3).buffer(-3.0, quad_segs=3).buffer(1.5, quad_segs=3)
    return smooth if isinstance(smooth, Polygon) else max(smooth.geoms, key=lambda g: g.area)
