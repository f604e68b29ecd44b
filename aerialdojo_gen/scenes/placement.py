"""A thing of the catalogue and where it goes, which `Site.place` takes; outlines on the ground and what they take."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.model import Instance

# Where there is no room: placed all the same, left out, an error.
Fit = Literal["as_is", "skip", "must"]
# In place of a variant: the thing draws it.
DRAWN = "*"


@dataclass(frozen=True)
class Placement:
    """A prop of the catalogue, and where it goes."""

    category: str
    x: float  # Metres, world frame
    y: float
    yaw_deg: float = 0.0  # Direction of its front, counter-clockwise from +x
    variant: str | None = None  # The one used least so far where absent
    z: float | None = None  # Height of its foot; on the ground where absent
    place: str = ""  # Where it is, in words
    node: str | None = None  # The next free one of the category where absent
    design: str | None = None  # One of the scene's side, drawn for the node, where absent
    scale: float = 1.0
    stretch: tuple[float, float, float] | None = None  # Factors along its own axes, beside its design's
    params: Mapping[str, float] | None = None
    roles: Mapping[str, str] | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)
    solid: bool = True  # Whether it takes the ground that it stands on
    settle_m: float | None = None  # On a slope it stands between the heights about a foot of this radius, metres
    # Kept free of what follows: a disc about it, so much about its rectangle, so much about its outline.
    clear_m: float = 0.0
    margin_m: float = 0.0
    room_m: float = 0.0


_CELL_M = 10.0
# Parts higher than this above a prop's base (a tree's crown, a lamp's arm) have no footprint.
_REACH_M = 2.5


class Footprints:
    """Occupied areas, each over a range of heights, in a grid of buckets."""

    def __init__(self) -> None:
        self._buckets: dict[tuple[int, int], list[tuple[BaseGeometry, float, float]]] = {}

    def add(self, area: BaseGeometry, z0_m: float, z1_m: float) -> None:
        """Occupy an area (world frame) between two heights, metres."""
        shapely.prepare(area)
        for cell in _cells(area.bounds):
            self._buckets.setdefault(cell, []).append((area, z0_m, z1_m))

    def is_free(self, area: BaseGeometry, z0_m: float, z1_m: float) -> bool:
        """Whether the area is unoccupied between two heights, metres."""
        for cell in _cells(area.bounds):
            for taken, low, high in self._buckets.get(cell, ()):
                if low < z1_m and high > z0_m and taken.intersects(area):
                    return False
        return True


def footprint(instance: Instance, base_z_m: float) -> BaseGeometry:
    """Outline on the ground: the convex hull of what is less than 2.5 m above `base_z_m`, or of all if nothing is."""
    v = instance.vertices
    low = v[v[:, 2] < base_z_m + _REACH_M]
    return hull((low if len(low) else v)[:, :2])


def hull(xy: NDArray[np.float64]) -> BaseGeometry:
    """Convex hull of points (n, 2)."""
    # As a line: hundreds of points in a collection are hundreds of objects.
    line: BaseGeometry = shapely.linestrings(xy) if len(xy) > 1 else Point(xy[0])
    return line.convex_hull


def disc(x: float, y: float, radius_m: float) -> BaseGeometry:
    """Round area about a point."""
    return Point(x, y).buffer(radius_m, quad_segs=4)


def _cells(bounds: tuple[float, float, float, float]) -> Iterator[tuple[int, int]]:
    x0, y0, x1, y1 = (int(b // _CELL_M) for b in bounds)
    for i in range(x0, x1 + 1):
        for j in range(y0, y1 + 1):
            yield i, j
