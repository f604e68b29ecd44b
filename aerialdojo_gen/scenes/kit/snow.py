"""Winter: slopes, banks beside ways, moguls, ridges of broken ice, the boards of a rink."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.portable import exp
from aerialdojo_gen.scenes.grammar_frames import Parts
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.mesh import rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, Line, Material, Number
from aerialdojo_gen.scenes.shapes import box, crown
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain


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
