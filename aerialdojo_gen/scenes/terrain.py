"""Heightfields: rolling ground from noise, graded where things stand and paths run; tables of surveyed heights."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError, check_regular
from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import exp
from aerialdojo_gen.scenes.mesh import Floats, Ints

_GAIN = 0.45  # Of an octave of noise over the one before


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights on a regular grid; every cell is cut into two triangles by its south-west to north-east diagonal."""

    x0_m: float  # South-west corner, world frame, metres
    y0_m: float
    cell_m: float  # Edge of a cell, metres
    heights_m: Floats  # (ny + 1, nx + 1) float64; z at the corners of the cells, metres; rows run north

    def z(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Height of the triangulated surface at points, metres; beyond the border that of the nearest point in it."""
        rows, columns = (n - 1 for n in self.heights_m.shape)
        u = np.clip((np.asarray(x, dtype=np.float64) - self.x0_m) / self.cell_m, 0.0, columns)
        v = np.clip((np.asarray(y, dtype=np.float64) - self.y0_m) / self.cell_m, 0.0, rows)
        j = np.minimum(u.astype(np.int64), columns - 1)
        i = np.minimum(v.astype(np.int64), rows - 1)
        u, v = u - j, v - i
        h = self.heights_m
        sw, se, nw, ne = h[i, j], h[i, j + 1], h[i + 1, j], h[i + 1, j + 1]
        below = sw + u * (se - sw) + v * (ne - se)
        above = sw + v * (nw - sw) + u * (ne - nw)
        return np.where(u >= v, below, above)

    def at(self, x: float, y: float) -> float:
        """Height at one point, as of `z` without arrays."""
        rows, columns = (n - 1 for n in self.heights_m.shape)
        u = min(max((float(x) - self.x0_m) / self.cell_m, 0.0), float(columns))
        v = min(max((float(y) - self.y0_m) / self.cell_m, 0.0), float(rows))
        j, i = min(int(u), columns - 1), min(int(v), rows - 1)
        u, v = u - j, v - i
        h = self.heights_m.item
        sw, ne = h(i, j), h(i + 1, j + 1)
        if u >= v:
            se = h(i, j + 1)
            return sw + u * (se - sw) + v * (ne - se)
        nw = h(i + 1, j)
        return sw + v * (nw - sw) + u * (ne - nw)

    def corners(self) -> Floats:
        """Grid corners as (n, 3) float64 in rows running north, metres."""
        xy = _corners_xy(self.x0_m, self.y0_m, self.cell_m, *self.heights_m.shape)
        return np.column_stack([xy, self.heights_m.ravel()])

    def triangles(self) -> Ints:
        """Triangles as (m, 3) int32 indices into `corners`, counter-clockwise from above."""
        rows, columns = self.heights_m.shape
        i, j = np.mgrid[0 : rows - 1, 0 : columns - 1]
        sw = (i * columns + j).ravel()
        se, nw, ne = sw + 1, sw + columns, sw + columns + 1
        return np.concatenate([np.column_stack([sw, se, ne]), np.column_stack([sw, ne, nw])]).astype(np.int32)

    def flattened(self, area: BaseGeometry, z_m: float | None = None, blend_m: float = 4.0) -> Terrain:
        """Level an area, grid corners within one cell of it too.

        With a slope `blend_m` wide back to the old ground.
        """
        if area.is_empty:
            return self
        near = self.distance(area)
        inside = near <= self.cell_m * 1.5
        if z_m is None and not inside.any():
            raise AssetError(f"the ground about ({area.centroid.x:g}, {area.centroid.y:g}) lies off the site")
        level = float(self.heights_m[inside].mean()) if z_m is None else z_m
        return self._sloped(np.full_like(self.heights_m, level), near, blend_m)

    def graded(self, path: ArrayLike, width_m: float, blend_m: float = 3.0, smooth_m: float = 12.0) -> Terrain:
        """Lay a path (n, 2), world metres, into the ground: level across and smoothed along over `smooth_m`."""
        line = LineString(np.asarray(path, dtype=np.float64))
        s = np.linspace(0.0, line.length, max(int(line.length / 0.5), 2) + 1)
        points = shapely.get_coordinates(line.interpolate(s))
        profile = self.z(points[:, 0], points[:, 1])
        weights = exp(-(((s[:, None] - s[None, :]) / (smooth_m / 2)) ** 2))
        profile = (weights * profile).sum(axis=1) / weights.sum(axis=1)
        corners = self.corners()
        at = line.project(shapely.points(corners[:, :2]))
        target = np.interp(at, s, profile).reshape(self.heights_m.shape)
        return self._sloped(target, self.distance(line.buffer(width_m / 2)), blend_m)

    def raised(self, by_m: Floats) -> Terrain:
        """Add to the heights of the corners, given in rows or as `corners` lists them."""
        return replace(self, heights_m=self.heights_m + by_m.reshape(self.heights_m.shape))

    def blended(self, to_m: Floats | float, share: Floats) -> Terrain:
        """Mix the heights with others, which have a share at every corner, all in rows."""
        return replace(self, heights_m=self.heights_m * (1.0 - share) + to_m * share)

    def distance(self, area: BaseGeometry) -> Floats:
        """Distance of the corners from an area, in rows, metres."""
        shapely.prepare(area)
        shape = self.heights_m.shape
        points = _corner_points(self.x0_m, self.y0_m, self.cell_m, *shape)
        return np.asarray(shapely.distance(area, points).reshape(shape))

    def inside(self, area: BaseGeometry) -> Floats:
        """How deep in an area the corners lie, in rows, metres: 0 outside."""
        within = shapely.contains_xy(area, *self.corners()[:, :2].T).reshape(self.heights_m.shape)
        return np.where(within, self.distance(area.boundary), 0.0)

    def _sloped(self, target: Floats, distance: Floats, blend_m: float) -> Terrain:
        t = smooth((distance - self.cell_m * 1.5) / max(blend_m, 1e-9))
        return replace(self, heights_m=target * (1.0 - t) + self.heights_m * t)


def _corners_xy(x0_m: float, y0_m: float, cell_m: float, rows: int, columns: int) -> Floats:
    grid = np.meshgrid(x0_m + np.arange(columns) * cell_m, y0_m + np.arange(rows) * cell_m)
    return np.column_stack([axis.ravel() for axis in grid])


@lru_cache(maxsize=2)
def _corner_points(x0_m: float, y0_m: float, cell_m: float, rows: int, columns: int) -> NDArray[np.object_]:
    # A scene's ground is levelled under one thing after the other, on one grid.
    return np.asarray(shapely.points(_corners_xy(x0_m, y0_m, cell_m, rows, columns)))


def rolling_terrain(
    size_m: tuple[float, float],
    cell_m: float,
    seed: int,
    amplitude_m: float,
    wavelength_m: float,
    octaves: int = 4,
    ridged: bool = False,
) -> Terrain:
    """Make a terrain about the origin, in metres, by fractal simplex noise.

    `ridged` makes crests in place of hills.
    """
    level = level_terrain(size_m, cell_m)
    total = level.heights_m
    y, x = (start + np.arange(n) * level.cell_m
            for start, n in zip((level.y0_m, level.x0_m), total.shape, strict=True))  # fmt: skip
    weight = 0.0
    for k in range(octaves):
        noise = OpenSimplex(seed=seed * 31 + k).noise2array(x * 2**k / wavelength_m, y * 2**k / wavelength_m)
        total += _GAIN**k * ((0.5 - np.abs(noise)) * 2.0 if ridged else noise)
        weight += _GAIN**k
    return replace(level, heights_m=total / weight * amplitude_m * 1.4)


def level_terrain(size_m: tuple[float, float], cell_m: float) -> Terrain:
    """Make level ground about the origin at z = 0, of about square cells of a size."""
    columns, rows = (int(np.ceil(s / cell_m - 1e-9)) for s in size_m)
    cell = max(size_m[0] / columns, size_m[1] / rows)
    return Terrain(-size_m[0] / 2, -size_m[1] / 2, cell, np.zeros((rows + 1, columns + 1)))


def flat_terrain(size_m: tuple[float, float]) -> Terrain:
    """Make level ground about the origin, of one cell."""
    return level_terrain(size_m, max(size_m))


def smooth(t: Floats) -> Floats:
    """Ease from 0 to 1, with level ends."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "nodata_value")
_NODATA = -9999.0
# A table beside a plan: a hundred times the cells that a scene should have; and the largest height of a plan.
_MAX_CELLS, _MAX_TEXT_BYTES, _MAX_M = 4_000_000, 64 << 20, 2000.0


def read_ascii_grid(path: Path, max_cells: int, max_bytes: int, max_height_m: float) -> Terrain:
    """Read an ESRI ASCII grid, NaN where it has no height."""
    if path.stat().st_size > max_bytes:
        raise AssetError(f"{path} has more than {max_bytes >> 20} MiB: cut a part out of it first")
    head: dict[str, float] = {}
    try:
        with path.open(encoding="ascii") as file:
            while True:
                start = file.tell()
                words = file.readline(200).split()
                if len(words) != 2 or words[0].lower() not in _KEYS:
                    file.seek(start)
                    break
                head[words[0].lower()] = float(words[1])
            columns, rows, cell = int(head["ncols"]), int(head["nrows"]), head["cellsize"]
            if min(columns, rows) < 1:
                raise ValueError(f"{columns} columns, {rows} rows")
            fits = columns * rows <= max_cells
            numbers = np.fromstring(file.read(), dtype=np.float64, sep=" ") if fits else None
    except (KeyError, ValueError, OverflowError, UnicodeDecodeError) as error:
        said = " ".join(str(error).split())[:160] or type(error).__name__
        raise AssetError(
            f"{path} is not an ESRI ASCII grid (ncols, nrows, xllcorner, yllcorner, cellsize): {said}"
        ) from None
    if numbers is None or numbers.size != columns * rows or not (cell > 0 and math.isfinite(cell)):
        found = "too many" if numbers is None else f"{numbers.size:,}"
        raise AssetError(f"{path} says {columns:,} by {rows:,} heights and has {found}: is it truncated?")
    z = numbers.reshape(rows, columns)[::-1]
    z[(z == head.get("nodata_value", _NODATA)) | ~(np.abs(z) < max_height_m)] = np.nan
    half = 0.0 if "xllcenter" in head else cell / 2
    x, y = (head.get(f"{axis}llcenter", head.get(f"{axis}llcorner", 0.0)) + half for axis in "xy")
    return Terrain(x, y, cell, z)


def read_heights(path: Path) -> Terrain:
    """Read the table of heights of a plan, metres about its origin."""
    try:
        check_regular(path)
        if path.resolve(strict=True).parent != path.parent.resolve():
            raise AssetError(f"{path} points outside its folder: put the table itself there")
    except OSError as error:
        raise AssetError(f"{path} cannot be read ({error.strerror}): it belongs beside the plan") from None
    grid = read_ascii_grid(path, _MAX_CELLS, _MAX_TEXT_BYTES, _MAX_M)
    if min(grid.heights_m.shape) < 2 or np.isnan(grid.heights_m).any() or not 0.1 <= grid.cell_m <= 100.0:
        raise AssetError(f"{path} must have 2 by 2 heights or more, 0.1 to 100 m apart, each within {_MAX_M:,.0f} m")
    return grid


def heights_text(rows_m: Floats, cell_m: float) -> str:
    """Write a table of heights about the origin, rows from south to north, in centimetres."""
    rows, columns = rows_m.shape
    head = {
        "ncols": columns, "nrows": rows, "xllcenter": -(columns - 1) * cell_m / 2,
        "yllcenter": -(rows - 1) * cell_m / 2, "cellsize": cell_m,
    }  # fmt: skip
    lines = [f"{key} {value!r}" for key, value in head.items()]
    lines += [" ".join(f"{z:.2f}" for z in row) for row in rows_m[::-1]]
    return "\n".join(lines) + "\n"
