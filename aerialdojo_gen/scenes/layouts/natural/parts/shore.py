"""Shores: ground shaped by a coastline, the sea painted level before it, cliffs, boulders, things set out by hand.

The sea is level at z = 0, so that boats float on it; the land rises from the coastline.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.grammar_props import next_variant
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.kit.natural_ground import Spot, Thing, blob, place_near
from aerialdojo_gen.scenes.mesh import Floats, Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import crown, cylinder
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain

Height = Callable[[Floats, Floats, Floats], Floats]


def shaped(site: Site, cell_m: float, wavelength_m: float, height: Height) -> Terrain:
    """Make a terrain from a function.

    Parameters
    ----------
    site : Site
        Its extent and seed.
    cell_m : float
        Edge of a cell; should divide the extents.
    wavelength_m : float
        Of the noise that the function gets.
    height : callable
        ``(x, y, noise) -> z``: arrays of one shape, metres; the noise lies within about -1 to 1.
    """
    base = rolling_terrain(site.recipe.size_m, cell_m, site.recipe.seed, 1.0, wavelength_m, octaves=3)
    x, y, _ = base.corners().T
    z = height(x, y, base.heights_m.ravel())
    return replace(base, heights_m=np.asarray(z, dtype=np.float64).reshape(base.heights_m.shape))


def inland_m(land: BaseGeometry, x: Floats, y: Floats) -> Floats:
    """Distance from the coastline at points, metres: positive on the land, negative at sea."""
    shapely.prepare(land)
    away = np.asarray(shapely.distance(land.boundary, shapely.points(x, y)), dtype=np.float64)
    return np.where(shapely.contains_xy(land, x, y), away, -away)


def rise(t: Floats | float, start: Floats | float, end: Floats | float) -> Floats:
    """Climb smoothly from 0 at `start` to 1 at `end`: numbers, or arrays of one shape."""
    u = np.clip((np.asarray(t, dtype=np.float64) - start) / (end - start), 0.0, 1.0)
    return np.asarray(u * u * (3.0 - 2.0 * u))


def steep_area(terrain: Terrain, degrees: float, over_m: float = 0.7) -> BaseGeometry:
    """Give the area where the ground is steeper than an angle, its outline rounded off by about `over_m` metres."""
    corners, faces = terrain.corners(), terrain.triangles()
    a, b, c = (corners[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    steep = normal[:, 2] < np.cos(np.radians(degrees)) * np.linalg.norm(normal, axis=1)
    tiles = shapely.polygons(corners[faces[steep]][:, :, :2])
    return shapely.union_all(tiles).buffer(2 * over_m, quad_segs=2).buffer(-over_m, quad_segs=2)


def above_area(terrain: Terrain, z_m: float) -> BaseGeometry:
    """Give the area of the cells whose corners all lie higher than `z_m`, rounded off."""
    corners, faces = terrain.corners(), terrain.triangles()
    high = (corners[faces][:, :, 2] > z_m).all(axis=1)
    tiles = shapely.polygons(corners[faces[high]][:, :, :2])
    return shapely.union_all(tiles).buffer(1.6, quad_segs=2).buffer(-1.0, quad_segs=2)


def paint_sea(site: Site, land: BaseGeometry, shallow_m: float = 9.0) -> None:
    """Paint the sea around the land: deep water, a ragged belt of shallows, foam at the edge, and wet sand.

    The palette's roles are ``deep``, ``shallow``, ``foam`` and ``wet``.
    """
    seed = site.recipe.seed
    sea = site.extent.difference(land)
    site.paint(sea, site.material("deep", "water:#2f7d9a"))
    shore = land.boundary.intersection(site.extent)
    count = max(int(shore.length / (0.8 * shallow_m)), 1)
    spots = [shore.interpolate(k / count, normalized=True) for k in range(count)]
    belt = [blob(p.x, p.y, shallow_m, seed + 300 + k, 0.4) for k, p in enumerate(spots)]
    site.paint(shapely.union_all(belt).intersection(sea), site.material("shallow", "water:#55a9ac"))
    near = [blob(p.x, p.y, 0.4 * shallow_m, seed + 500 + k, 0.4) for k, p in enumerate(spots)]
    lagoon = shapely.union_all([*near, land.buffer(0.25 * shallow_m, quad_segs=3)]).intersection(sea)
    site.paint(lagoon, site.material("lagoon", "water:#7cc4bd"))
    foam = [blob(p.x, p.y, 0.9, seed + 700 + k, 0.5) for k, p in enumerate(_dense(shore, 2.1))]
    site.paint(shapely.union_all(foam).difference(land.buffer(-0.35)), site.material("foam", "water:#dcebe8"))
    site.paint(land.difference(land.buffer(-1.5, quad_segs=3)), site.material("wet", "sand:#b99c6c"))


def _dense(line: BaseGeometry, spacing_m: float) -> list[shapely.Point]:
    count = max(int(line.length / spacing_m), 1)
    return [line.interpolate(k / count, normalized=True) for k in range(count)]


def settle(site: Site, place: str, things: Sequence[Thing], margin_m: float = 1.2) -> None:
    """Set things out by world coordinates, each of the variant that is rarest so far where none is asked for.

    Unlike in `place_near`, `lift_m` is the z of a base: decks and roofs over water have no ground to count from.
    """
    datum = site.ground_z(0.0, 0.0)
    for thing in things:
        variant = thing.variant or next_variant(site, thing.category)
        lift = None if thing.lift_m is None else thing.lift_m - datum
        place_near(site, Spot(0.0, 0.0, 0.0, place), [replace(thing, variant=variant, lift_m=lift)], margin_m)


def boulders(
    site: Site,
    area: BaseGeometry,
    spacing_m: float,
    radius_m: tuple[float, float],
    material: str,
    *,
    category: str = "shore_rocks",
    limit: int = 200,
    flat: float = 0.75,
) -> Instance | None:
    """Strew rocks over an area, half sunk in the ground, as one piece of structure; taken ground stays free.

    Parameters
    ----------
    site : Site
        Where.
    area : shapely geometry
        World frame, metres.
    spacing_m : float
        Least distance of two rocks.
    radius_m : (float, float)
        Least and greatest radius.
    material : str
        Of the rocks.
    category : str
        Of the structure.
    limit : int
        Most rocks.
    flat : float
        Height over width.
    """
    rng = site.rng_for("boulders", category, round(area.area, 2))
    bodies, plans = [], []
    for x, y, yaw in poisson_disc(area, spacing_m, rng, limit=limit):
        r = float(rng.uniform(*radius_m))
        z = site.ground_z(x, y)
        if not site.is_free(x, y, r * 0.9, z=z, height_m=r):
            continue
        rock = crown(radii=[r, r * float(rng.uniform(0.7, 1.0)), r * flat], noise=0.3, subdivisions=1,
                     seed=int(rng.integers(1, 60)))  # fmt: skip
        bodies.append(translated(rotated(rock, rotation(0.0, 0.0, yaw)), (x, y, z + 0.15 * r)))
        plans.append(shapely.Point(x, y).buffer(r, quad_segs=3))
    if not bodies:
        return None
    return site.add(None, category, [(material, merge(bodies))], footprint=shapely.union_all(plans))


def broadleaves(
    site: Site,
    area: BaseGeometry,
    spacing_m: float,
    density: Callable[[float, float], float],
    limit: int,
    height_m: tuple[float, float],
    leaves: str = "foliage:#4a7a32",
) -> Instance | None:
    """Grow nameless round-crowned trees over an area as one piece of structure: background that nothing refers to.

    Parameters
    ----------
    site : Site
        Where; the stems take their ground.
    area : shapely geometry
        World frame, metres.
    spacing_m : float
        Least distance of two stems where the density is 1.
    density : callable
        ``(x, y) -> float`` in 0 to 1.
    limit : int
        Most trees.
    height_m : (float, float)
        Least and greatest height.
    leaves : str
        Material of the crowns.
    """
    rng = site.rng_for("broadleaves", round(area.area, 2))
    stems: list[Mesh] = []
    crowns: list[Mesh] = []
    plans: list[BaseGeometry] = []
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density, 3 * limit):
        high = float(rng.uniform(*height_m))
        if len(stems) >= limit or not site.is_free(x, y, 0.18 * high):
            continue
        z, reach = site.ground_z(x, y), 0.3 * high
        stem = cylinder(radius=0.035 * high, radius_top=0.02 * high, height=0.62 * high + 0.4, segments=7)
        stems.append(translated(stem, (x, y, z - 0.4)))
        for k, (out, share, up) in enumerate(((0.0, 1.0, 0.72), (0.75, 0.7, 0.6), (0.75, 0.6, 0.66))):
            turn = np.radians(yaw + 170.0 * k)
            at = (x + out * reach * float(np.cos(turn)), y + out * reach * float(np.sin(turn)), z + up * high)
            size = [share * reach, share * reach, share * reach * 0.8]
            body = crown(radii=size, noise=0.25, subdivisions=1, seed=int(rng.integers(1, 40)))
            crowns.append(translated(body, at))
        plans.append(shapely.Point(x, y).buffer(0.5, quad_segs=2))
    if not stems:
        return None
    parts = [("bark", merge(stems)), (leaves, merge(crowns))]
    return site.add(None, "broadleaf_trees", parts, footprint=shapely.union_all(plans))


def ragged(points: Sequence[tuple[float, float]], seed: int, amplitude_m: float, step_m: float = 3.0) -> Polygon:
    """Make a natural outline from a coarse one: resampled every `step_m` and pushed in and out by noise, metres."""
    ring = Polygon(points).exterior
    count = int(ring.length / step_m)
    at = shapely.get_coordinates([ring.interpolate(k / count, normalized=True) for k in range(count)])
    before, after = np.roll(at, 1, axis=0), np.roll(at, -1, axis=0)
    along = after - before
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    noise, angles = OpenSimplex(seed=seed), np.arange(count) / count * 2 * np.pi
    bends = ring.length / (2 * np.pi * 14.0)
    wave = [noise.noise2(bends * float(np.cos(t)), bends * float(np.sin(t))) for t in angles]
    out = at + amplitude_m * 1.5 * np.asarray(wave)[:, None] * np.column_stack([along[:, 1], -along[:, 0]])
    outline = Polygon(out).buffer(0)
    smooth = outline.buffer(1.5, quad_segs=3).buffer(-3.0, quad_segs=3).buffer(1.5, quad_segs=3)
    return smooth if isinstance(smooth, Polygon) else max(smooth.geoms, key=lambda g: g.area)
