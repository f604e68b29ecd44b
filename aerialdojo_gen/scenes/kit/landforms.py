"""Shapes of the ground, natural and dug, each on the terrain of the one before, and heights for what stands on it."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import exp, power
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.mesh import Floats
from aerialdojo_gen.scenes.plans.values import Area, Areas, At, Formula, Line, Number, Point3, Positive, Spacing
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, level_terrain, rolling_terrain, smooth

# Smoothing a way takes the square of its length.
_LONGEST_M = 3000.0
_Run = Annotated[Number, Field(ge=0.1)]


@ground_builder
def rolling_ground(
    site: Site, terrain: Terrain, *, cell_m: Spacing, height_m: Number, wavelength_m: Positive,
    octaves: Annotated[int, Field(ge=1, le=8)] = 4, seed: int | None = None, over: bool = False,
) -> Terrain:  # fmt: skip
    """Make rolling ground by noise of a seed, the plan's by default, in place of what was there or `over` it."""
    seed = site.head.seed if seed is None else seed
    rolling = rolling_terrain(site.head.size_m, cell_m, seed, height_m, wavelength_m, octaves)
    return rolling.raised(terrain.heights_m) if over else rolling


@ground_builder
def hillside_steps(
    _site: Site, terrain: Terrain, *, steps: list[tuple[Number, Number]], half_m: Number,
    soft_m: Positive = 4.0, run_m: tuple[_Run, _Run] = (1.0, 8.0),
) -> Terrain:  # fmt: skip
    """Let the ground rise northwards in steps (y, rise): steep up to `half_m` from the middle, soft beyond."""
    x, y = grid(terrain)
    run = run_m[0] + (run_m[1] - run_m[0]) * np.clip((np.abs(x) - half_m) / soft_m, 0.0, 1.0)
    for at, rise in steps:
        terrain = terrain.raised(rise * smooth((y - at + run / 2 - 0.1) / run))
    return terrain


@ground_builder
def round_levels(
    _site: Site, terrain: Terrain, *, discs: list[tuple[Number, Number, Number, Number]], blend_m: Positive = 7.0
) -> Terrain:
    """Level discs (x, y, radius, height), one after the other, with a slope about each back to the old ground."""
    x, y = grid(terrain)
    for u, v, radius, to_m in discs:
        terrain = terrain.blended(to_m, smooth(1.0 - (np.hypot(x - u, y - v) - radius) / blend_m))
    return terrain


@ground_builder
def level_about(
    _site: Site, terrain: Terrain, *, area: Area, to_m: Number, reach_m: Number, blend_m: Positive
) -> Terrain:
    """Level an area and `reach_m` about it, with a slope back to the old ground."""
    return terrain.blended(to_m, smooth(1.0 - (terrain.distance(area) - reach_m) / blend_m))


@ground_builder
def bank_about(
    _site: Site, terrain: Terrain, *, area: Area, start_m: Number, end_m: Number, to_m: Number,
    fade_x: tuple[Number, Number],
) -> Terrain:  # fmt: skip
    """Raise a bank about an area, which rises between two distances from it, and comes up between two x."""
    t, fade = between(terrain.distance(area), start_m, end_m), between(grid(terrain)[0], *fade_x)
    return replace(terrain, heights_m=np.maximum(terrain.heights_m, to_m * t * fade))


@ground_builder
def ground_by_formula(
    site: Site, terrain: Terrain, *, height: Formula, let: dict[str, Formula] = {}, inland: dict[str, Area] = {},  # noqa: B006
    noise_m: Positive = 20.0, cell_m: Spacing | None = None,
) -> Terrain:  # fmt: skip
    """Shape the ground by a formula over x and y, the height z so far, and noise of a wavelength, from -1 to 1.

    `inland` names distances to the borders of areas, positive inside; `let` names formulas for those after them. With
    `cell_m` the ground begins anew, level, with cells of that size.
    """
    cell_m = terrain.cell_m if cell_m is None else cell_m
    waves = rolling_terrain(site.head.size_m, cell_m, site.head.seed, 1.0, noise_m, octaves=3)
    x, y, noise = waves.corners().T
    arrays = {"x": x, "y": y, "noise": noise, "z": np.asarray(terrain.z(x, y))}
    arrays |= {name: inland_m(area, x, y) for name, area in inland.items()}
    for name, formula in let.items():
        arrays[name] = formula(arrays)
    shape = waves.heights_m.shape
    return replace(waves, heights_m=np.array(np.broadcast_to(height(arrays), x.shape).reshape(shape)))


def inland_m(land: BaseGeometry, x: Floats, y: Floats) -> Floats:
    """Distance from an area's border at points, metres: positive inside, negative outside."""
    shapely.prepare(land)
    away = np.asarray(shapely.distance(land.boundary, shapely.points(x, y)), dtype=np.float64)
    return np.where(shapely.contains_xy(land, x, y), away, -away)


@ground_builder
def hill(_site: Site, terrain: Terrain, *, at: At, radius_m: Number, height_m: Number) -> Terrain:
    """Raise a round hill, or sink a hollow where its height is negative."""
    return terrain.raised(height_m * smooth(1.0 - terrain.distance(Point(at)) / radius_m))


@ground_builder
def level_area(
    _site: Site, terrain: Terrain, *, area: Areas, to_m: Number | None = None, blend_m: Number = 4.0,
    above: tuple[Number, Number, Number] | None = None,
) -> Terrain:  # fmt: skip
    """Level an area, or several in turn, with a slope about each back to the old ground.

    Each gets the height `to_m`, or one `above` the ground at a point (x, y, by how much), or its own mean height.
    """
    if above is not None:
        x, y, more_m = above
        to_m = float(terrain.z(x, y)) + more_m
    for one in area:
        terrain = terrain.flattened(one, to_m, blend_m)
    return terrain


@ground_builder
def level_cross(_site: Site, terrain: Terrain, *, half_m: At, blend_m: At) -> Terrain:
    """Level two strips along the axes at z = 0: that along y of the first half width, that along x of the second."""
    x, y = grid(terrain)
    rough = smooth((np.abs(y) - half_m[1]) / blend_m[1]) * smooth((np.abs(x) - half_m[0]) / blend_m[0])
    return replace(terrain, heights_m=terrain.heights_m * rough)


@ground_builder
def slope(
    _site: Site, terrain: Terrain, *, start_m: Number, end_m: Number, to_m: Number,
    within: tuple[Number, Number] = (-2000.0, 2000.0), axis: Literal["x", "y"] = "x", only_up: bool = False,
) -> Terrain:  # fmt: skip
    """Let the ground slope along an axis from its own height to another, level beyond; only within two limits.

    With `only_up` it slopes from z = 0, and higher ground stays as it is.
    """
    along = grid(terrain)["xy".index(axis)]
    t = between(along, start_m, end_m)
    if only_up:
        return replace(terrain, heights_m=np.maximum(terrain.heights_m, to_m * t))
    inside = (along > within[0]) & (along <= within[1])
    return replace(terrain, heights_m=np.where(inside, terrain.heights_m * (1 - t) + to_m * t, terrain.heights_m))


@ground_builder
def level_along(
    _site: Site, terrain: Terrain, *, lines: list[Line], width_m: Number, blend_m: Number = 3.0,
    smooth_m: Positive = 12.0,
) -> Terrain:  # fmt: skip
    """Lay ways into the ground, each level across, and smoothed along over `smooth_m`."""
    for line in lines:
        if LineString(line).length > _LONGEST_M:
            raise AssetError(f"lines: a way may be {_LONGEST_M:,.0f} m long")
        terrain = terrain.graded(line, width_m, blend_m, smooth_m)
    return terrain


@ground_builder
def sink_area(_site: Site, terrain: Terrain, *, area: Area, depth_m: Number, blend_m: Positive) -> Terrain:
    """Sink an area, such as the bed of a stream, with slopes inside its border."""
    return terrain.raised(-depth_m * smooth(terrain.inside(area) / blend_m))


@ground_builder
def level_under_things(site: Site, terrain: Terrain, *, blend_m: Number = 3.0, middles: bool = False) -> Terrain:
    """Level the ground under every thing of the places that say `level`, in their order, or about their middles."""
    for outline, middle in site.footings:
        terrain = terrain.flattened(middle if middles else outline, blend_m=blend_m)
    return terrain


@ground_builder
def bank_scree(_site: Site, terrain: Terrain, *, areas: list[Area], rise_m: Number, reach_m: Positive) -> Terrain:
    """Let the ground rise towards the feet of rocks."""
    for area in areas:
        terrain = terrain.raised(rise_m * np.clip(1.0 - terrain.distance(area) / reach_m, 0.0, 1.0) ** 2)
    return terrain


@site_builder
def ground_height(site: Site, *, at: At) -> float:
    """Give the height of the painted ground at a point, to be named by `as`, metres."""
    return site.ground_z(*at)


@site_builder
def named_area(_site: Site, *, area: Area) -> BaseGeometry:
    """Give an area, made of others that builders have named, to be named by `as`."""
    return area


def grid(terrain: Terrain) -> tuple[Floats, Floats]:
    """Give x and y of the terrain's corners, metres, in the shape of its heights."""
    xy = terrain.corners().reshape(*terrain.heights_m.shape, 3)
    return xy[..., 0], xy[..., 1]


def between(t: Floats, start: float, end: float) -> Floats:
    """Ease from 0 at the start to 1 at the end."""
    if start == end:
        raise ValueError(f"a slope must not begin where it ends, {start:g}")
    return smooth((t - start) / (end - start))


_Steps = Annotated[list[tuple[Number, Number]], Field(min_length=2, max_length=100)]


@ground_builder
def level_grid(site: Site, _terrain: Terrain, *, cell_m: Spacing) -> Terrain:
    """Make level ground at z = 0 that is fine enough to be dug in, in place of what was there."""
    return level_terrain(site.head.size_m, cell_m)


@ground_builder
def ground_profile(_site: Site, terrain: Terrain, *, points: _Steps, axis: Literal["x", "y"] = "x") -> Terrain:
    """Raise the ground by a profile along an axis: (distance along it, height), linear in between."""
    along, heights = np.array(points, dtype=np.float64).T
    return terrain.raised(np.interp(grid(terrain)["xy".index(axis)], along, heights))


@ground_builder
def terraces(_site: Site, terrain: Terrain, *, area: Area, steps: _Steps) -> Terrain:
    """Raise or sink an area by how far inside its outline: (inside, height), linear in between; a pit or a heap."""
    d, h = np.array(steps, dtype=np.float64).T
    return terrain.raised(np.interp(terrain.inside(area), d, h))


@ground_builder
def earth_ramp(
    _site: Site, terrain: Terrain, *, start: Point3, end: Point3, width_m: Number, blend_m: Positive = 2.0
) -> Terrain:
    """Lay a straight ramp into the ground from one point to another, with slopes beside it."""
    line = LineString([start[:2], end[:2]])
    away = terrain.distance(line.buffer(width_m / 2, cap_style="flat"))
    t = line.project(shapely.points(terrain.corners()[:, :2])).reshape(away.shape) / line.length
    return terrain.blended(start[2] + (end[2] - start[2]) * t, np.clip(1.0 - away / blend_m, 0.0, 1.0))


@ground_builder
def rough_area(site: Site, terrain: Terrain, *, area: Area, height_m: Number, stream: str = "ruts") -> Terrain:
    """Make an area uneven by up to `height_m`, as tracked machines leave it."""
    xy = terrain.corners()[:, :2]
    inside = shapely.contains_xy(area, *xy.T).reshape(terrain.heights_m.shape)
    bumps = site.rng_for(stream).uniform(-1.0, 1.0, size=terrain.heights_m.shape) * height_m
    return terrain.raised(np.where(inside, bumps, 0.0))


# Share of a dune's length that is its long windward slope; the slip face takes the rest.
_WINDWARD = 0.7


@ground_builder
def dunes(
    site: Site, _terrain: Terrain, *, cell_m: Spacing, height_m: Number, wavelength_m: Annotated[Number, Field(ge=1)],
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
    ridge = rise * (1.0 - smooth((s01 - _WINDWARD) / (1.0 - _WINDWARD)))
    return ground.raised(height_m * (0.75 + 0.4 * swell) * ridge)


@ground_builder
def stepped_valley(
    site: Site, _terrain: Terrain, *, cell_m: Spacing, bed: Line, steps: list[tuple[Number, Number, Number]],
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
        rise += height * smooth((d - near) / (far - near))
    calm = np.clip(d / 6.0, 0.25, 1.0)
    shape = ground.heights_m.shape
    return replace(ground, heights_m=ground.heights_m * calm.reshape(shape) + rise.reshape(shape))


def _noise_at(seed: int, x: Floats, y: Floats) -> Floats:
    field = OpenSimplex(seed=seed)
    return np.array([field.noise2(float(a), float(b)) for a, b in zip(x, y, strict=True)])


@ground_builder
def profile_slope(
    _site: Site, terrain: Terrain, *, profile: Annotated[list[tuple[Number, Number]], Field(min_length=2)],
    lean: Number = 0.0, smooth_m: Positive = 4.0,
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
def moguls(_site: Site, terrain: Terrain, *, area: Area, height_m: Number, pitch_m: Spacing = 4.4) -> Terrain:
    """Cover an area with the bumps that turning skis leave."""
    x, y = terrain.corners()[:, :2].T
    fade = np.clip(terrain.inside(area).ravel() / 2.0, 0.0, 1.0)
    k = 2 * np.pi / pitch_m
    bump = 0.5 + 0.5 * np.sin(k * x + 0.8 * np.sin(k * y / 2)) * np.sin(k * y)
    return terrain.raised(height_m * fade * bump)
