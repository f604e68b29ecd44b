"""A thing of the catalogue and where it goes, outlines on the ground, and how things stand on ground that slopes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.scenes.catalogue import single
from aerialdojo_gen.scenes.mesh import Mesh, areas, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import extrude

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


Floats = NDArray[np.float64]
# Heights of the ground at points: x and y, metres.
Heights = Callable[[Floats, Floats], Floats]

CONTACT_M = 0.05  # a gap that the eye does not see
_FOOT_M = 0.03  # a thing's feet are so near to its lowest point
_SUNK_M = 0.015  # what is let down is so deep in the ground, or its edge would show light
_LET_DOWN_M = 0.25  # more would bury the door of a booth
_STEEPEST_DEG = 18.0
_SLENDER = 1.7  # times as high as its narrow side: poles and booths stay upright
_MIN_M = 0.35  # a smaller foot is let down
_BURIED_M = 0.15  # a vehicle whose wheels are deeper in the ground leans as well
_BURIED_SHARE = 0.4  # no more of a thing's height goes into the ground
_PLINTH_M = 8.0  # longer things than this span: no block is put under them
_ELSEWHERE_M = 4.0  # what is so far off the ground stands on something else, or over an edge
# They stand level whatever the ground does.
_LEVEL = frozenset({"building", "landmark"})


def rest_on_ground(instance: Instance, kind: str, ground: Heights) -> tuple[Instance, Mesh | None]:
    """Bring a thing into contact with the ground, and give it a plinth where nothing less does.

    The kind is that of its category: buildings and landmarks stand level, plants upright. It is the same one where it
    touches the ground already, or stands on something else; the plinth reaches from its feet into the ground.
    """
    feet = _feet(instance)
    gaps = _gaps(instance, feet, ground)
    leans = _leans(instance, kind, feet)
    touches = float(gaps.max()) <= CONTACT_M and not (leans and float(gaps.min()) < -_BURIED_M)
    if touches or float(gaps.min()) > CONTACT_M or float(np.abs(gaps).max()) > _ELSEWHERE_M:
        return instance, None
    if leans:
        instance = _leaning(instance, feet, ground)
        gaps = _gaps(instance, feet, ground)
    gap = float(gaps.max())
    if gap <= CONTACT_M:
        return instance, None
    long, wide, high = np.ptp(instance.bounds, axis=0).tolist()
    if gap > _LET_DOWN_M and not leans and kind != "vegetation" and max(long, wide) <= _PLINTH_M:
        return instance, _plinth(instance.vertices[feet], ground)
    down = np.array([0.0, 0.0, -min(gap + _SUNK_M, _BURIED_SHARE * high)])
    return _moved(instance, lambda v: v + down), None


def _feet(instance: Instance) -> NDArray[np.int64]:
    """Indices of the outermost of a thing's lowest vertices, in sixteen directions."""
    vertices = instance.vertices
    low = np.flatnonzero(vertices[:, 2] <= vertices[:, 2].min() + _FOOT_M)
    turns = np.arange(16) * (math.pi / 8.0)
    reach = vertices[low, :1] * np.cos(turns) + vertices[low, 1:2] * np.sin(turns)
    return np.unique(low[np.argmax(np.round(reach, 6), axis=0)])


def _gaps(instance: Instance, feet: NDArray[np.int64], ground: Heights) -> Floats:
    """Gaps (n,) between feet and ground, metres: negative where they are in it."""
    x, y, z = instance.vertices[feet].T
    return np.round(z - ground(x, y), 6)


def _leans(instance: Instance, kind: str, feet: NDArray[np.int64]) -> bool:
    if kind in _LEVEL or kind == "vegetation":
        return False
    high = float(np.ptp(instance.bounds[:, 2]))
    # Whichever way it faces.
    foot, shorter_side = _shorter_side(instance.vertices[feet]), _shorter_side(instance.vertices)
    low = high <= _SLENDER * shorter_side
    if kind == "vehicle":
        # A boat on land lies on its keel.
        return foot >= _MIN_M or (low and shorter_side >= _MIN_M)
    return foot >= _MIN_M and low


def _shorter_side(points: Floats) -> float:
    """Shorter side of the smallest rectangle about points (n, 3) seen from above, metres."""
    around = shapely.minimum_rotated_rectangle(shapely.multipoints(np.round(points[:, :2], 4)))
    if around.geom_type != "Polygon":
        return 0.0
    return float(norm(np.diff(shapely.get_coordinates(around)[:3], axis=0)).min())


def _leaning(instance: Instance, indices: NDArray[np.int64], ground: Heights) -> Instance:
    """Turn a thing about a level axis, so that its feet follow the ground's slope."""
    feet = instance.vertices[indices]
    x, y = (feet[:, k] - feet[:, k].mean() for k in (0, 1))
    z = ground(feet[:, 0], feet[:, 1])
    xx, yy, xy = float((x * x).sum()), float((y * y).sum()), float((x * y).sum())
    xz, yz = float((x * z).sum()), float((y * z).sum())
    apart = xx * yy - xy * xy
    if apart <= 1e-9:
        return instance
    east, north = (xz * yy - yz * xy) / apart, (yz * xx - xz * xy) / apart
    slope = math.sqrt(east * east + north * north)
    if slope < 1e-6:
        return instance
    angle = min(math.atan(slope), math.radians(_STEEPEST_DEG))
    up_x, up_y = round(east / slope, 9), round(north / slope, 9)
    sin, cos = round(math.sin(angle), 9), round(math.cos(angle), 9)
    about = np.array([feet[:, 0].mean(), feet[:, 1].mean(), feet[:, 2].min()])

    def turned(v: Floats) -> Floats:
        d = v - about
        ahead = d[:, 0] * up_x + d[:, 1] * up_y  # up the slope
        shift = ahead * (cos - 1.0) - d[:, 2] * sin
        return about + np.column_stack([d[:, 0] + shift * up_x, d[:, 1] + shift * up_y, d[:, 2] * cos + ahead * sin])

    lift = float(z.mean()) - float(about[2])
    return _moved(instance, lambda v: turned(v) + np.array([0.0, 0.0, round(lift, 6)]))


def _moved(instance: Instance, move: Callable[[Floats], Floats]) -> Instance:
    parts = tuple(replace(part, vertices=single(move(part.vertices))) for part in instance.parts)
    # Rounded to float32, a sliver may have lost its area: such a thing stays where it is.
    if not all((areas(part.vertices, part.faces) > 0.0).all() for part in parts):
        return instance
    return replace(instance, parts=parts)


def _plinth(feet: Floats, ground: Heights) -> Mesh:
    """A block from the feet into the ground."""
    outline = shapely.convex_hull(shapely.multipoints(np.round(feet[:, :2], 4))).buffer(0.04, join_style="mitre")
    edge = np.asarray(outline.exterior.coords)
    bottom = float(ground(edge[:, 0], edge[:, 1]).min()) - 0.2
    top = float(feet[:, 2].min()) + 0.01
    return translated(extrude(outline, top - bottom), (0.0, 0.0, bottom))
