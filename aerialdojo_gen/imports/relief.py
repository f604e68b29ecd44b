"""Convert a height model to the plan of a scene: its ground, and what grows and lies on it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.imports.dem import Dem, describe_coverage
from aerialdojo_gen.imports.earth import Bbox, LocalFrame, format_bbox, size_m
from aerialdojo_gen.imports.map_tags import TABLES
from aerialdojo_gen.imports.placing import Placer
from aerialdojo_gen.scenes.grammar import Pose, poisson_disc
from aerialdojo_gen.scenes.kit.town_buildings import surface_areas
from aerialdojo_gen.scenes.placement import DRAWN
from aerialdojo_gen.scenes.terrain import Terrain, heights_text

Floats = NDArray[np.float64]

SMALLEST_M, LARGEST_M = 20.0, 1000.0
# Two triangles per cell: as many as a whole scene of the dataset.
MAX_CELLS = 40_000
_FINEST_M = 0.25
_MIN_SHARE = 0.5
_HEADROOM_M = 25.0
_ROCK_SLOPE = 0.75


def grid(
    dem: Dem, size: tuple[float, float], cell_m: float, frame: LocalFrame | None, middle: tuple[float, float]
) -> Floats:
    """Sample a height model on a square grid, (rows, columns) metres, rows from south to north; gaps are filled."""
    columns, rows = (round(s / cell_m) for s in size)
    x, y = np.meshgrid(*((np.arange(n + 1) - n / 2) * cell_m for n in (columns, rows)))
    if frame is not None:
        z = dem.at_degrees(*frame.degrees(x, y))
        (west, east), (south, north) = frame.degrees((x[0, 0], x[-1, -1]), (y[0, 0], y[-1, -1]))
        where = format_bbox((float(west), float(south), float(east), float(north)))
    else:
        z = dem.at(x + middle[0], y + middle[1])
        where = f"{size[0]:,.0f} by {size[1]:,.0f} m about ({middle[0]:,.0f}, {middle[1]:,.0f})"
    missing = np.isnan(z)
    if missing.mean() > 1.0 - _MIN_SHARE:
        raise UsageError(f"{missing.mean():.0%} of {where} has no height: {describe_coverage(dem)}")
    if missing.any():
        nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
        z = z[tuple(nearest)]
    return z


def choose_cell(size: tuple[float, float], cell_m: float | None, native_m: float) -> float:
    """Choose the cell size: not finer than the model's, and at most `MAX_CELLS` cells."""
    least = math.sqrt(size[0] * size[1] / MAX_CELLS)
    if cell_m is not None:
        if not (math.isfinite(cell_m) and cell_m >= _FINEST_M) or cell_m < least * 0.999 or cell_m > min(size) / 2:
            raise UsageError(
                f"--cell {cell_m:g}: {size[0]:,.0f} by {size[1]:,.0f} m take cells of "
                f"{max(least, _FINEST_M):.2f} m or more ({MAX_CELLS:,} of them at most), "
                f"and of {min(size) / 2:g} m or less"
            )
        return cell_m
    return max(native_m, least, _FINEST_M * 2)


@dataclass(frozen=True, eq=False)
class HeightTable:
    """Heights about the origin, on a square grid."""

    rows_m: Floats  # To the centimetre; rows run from south to north
    cell_m: float
    datum_m: float  # The model's height that is z = 0

    @classmethod
    def of(cls, z: Floats, cell_m: float) -> HeightTable:
        """Count heights from the lowest."""
        datum = round(float(z.min()), 2)
        return cls(np.round(z - datum, 2), cell_m, datum)

    def terrain(self) -> Terrain:
        """Make the terrain."""
        rows, columns = self.rows_m.shape
        return Terrain(-(columns - 1) * self.cell_m / 2, -(rows - 1) * self.cell_m / 2, self.cell_m, self.rows_m)

    def text(self) -> str:
        """Write the file that lies beside the plan."""
        return heights_text(self.rows_m, self.cell_m)


@dataclass(frozen=True)
class PlacePlan:
    """The plan of a real place."""

    plan: dict[str, Any]
    sections: dict[int, str]  # Comments of the entries that sections begin with
    comments: tuple[str, ...]  # At the top
    heights: HeightTable | None
    place_things: Callable[[Placer], None]  # Places things on the site that the plan has built


_COUNTRY = TABLES["country"]
_CAMP = _COUNTRY["camp"].split()


def _grow_things(placer: Placer, surfaces: Mapping[str, float], water_z_m: float | None) -> None:
    """Grow and strew what such ground has; `surfaces` are the arguments of the plan's surfaces."""
    site = placer.site
    areas = surface_areas(site, **surfaces, water_to_m=water_z_m)
    bare = shapely.union_all([areas[key] for key in ("sand", "snow", "rock", "wet")])
    free = {
        "grass": site.extent.difference(bare), "rock": areas["rock"].difference(areas["wet"]),
        "sand": areas["sand"].difference(areas["wet"]),
    }  # fmt: skip
    placer.begin("Landmarks, and a resting place on level grass")
    _landmarks(placer, water_z_m)
    for k, (x, y) in enumerate(_level_places(placer, free["grass"])):
        placer.place(_CAMP[k % len(_CAMP)], Pose(x, y, 37.0 * k))
    placer.begin("Trees, bushes and stones")
    for category, spacing, most, kind in _COUNTRY["growth"]:
        area = free[kind].intersection(site.extent.buffer(-1.5))
        for x, y, yaw in poisson_disc(area, spacing, site.rng_for("grow", category, kind), limit=most):
            placer.place(category, Pose(x, y, yaw), variant=DRAWN)


def _landmarks(placer: Placer, water_z_m: float | None) -> None:
    site = placer.site
    corners = site.terrain.corners()
    spots = corners[shapely.contains_xy(site.extent.buffer(-8.0), corners[:, 0], corners[:, 1])]
    for k, category in enumerate(_COUNTRY["landmarks"].split()):
        dry = spots if water_z_m is None else spots[spots[:, 2] > water_z_m + 1.0]
        if not len(dry):
            return
        x, y, _ = dry[int(np.argmax(dry[:, 2]))]
        placer.place(category, Pose(float(x), float(y), 90.0 * k), settle_m=1.0, variant=DRAWN)
        # The next one stands far from it.
        spots = spots[np.hypot(spots[:, 0] - x, spots[:, 1] - y) > 0.45 * max(site.head.size_m)]


def _level_places(placer: Placer, grass: BaseGeometry) -> list[tuple[float, float]]:
    site, ground = placer.site, placer.site.terrain
    inner = grass.intersection(site.extent.buffer(-4.0)).buffer(-1.0)
    spots = poisson_disc(inner, 14.0, site.rng_for("level"), limit=120)

    def tilt(pose: tuple[float, float, float]) -> float:
        x, y, _ = pose
        return float(abs(ground.z(x + 1, y) - ground.z(x - 1, y)) + abs(ground.z(x, y + 1) - ground.z(x, y - 1)))

    return [(x, y) for x, y, _ in sorted(spots, key=tilt)[: 2 * len(_CAMP)]]


def native_cell_m(dem: Dem, frame: LocalFrame | None) -> float:
    """Cell size of a model, metres, the larger of both axes."""
    if not dem.geographic:
        return max(dem.dx, dem.dy)
    east, north = (frame or LocalFrame(*dem.extent[:2])).metres_a_degree
    return max(dem.dx * east, dem.dy * north)


@dataclass(frozen=True)
class ReliefOptions:
    """Which part of a height model becomes a scene, and what its surface is."""

    bbox: Bbox | None = None
    size_m: tuple[float, float] | None = None
    cell_m: float | None = None
    water_m: float | None = None  # Up to this height, in the model's heights
    sand_m: float | None = None
    snow_m: float | None = None  # Above this height
    bare: bool = False  # Without plants, rocks and other things
    seed: int = 0
    ceiling_m: float | None = None
    attribution: str = ""


def relief_plan(dem: Dem, options: ReliefOptions) -> tuple[PlacePlan, list[str]]:
    """Make the plan of a relief, and notes for the user."""
    frame, middle, size = _place(dem, options)
    if not (min(size) >= SMALLEST_M and max(size) <= LARGEST_M):
        raise UsageError(
            f"{dem.path.name}: {size[0]:,.0f} by {size[1]:,.0f} m, a scene has {SMALLEST_M:g} to {LARGEST_M:,.0f} m: "
            f"--size 400 400 crops to its centre, --bbox to a part; {describe_coverage(dem)}"
        )
    cell = round(choose_cell(size, options.cell_m, native_cell_m(dem, frame)), 4)
    # Whole cells.
    width, depth = (round(max(int(s / cell + 1e-6), 1) * cell, 6) for s in size)
    size = width, depth
    table = HeightTable.of(grid(dem, size, cell, frame, middle), cell)
    top = float(table.rows_m.max())
    marks = {"water_m": options.water_m, "snow_from_m": options.snow_m, "sand_to_m": options.sand_m}
    surfaces = {key: round(value - table.datum_m, 2) for key, value in marks.items() if value is not None}
    water = surfaces.pop("water_m", None)
    surfaces["rock_slope"] = _ROCK_SLOPE
    if frame is None:
        origin = {"x_m": round(middle[0], 3), "y_m": round(middle[1], 3)}
        where = f"({middle[0]:,.2f}, {middle[1]:,.2f}) of the model"
    else:
        origin = {"lon_deg": round(frame.lon_deg, 7), "lat_deg": round(frame.lat_deg, 7)}
        where = f"{frame.lat_deg:.6f} N, {frame.lon_deg:.6f} E"
    plan = {
        "plan": 1, "seed": options.seed, "size_m": list(size),
        "ceiling_m": float(math.ceil(top + _HEADROOM_M)) if options.ceiling_m is None else options.ceiling_m,
        **({"attribution": options.attribution} if options.attribution else {}),
        "origin": origin | {"z_m": table.datum_m},
        "ground": {"material": "meadow:#7a9148", "steps": [{"make": "surveyed_heights"}]},
        "site": [
            {"make": "surveyed_surfaces", **surfaces},
            *([{"make": "water_over_low_ground", "to_m": water}] if water is not None else []),
        ],
    }  # fmt: skip
    notes = [
        f"heights every {cell:g} m ({2 * round(size[0] / cell) * round(size[1] / cell):,} triangles), "
        f"z = 0 is {table.datum_m:g} m, the highest point {top:.1f} m over it",
        f"x east, y north, metres about {where}",
    ]
    missing = int(np.isnan(dem.heights_m).sum())
    if missing:
        notes.append(
            f"{missing:,} of {dem.heights_m.size:,} heights of the file are nodata: filled with the nearest height"
        )
    comments = (f"Made by add-terrain of {dem.path.name}: {notes[0]}.", notes[1] + ".")

    def place_things(placer: Placer) -> None:
        if not options.bare:
            _grow_things(placer, surfaces, water)

    return PlacePlan(plan, {0: "What shows by slope and height"}, comments, table, place_things), notes


def _place(dem: Dem, options: ReliefOptions) -> tuple[LocalFrame | None, tuple[float, float], tuple[float, float]]:
    """Return the frame, centre and extent of the scene, on earth or in the model's metres."""
    bbox, size = options.bbox, options.size_m
    west, south, east, north = dem.extent
    middle = (west + east) / 2, (south + north) / 2
    if bbox is not None:
        return LocalFrame.about(bbox), (0.0, 0.0), size or size_m(bbox)
    if dem.geographic:
        return LocalFrame(*middle), (0.0, 0.0), size or size_m(dem.extent)
    return None, middle, size or (east - west, north - south)


def town_ground(dem: Dem, cell_m: float | None, frame: LocalFrame, size: tuple[float, float]) -> HeightTable:
    """Sample a town's ground."""
    cell = round(choose_cell(size, cell_m, native_cell_m(dem, frame)), 4)
    # Whole cells that cover the site: a town keeps the size of its bounding box.
    wide, deep = (math.ceil(s / cell / 2 - 1e-9) * 2 * cell for s in size)
    return HeightTable.of(grid(dem, (wide, deep), cell, frame, (0.0, 0.0)), cell)
