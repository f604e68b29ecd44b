"""Broken structure: what a damaged building is, what a collapse tears out of it, bared bars, hanging slabs, chunks.

Buildings are made in a frame of their own: the origin in the middle of the plan, x along its length, its front along
-y (south where its yaw is 0), z = 0 at the ground floor; see `ruins`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.grammar import Frame, leg, slab
from aerialdojo_gen.scenes.ground import polygons_of, rectangle, without
from aerialdojo_gen.scenes.kit.buildings import opened
from aerialdojo_gen.scenes.mesh import Floats, Mesh, merge, posed, rotation, translated
from aerialdojo_gen.scenes.plans.values import Material, Number
from aerialdojo_gen.scenes.shapes import box, crown, extrude, sweep, upright

XY = tuple[float, float]

_CORNERS = 26
_LEVEL_M = 0.55
_CRUMB_M2 = 0.4
_GRID_M = 0.01


@dataclass(frozen=True)
class Bite:
    """A round, ragged hole that a collapse left in a building; usually wider above than below.

    Its axis is in the building's frame, its radius `foot_m` at `z0_m`, below which nothing is torn, and `head_m` from
    `z1_m` on; the seed is that of its ragged edge.
    """

    x: Number
    y: Number
    foot_m: Number
    head_m: Number
    z0_m: Number = 0.4
    z1_m: Number = 15.0
    seed: int = 0

    def area(self, z_m: float) -> Polygon:
        """What is missing at a height, metres; empty below `z0_m`."""
        if z_m < self.z0_m:
            return Polygon()
        t = min((z_m - self.z0_m) / max(self.z1_m - self.z0_m, 1e-6), 1.0)
        wave = np.roll(_wave(self.seed), 3 * int(z_m // 3.0))
        r = (self.foot_m + t * (self.head_m - self.foot_m)) * wave
        angles = np.arange(_CORNERS) * 2 * np.pi / _CORNERS
        return Polygon(np.column_stack([self.x + r * np.cos(angles), self.y + r * np.sin(angles)]))

    def tear(self, a: XY, b: XY, top_m: float, rng: np.random.Generator) -> BaseGeometry:
        """What is missing of an upright wall from `a` to `b`: a polygon of (along, up) metres."""
        line = LineString([a, b])
        out: BaseGeometry = Polygon()
        left: list[XY] = []
        right: list[XY] = []
        for z in [*np.arange(self.z0_m, top_m + _LEVEL_M, _LEVEL_M), np.inf]:
            cut = line.intersection(self.area(float(z))) if np.isfinite(z) else LineString()
            if cut.is_empty:
                if len(left) > 1:
                    out = out.union(Polygon([*left, *right[::-1]]).buffer(0.0))
                left, right = [], []
                continue
            x0, y0, x1, y1 = cut.bounds
            ends = sorted(line.project(Point(p)) for p in ((x0, y0), (x1, y1), (x0, y1), (x1, y0)))
            # A tear that reaches a corner takes it along, and one that reaches the top leaves it open.
            u0 = -1.0 if ends[0] < 0.3 else ends[0] + rng.uniform(-0.3, 0.3)
            u1 = line.length + 1.0 if ends[-1] > line.length - 0.3 else ends[-1] + rng.uniform(-0.3, 0.3)
            up = float(z) if z + _LEVEL_M < top_m else top_m + 5.0
            left.append((float(u0), up))
            right.append((float(max(u1, u0 + 0.3)), up))
        return out


@lru_cache(maxsize=256)
def _wave(seed: int) -> Floats:
    rng = generator(seed, "bite")
    rough = rng.uniform(-0.2, 0.2, size=_CORNERS)
    slow = np.cos(np.arange(_CORNERS) * 2 * np.pi / _CORNERS * 3 + rng.uniform(0, 6.3))
    return np.asarray(1.0 + rough + 0.12 * slow)


def torn_wall(
    a: XY, b: XY, face: BaseGeometry, bites: Sequence[Bite], rng: np.random.Generator,
    openings: Sequence[tuple[float, float, float, float]] = (), thickness_m: float = 0.28,
) -> Mesh:  # fmt: skip
    """Make what is left of an upright wall: a mesh without a face where nothing stands.

    `a` and `b` are the ends of its middle line, `face` is the whole wall as (along, up) in metres, openings are
    (from, to, sill, head).
    """
    top = face.bounds[3]
    face = without(opened(face, openings), [bite.tear(a, b, top, rng) for bite in bites])
    # Tears and openings that all but touch leave slivers that cannot be triangulated.
    pieces = [p for p in polygons_of(shapely.set_precision(face, _GRID_M)) if p.area >= _CRUMB_M2]
    return posed(upright(pieces, thickness_m), rotation(0.0, 0.0, leg(a, b)[1]), (*a, 0.0))


def torn_floor(plan: Polygon, top_m: float, bites: Sequence[Bite], thickness_m: float = 0.25) -> Mesh:
    """Make what is left of a floor whose top lies at `top_m`."""
    pieces = [p for p in polygons_of(remains(plan, top_m, bites)) if p.area > 1.0]
    return merge([slab(p, top_m - thickness_m, top_m) for p in pieces])


def remains(plan: Polygon, z_m: float, bites: Sequence[Bite]) -> BaseGeometry:
    """Work out what of a plan is left at a height."""
    return without(plan, [bite.area(z_m) for bite in bites])


def broken_edge(plan: Polygon, z_m: float, bites: Sequence[Bite]) -> list[tuple[XY, float]]:
    """List points of a floor's broken edge, and the direction (degrees) that looks out into the gap from there."""
    left = remains(plan, z_m, bites)
    inner = plan.buffer(-0.3)
    out: list[tuple[XY, float]] = []
    for bite in bites:
        for piece in polygons_of(left):
            edge = piece.exterior.intersection(bite.area(z_m).boundary.buffer(0.02)).intersection(inner)
            for line in getattr(edge, "geoms", [edge]):
                for s in np.arange(0.4, line.length, 0.8):
                    p = line.interpolate(s)
                    yaw = math.degrees(math.atan2(bite.y - p.y, bite.x - p.x))
                    out.append(((float(p.x), float(p.y)), yaw))
    return out


def bars(at: XY, z_m: float, yaw_deg: float, rng: np.random.Generator, reach_m: float = 0.9) -> Mesh:
    """Make one bent reinforcement bar that sticks out of a broken edge."""
    c, s = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    r, droop = reach_m * float(rng.uniform(0.5, 1.2)), float(rng.uniform(-0.5, 0.15))
    side = float(rng.uniform(-0.3, 0.3))
    path = [
        (at[0] - 0.15 * c, at[1] - 0.15 * s, z_m),
        (at[0] + 0.55 * r * c, at[1] + 0.55 * r * s, z_m + 0.2 * droop),
        (at[0] + r * c - side * s, at[1] + r * s + side * c, z_m + droop),
    ]
    return sweep(path=path, radius=0.025, sides=3)


def hanging_slab(at: XY, top_m: float, yaw_deg: float, rng: np.random.Generator) -> Mesh:
    """Make a piece of floor that hangs from a broken edge by its bars, steeply down."""
    width, length = float(rng.uniform(1.2, 2.6)), 2.4 * float(rng.uniform(0.7, 1.1))
    ragged = Polygon(
        [(0, -width / 2), (length * 0.9, -width / 2 + 0.1), (length, -width * 0.1), (length * 0.8, width * 0.2),
         (length * 0.92, width / 2), (0, width / 2)]
    )  # fmt: skip
    plate = translated(extrude(ragged, 0.22), (0, 0, -0.22))
    turn = rotation(0.0, float(rng.uniform(48, 78)), yaw_deg)
    return posed(plate, turn, (*at, top_m))


def tilted_plate(
    size_m: tuple[float, float], thickness_m: float, at: tuple[float, float, float],
    tilt_deg: tuple[float, float], yaw_deg: float, rng: np.random.Generator,
) -> Mesh:  # fmt: skip
    """Make a broken plate with ragged ends about `at` (middle of its top), turned about x and y, then z."""
    x, y = size_m[0] / 2, size_m[1] / 2
    side = np.linspace(-y, y, 5)
    right = [(x * float(rng.uniform(0.82, 1.08)), float(v)) for v in side]
    left = [(-x * float(rng.uniform(0.82, 1.08)), float(v)) for v in side[::-1]]
    plate = translated(extrude(Polygon([*right, *left]), thickness_m), (0, 0, -thickness_m))
    return posed(plate, rotation(tilt_deg[0], tilt_deg[1], yaw_deg), at)


def chunk(kind: str, size_m: float, rng: np.random.Generator) -> Mesh:
    """Make a loose piece about the origin, a third of it below z = 0.

    The kind is ``"slab"``, ``"lump"``, ``"beam"`` or ``"brick"``, about `size_m` long.
    """
    f = rng.uniform(0.7, 1.2, size=3)
    if kind == "lump":
        radii = [0.5 * size_m * f[0], 0.5 * size_m * f[1], 0.32 * size_m * f[2]]
        return crown(radii=radii, noise=0.35, subdivisions=0, seed=int(rng.integers(1000)))
    sizes = {
        "slab": [size_m * f[0], 0.65 * size_m * f[1], 0.18],
        "beam": [1.4 * size_m * f[0], 0.2, 0.24],
        "brick": [0.45 * size_m * f[0], 0.25, 0.3 * size_m * f[2]],
    }
    body = box(size=sizes[kind], taper=(float(rng.uniform(0.8, 1.0)), 1.0))
    tilt = (float(rng.uniform(-28, 28)), float(rng.uniform(-24, 24)), float(rng.uniform(0, 360)))
    return posed(body, rotation(*tilt), (0, 0, -0.03))


@dataclass(frozen=True)
class Style:
    """What a building looks like."""

    wall: Material = "plaster:#cfc3ab"
    band: Material = "concrete"  # Of sills and balconies
    floor: Material = "concrete"  # Of the floors' edges and undersides
    inner: Annotated[tuple[Material, ...], Field(min_length=4)] = (
        "plaster:#b9c7b0", "plaster:#c9b0a0", "plaster:#a9b6c4", "plaster:#d3c79a",
    )  # fmt: skip
    roof: Material = "gravel:#8f8a82"
    storey_m: Annotated[Number, Field(ge=2, le=20)] = 3.1
    bay_m: Annotated[Number, Field(ge=1, le=50)] = 3.4
    window_m: tuple[Number, Number, Number] = (1.5, 0.9, 2.3)  # Width, sill and head
    wall_m: Annotated[Number, Field(ge=0.05, le=2)] = 0.28
    columns: bool = True  # Whether a frame of columns carries the floors
    shops: bool = False  # Wide shop windows in the ground storey of the front
    panes: Number = 0.55  # Shares of the windows that kept their panes, and that have a plume of soot above
    soot: Number = 0.0


@dataclass(frozen=True)
class Wreck:
    """A damaged building."""

    frame: Frame
    length_m: float
    depth_m: float
    storeys: int
    style: Style = field(default_factory=Style)
    bites: tuple[Bite, ...] = ()  # In its own frame
    ridge_m: float = 0.0  # Height of a pitched roof's ridge over the eaves; 0 makes a flat roof
    rooms_m: float = 6.8  # Distance of the partitions across it

    @property
    def plan(self) -> Polygon:
        """Its outline in its own frame, metres."""
        x, y = self.length_m / 2, self.depth_m / 2
        return rectangle(-x, -y, x, y)

    @property
    def height_m(self) -> float:
        """Height of the eaves, metres."""
        return self.storeys * self.style.storey_m

    def bears(self, x: float, y: float, storey: int) -> bool:
        """Whether a floor (`storeys`: the roof) is there at a point of its own frame."""
        floor = remains(self.plan, storey * self.style.storey_m, self.bites)
        return bool(floor.buffer(-0.02).contains(Point(x, y)))
