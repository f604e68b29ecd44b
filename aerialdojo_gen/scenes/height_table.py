"""Tables of heights: ESRI ASCII grids, as text that a geographic information system opens."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError, check_regular
from aerialdojo_gen.scenes.terrain import Terrain

Floats = NDArray[np.float64]
_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "nodata_value")
_NODATA = -9999.0
# A table beside a plan: a hundred times the cells that a scene should have; and the largest height of a plan.
_MAX_CELLS, _MAX_TEXT_BYTES, _MAX_M = 4_000_000, 64 << 20, 2000.0


@dataclass(frozen=True, eq=False)
class AsciiGrid:
    """Heights as the file has them; rows run from north to south, NaN for what has none."""

    heights_m: Floats
    west: float  # Position of the south-western height
    south: float
    cell: float


def read_ascii_grid(path: Path, max_cells: int, max_bytes: int, max_height_m: float) -> AsciiGrid:
    """Read an ESRI ASCII grid."""
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
    z = numbers.reshape(rows, columns)
    z[(z == head.get("nodata_value", _NODATA)) | ~(np.abs(z) < max_height_m)] = np.nan
    half = 0.0 if "xllcenter" in head else cell / 2
    west = head.get("xllcenter", head.get("xllcorner", 0.0)) + half
    south = head.get("yllcenter", head.get("yllcorner", 0.0)) + half
    return AsciiGrid(z, west, south, cell)


def read_heights(path: Path) -> Terrain:
    """Read the table of heights of a plan, metres about its origin."""
    try:
        check_regular(path)
        if path.resolve(strict=True).parent != path.parent.resolve():
            raise AssetError(f"{path} points outside its folder: put the table itself there")
    except OSError as error:
        raise AssetError(f"{path} cannot be read ({error.strerror}): it belongs beside the plan") from None
    grid = read_ascii_grid(path, _MAX_CELLS, _MAX_TEXT_BYTES, _MAX_M)
    if min(grid.heights_m.shape) < 2 or np.isnan(grid.heights_m).any() or not 0.1 <= grid.cell <= 100.0:
        raise AssetError(f"{path} must have 2 by 2 heights or more, 0.1 to 100 m apart, each within {_MAX_M:,.0f} m")
    return Terrain(grid.west, grid.south, grid.cell, grid.heights_m[::-1].copy())


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
