"""Split a large mesh into scenes in one frame."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.imports.cutting import Region
from aerialdojo_gen.imports.import_mesh import LARGEST_M, SMALLEST_M, MeshOptions, Repairs, SourceMesh, make_scene
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]

_MAX_TILES = 400
# Tiles at the edge with less than this share of their plan are skipped.
_MIN_SHARE = 0.02


def make_tiles(
    name: str, source: SourceMesh, edge_m: float, options: MeshOptions
) -> Iterator[tuple[Region, Scene, Repairs]]:
    """Cut a mesh into squares of `edge_m` metres, in one frame; yields those with content, from south-west on."""
    if not (math.isfinite(edge_m) and SMALLEST_M <= edge_m <= LARGEST_M):
        raise UsageError(f"--tiles {edge_m:g}: the edge of a tile is {SMALLEST_M:g} to {LARGEST_M:g} m")
    low, high = source.low, source.high
    columns, rows = (max(1, math.ceil(v / edge_m - 1e-9)) for v in (high - low)[:2])
    if columns * rows > _MAX_TILES:
        raise AssetError(
            f"--tiles {edge_m:g}: {columns * rows:,} tiles, the maximum is {_MAX_TILES}: use larger tiles"
        )
    origin = np.array([*(low[:2] + high[:2]) / 2, low[2]])
    boxes = np.array([[b.vertices[:, :2].min(axis=0), b.vertices[:, :2].max(axis=0)] for b in source.bodies])
    for row in range(rows):
        for column in range(columns):
            corner = low[:2] + edge_m * np.array([column, row])
            region = Region.box(*corner, *(corner + edge_m))
            near = np.asarray((boxes[:, 0] < region.high).all(axis=1) & (boxes[:, 1] > region.low).all(axis=1))
            part = SourceMesh(
                [b for b, n in zip(source.bodies, near, strict=True) if n], source.domes, source.repairs
            )
            if not near.any() or not _has_content(part, region, edge_m):
                continue
            yield region, *make_scene(tile_name(name, column, row), part, options, region, origin)


def tile_name(name: str, column: int, row: int) -> str:
    """Name a tile by its column from the west and its row from the south; a partition suffix stays last."""
    for suffix in ("_0", "_1"):
        if name.endswith(suffix):
            return f"{name[: -len(suffix)]}-x{column}y{row}{suffix}"
    return f"{name}-x{column}y{row}"


def _has_content(source: SourceMesh, region: Region, edge_m: float) -> bool:
    """Whether the content of a square is wide enough to fly in."""
    try:
        part = source.within(region)
    except AssetError:
        return False
    size = (part.high - part.low)[:2]
    return bool(size.max() >= SMALLEST_M and np.prod(size) >= _MIN_SHARE * edge_m**2)
