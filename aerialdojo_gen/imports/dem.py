"""Height models: GeoTIFF (by rasterio), ESRI ASCII grids and NPZ, sampled in metres."""

from __future__ import annotations

import importlib
import math
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError, MissingPackage, UsageError, check_regular, first_line, no_package
from aerialdojo_gen.imports.earth import Bbox, format_bbox
from aerialdojo_gen.scenes.terrain import read_ascii_grid

Floats = NDArray[np.float64]
# Surveys have far fewer; crop a continental model first.
_MAX_CELLS = 100_000_000
_MAX_TEXT_BYTES = 512 << 20
_MAX_HEIGHT_M = 1e5
_EDGE = 1e-6
_DEGREES = 1.0
_SUFFIXES = (".tif", ".tiff", ".asc", ".npz")


@dataclass(frozen=True, eq=False)
class Dem:
    """A grid of heights."""

    path: Path  # The file
    heights_m: Floats  # Metres; rows run from north to south, NaN for nodata
    x0: float  # Position of the north-western height, in the grid's coordinates
    y0: float
    dx: float  # Cell size eastwards and southwards, positive
    dy: float
    geographic: bool
    to_grid: Callable[[Floats, Floats], tuple[Floats, Floats]] | None

    @property
    def extent(self) -> Bbox:
        """West, south, east, north, in the grid's coordinates."""
        rows, columns = self.heights_m.shape
        return self.x0, self.y0 - (rows - 1) * self.dy, self.x0 + (columns - 1) * self.dx, self.y0

    def at(self, x: Floats, y: Floats) -> Floats:
        """Bilinear heights at points in the grid's coordinates; NaN outside and next to nodata."""
        rows, columns = self.heights_m.shape
        u, v = (x - self.x0) / self.dx, (self.y0 - y) / self.dy
        near = (u > -_EDGE) & (v > -_EDGE) & (u < columns - 1 + _EDGE) & (v < rows - 1 + _EDGE)
        u, v = np.clip(u, 0, columns - 1), np.clip(v, 0, rows - 1)
        j, i = np.minimum(u.astype(int), columns - 2), np.minimum(v.astype(int), rows - 2)
        u, v = u - j, v - i
        h = self.heights_m
        total = np.zeros(np.shape(x))
        for a, b, weight in ((0, 0, (1 - u) * (1 - v)), (0, 1, u * (1 - v)), (1, 0, (1 - u) * v), (1, 1, u * v)):
            # Nodata matters only where its weight is not zero.
            total += np.where(weight > 1e-9, weight * h[i + a, j + b], 0.0)
        return np.where(near, total, np.nan)

    def at_degrees(self, lon: Floats, lat: Floats) -> Floats:
        """Heights at longitudes and latitudes; `UsageError` without a geographic reference."""
        if self.to_grid is None:
            raise UsageError(f"{self.path} has no geographic coordinates: use a GeoTIFF or a grid in degrees")
        return self.at(*self.to_grid(lon, lat))


def read_dem(path: Path) -> Dem:
    """Read a height model: GeoTIFF, ESRI ASCII grid, or ``.npz`` with `heights_m` and `cell_m` or `bbox_deg`."""
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise AssetError(f"{path}: a height model is a file {', '.join(_SUFFIXES)}")
    try:
        check_regular(path)
    except OSError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror})") from None
    dem = _geotiff(path) if suffix in (".tif", ".tiff") else _ascii(path) if suffix == ".asc" else _npz(path)
    if min(dem.heights_m.shape) < 2:
        size = " by ".join(map(str, dem.heights_m.shape))
        raise AssetError(f"{path}: has {size} heights, at least 2 by 2 are needed")
    if not np.isfinite(dem.heights_m).any():
        raise AssetError(f"{path}: contains no heights: every cell is nodata")
    return dem


def _geotiff(path: Path) -> Dem:
    try:
        rasterio = importlib.import_module("rasterio")
        warp = importlib.import_module("rasterio.warp")
    except ImportError:
        raise MissingPackage(no_package(f"{path}, a GeoTIFF,", "rasterio", "maps")) from None
    try:
        # GTiff driver only: other drivers follow references to files and URLs.
        with rasterio.open(path, driver="GTiff") as file:
            if file.width * file.height > _MAX_CELLS:
                raise AssetError(
                    f"{path} has {file.width:,} x {file.height:,} heights, the maximum is {_MAX_CELLS:,}: "
                    "cut a part out of it first"
                )
            z = file.read(1, masked=True).astype(np.float64).filled(np.nan)
            crs, t = file.crs, file.transform
    except rasterio.errors.RasterioError as error:
        why = f"cannot be read as a GeoTIFF, or is cut short: {first_line(error)}"
        raise AssetError(f"{path} {why}; get it again") from None
    if crs is None:
        raise AssetError(f"{path} has no coordinate system: set one, e.g. gdal_edit.py -a_srs EPSG:4326 {path.name}")
    if abs(t.b) > 1e-12 or abs(t.d) > 1e-12 or t.a <= 0 or t.e >= 0:
        raise AssetError(f"{path} is rotated or mirrored: north must be up (gdalwarp -t_srs EPSG:4326 fixes it)")
    if not crs.is_geographic and not math.isclose(crs.linear_units_factor[1], 1.0, rel_tol=1e-9):
        wrong = f"is in {crs.linear_units_factor[0]}, not in metres or degrees"
        raise AssetError(f"{path} {wrong}: gdalwarp -t_srs EPSG:4326 makes it so")

    def to_grid(lon: Floats, lat: Floats) -> tuple[Floats, Floats]:
        shape = np.shape(lon)
        x, y = warp.transform("EPSG:4326", crs, np.ravel(lon).tolist(), np.ravel(lat).tolist())
        return np.reshape(x, shape), np.reshape(y, shape)

    z[~(np.abs(z) < _MAX_HEIGHT_M)] = np.nan
    # GeoTIFF heights are at cell centres.
    return Dem(path, z, t.c + t.a / 2, t.f + t.e / 2, t.a, -t.e, bool(crs.is_geographic), to_grid)


def _ascii(path: Path) -> Dem:
    grid = read_ascii_grid(path, _MAX_CELLS, _MAX_TEXT_BYTES, _MAX_HEIGHT_M)
    rows, columns = grid.heights_m.shape
    west, north, cell = grid.x0_m, grid.y0_m + (rows - 1) * grid.cell_m, grid.cell_m
    geographic = cell * max(rows, columns) < 5 and abs(west) <= 180 and abs(north) <= 90 and cell < _DEGREES / 10
    return Dem(path, grid.heights_m[::-1], west, north, cell, cell, geographic, _identity if geographic else None)


def _npz(path: Path) -> Dem:
    try:
        _check_npz_sizes(path)
        with np.load(path, allow_pickle=False) as file:
            z = np.array(file["heights_m"], dtype=np.float64)
            cell = float(file["cell_m"]) if "cell_m" in file else None
            bbox = [float(v) for v in file["bbox_deg"]] if "bbox_deg" in file else None
    except (
        OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError, zlib.error, zipfile.BadZipFile,
    ) as error:  # fmt: skip
        wanted = "it must hold heights_m with cell_m or bbox_deg"
        raise AssetError(f"{path} cannot be read: {first_line(error)}; {wanted}") from None
    if z.ndim != 2 or z.size > _MAX_CELLS or (cell is None) == (bbox is None) or min(z.shape) < 2:
        raise AssetError(
            f"{path} must hold heights_m, 2 by 2 or more, with cell_m (metres) or bbox_deg (west, south, east, north)"
        )
    z[~(np.abs(z) < _MAX_HEIGHT_M)] = np.nan
    rows, columns = z.shape
    if bbox is not None:
        if len(bbox) != 4 or not (bbox[0] < bbox[2] and bbox[1] < bbox[3]):
            raise AssetError(f"{path}: bbox_deg must be west, south, east, north")
        west, south, east, north = bbox
        return Dem(path, z, west, north, (east - west) / (columns - 1), (north - south) / (rows - 1), True, _identity)
    if cell is None or not (math.isfinite(cell) and cell > 0):
        raise AssetError(f"{path}: cell_m must be a number above 0")
    return Dem(path, z, 0.0, (rows - 1) * cell, cell, cell, False, None)


def _check_npz_sizes(path: Path) -> None:
    """Refuse an NPZ with oversized arrays: a few kilobytes can expand to terabytes."""
    with zipfile.ZipFile(path) as archive:
        for name in ("heights_m.npy", "cell_m.npy", "bbox_deg.npy"):
            if name not in archive.namelist():
                continue
            with archive.open(name) as file:
                version = np.lib.format.read_magic(file)
                read = {(1, 0): np.lib.format.read_array_header_1_0}.get(version, np.lib.format.read_array_header_2_0)
                shape, _, dtype = read(file)
            if math.prod(shape) * dtype.itemsize > 8 * _MAX_CELLS:
                raise ValueError(f"{name} has {math.prod(shape):,} numbers, the maximum is {_MAX_CELLS:,}")


def _identity(lon: Floats, lat: Floats) -> tuple[Floats, Floats]:
    return lon, lat


def describe_coverage(dem: Dem) -> str:
    """Describe the extent of a height model, for messages."""
    west, south, east, north = dem.extent
    if dem.geographic:
        return f"{dem.path.name} covers {format_bbox(dem.extent)}"
    return f"{dem.path.name} covers x {west:,.0f} to {east:,.0f}, y {south:,.0f} to {north:,.0f} m"
