"""Conversion between longitude and latitude and local metres."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.errors import UsageError

Floats = NDArray[np.float64]
Bbox = tuple[float, float, float, float]
"""West, south, east, north, degrees, WGS 84."""

# WGS 84 ellipsoid.
_A_M, _E2 = 6_378_137.0, 0.00669437999014
_POLE_DEG = 85.0


@dataclass(frozen=True)
class LocalFrame:
    """Metres east and north of an origin, in the tangent plane; accurate to a millimetre within 1 km."""

    lon_deg: float  # The origin, WGS 84
    lat_deg: float

    @classmethod
    def about(cls, bbox: Bbox) -> LocalFrame:
        """Make the frame at a bounding box's centre."""
        west, south, east, north = bbox
        return cls((west + east) / 2, (south + north) / 2)

    @property
    def metres_a_degree(self) -> tuple[float, float]:
        """Length of a degree of longitude and of latitude at the origin, metres."""
        s = math.sin(math.radians(self.lat_deg))
        w = 1.0 - _E2 * s * s
        east = _A_M / math.sqrt(w) * math.cos(math.radians(self.lat_deg))
        north = _A_M * (1.0 - _E2) / w**1.5
        return math.radians(east), math.radians(north)

    def metres(self, lon: ArrayLike, lat: ArrayLike) -> tuple[Floats, Floats]:
        """X and y of points, metres."""
        east, north = self.metres_a_degree
        x = (np.asarray(lon, dtype=np.float64) - self.lon_deg) * east
        return x, (np.asarray(lat, dtype=np.float64) - self.lat_deg) * north

    def degrees(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Longitude and latitude of points, degrees."""
        east, north = self.metres_a_degree
        lon = self.lon_deg + np.asarray(x, dtype=np.float64) / east
        return lon, self.lat_deg + np.asarray(y, dtype=np.float64) / north


def check_bbox(bbox: Bbox) -> Bbox:
    """Raise a `UsageError` if a bounding box is invalid."""
    west, south, east, north = bbox
    text = " ".join(f"{v:g}" for v in bbox)
    if not all(math.isfinite(v) for v in bbox) or not (west < east and south < north):
        raise UsageError(
            f"--bbox {text}: must be WEST SOUTH EAST NORTH, degrees, west below east and south below north"
        )
    if not (west >= -180 and east <= 180 and south >= -_POLE_DEG and north <= _POLE_DEG):
        raise UsageError(
            f"--bbox {text}: degrees of longitude reach from -180 to 180, of latitude here from -{_POLE_DEG:g} to "
            f"{_POLE_DEG:g}; WEST SOUTH EAST NORTH is the order"
        )
    return bbox


def size_m(bbox: Bbox) -> tuple[float, float]:
    """Width and depth of a bounding box, metres."""
    frame = LocalFrame.about(bbox)
    (x0, x1), (y0, y1) = frame.metres((bbox[0], bbox[2]), (bbox[1], bbox[3]))
    return float(x1 - x0), float(y1 - y0)


def tile_bboxes(bbox: Bbox, tile_m: float) -> list[Bbox]:
    """Split a bounding box into squares, row by row from the south-west corner; the remainder is dropped."""
    wide, deep = size_m(bbox)
    east, north = LocalFrame.about(bbox).metres_a_degree
    nx, ny = (int(s / tile_m + 1e-3) for s in (wide, deep))
    if not nx or not ny:
        raise UsageError(f"--tiles {tile_m:g}: the bounding box is {wide:,.0f} by {deep:,.0f} m, smaller than a tile")
    dx, dy = tile_m / east, tile_m / north
    west, south = bbox[:2]
    return [
        (west + i * dx, south + j * dy, west + (i + 1) * dx, south + (j + 1) * dy)
        for j in range(ny)
        for i in range(nx)
    ]


def format_bbox(bbox: Bbox) -> str:
    """Format a bounding box as ``--bbox`` takes it."""
    return " ".join(f"{v:.4f}" for v in bbox)
