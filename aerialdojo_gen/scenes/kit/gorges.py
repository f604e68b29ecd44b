"""A rocky gorge or a soft valley along y through ground at z = 0, and the stream at its bottom."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.ground import ribbon
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.kit.landforms import grid
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import Material, Number
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, smooth


@dataclass(frozen=True)
class Stream:
    """A stream that winds northwards."""

    swing_m: Number = 3.2  # To either side
    bend_m: Annotated[Number, Field(gt=0)] = 11.0  # Northing a radian of its waves
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
    ys = [float(y) for y in np.arange(-half, half + 1.0, 2.5)]
    edge = [half_m + 1.2 + 1.3 * float(np.sin(y * 0.9) + np.sin(y * 0.37 + 1.0)) for y in ys]
    rims = [
        [(s * (e if s > 0 else edge[-1 - k]), y) for k, (e, y) in enumerate(zip(edge, ys, strict=True))]
        for s in (-1, 1)
    ]
    site.paint(Polygon([*rims[0], *rims[1][::-1]]), rock)
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
        thing = Placement(category, x, y, yaw, z=on, place=phrase)
        site.place(thing, settle_m=0.5, margin_m=1.6 if on is None else 0.0)


@ground_builder
def valley(
    _site: Site, terrain: Terrain, *, depth_m: Number, half_m: Number, stream: Stream,
    slope_m: Annotated[Number, Field(gt=0)], bed_m: Number = 0.6,
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
