"""Stands of sports grounds: stepped tiers round any front edge, with seats, gangways, walls, platforms and roofs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import Point as ShapelyPoint
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar import Frame, Pose, plates
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.structures import block, letters
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, mesh, posed, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, Areas, At, Bodies, Material, Materials, Number
from aerialdojo_gen.scenes.shapes import box, sweep
from aerialdojo_gen.scenes.site import Site

SEAT_M = 0.6
AISLE_M = 1.2
QUARTER = 8
_PARAPET_M = 0.95


@dataclass(frozen=True)
class Tier:
    """Rows of steps round a front edge; every row lies one tread farther out and one riser higher than the last."""

    core: Area  # Its outline, grown by `front_m` with round corners, is the front edge
    front_m: Number  # Distance from the core to the front edge
    rows: Annotated[int, Field(ge=1, le=60)]
    z_m: Number  # Height of the first row
    foot_m: Number = 0.0  # Where the front wall stands
    tread_m: Annotated[Number, Field(ge=0.3)] = 0.85  # Depth of a row
    riser_m: Annotated[Number, Field(ge=0.1)] = 0.42  # Height of a row over the last
    region: Area | None = None  # Only what lies in it is built
    portals: Areas = field(default_factory=list)  # Passages from front to back
    head_m: Number = 3.2  # Rows lower than this leave the portals open

    def __post_init__(self) -> None:
        if not isinstance(self.edge(0), Polygon) or self.edge(0).is_empty:
            raise ValueError("the front edge of a tier must enclose one area")

    def edge(self, row: float) -> Polygon:
        """Outline of what lies in front of a row, metres."""
        return self.core.buffer(self.front_m + row * self.tread_m, quad_segs=QUARTER)

    def level_m(self, row: int) -> float:
        """Height of a row, metres."""
        return self.z_m + row * self.riser_m

    def band(self, row: int) -> BaseGeometry:
        """Plan of a row, without the portals that cut it."""
        return self.within(self.edge(row + 1).difference(self.edge(row)))

    def is_cut(self, row: int) -> bool:
        """Whether portals cut a row."""
        return self.level_m(row) < self.head_m + 0.6

    @property
    def plan(self) -> BaseGeometry:
        """Ground under all rows."""
        return self.within(self.edge(self.rows).difference(self.edge(0)))

    def within(self, area: BaseGeometry) -> BaseGeometry:
        """What of an area is built: that in the region."""
        return area if self.region is None else area.intersection(self.region)


@dataclass(frozen=True)
class Stripes:
    """How the colours of seats follow one another in turn: by stripes over the plan, and by blocks of rows."""

    along: tuple[Number, Number] = (1.0, 1.0)  # Weights of x and y; the stripes run across this direction
    width_m: Annotated[Number, Field(ge=0.1)] = 6.0
    shift_m: Number = 0.0  # By how much the stripes move on in every row
    block: Annotated[int, Field(ge=1)] = 1000  # Rows after which the colours change

    def number(self, x: float, y: float, row: int) -> int:
        """Count the stripes up to a seat."""
        stripe = (self.along[0] * x + self.along[1] * y + self.shift_m * row) // self.width_m
        return int(stripe) + row // self.block


_STRIPES = Stripes()


@site_builder
def stand(
    site: Site, *, tier: Tier, seats: Materials, node: str | None = None,
    stripes: Stripes = _STRIPES, gangway_m: Annotated[Number, Field(ge=2.0)] = 8.2, clear: Area | None = None,
    concrete: Material = "concrete", step: Material = "concrete", more: Bodies | None = None,
) -> None:  # fmt: skip
    """Put up a tier of a stand, gangways `gangway_m` apart; no seats stand in `clear`, and `more` belongs to it."""

    def colour(x: float, y: float, row: int) -> str:
        return seats[stripes.number(x, y, row) % len(seats)]

    parts = tier_parts(tier, gangways(tier, gangway_m), concrete=concrete, step=step, seat=colour, clear=clear)
    plan = tier.plan.difference(unary_union(tier.portals))
    site.add(node, "grandstand", parts + (more or []), {"material": "concrete"}, footprint=plan)


def gangways(tier: Tier, spacing_m: float) -> list[Pose]:
    """List the feet of gangways along the front edge about `spacing_m` apart, each facing up its tier."""
    ring = tier.edge(0)
    line = ring.exterior
    count = max(round(line.length / spacing_m), 1)
    out = []
    for k in range(count):
        s = line.length * (k + 0.5) / count
        p, q = line.interpolate(s - 0.05), line.interpolate(s + 0.05)
        yaw = math.degrees(math.atan2(q.y - p.y, q.x - p.x)) + 90.0
        ahead = (p.x + 0.3 * np.cos(np.radians(yaw)), p.y + 0.3 * np.sin(np.radians(yaw)))
        if ring.contains(ShapelyPoint(ahead)):
            yaw += 180.0
        x, y = (p.x + q.x) / 2, (p.y + q.y) / 2
        if tier.region is None or tier.region.buffer(-AISLE_M / 2).contains(ShapelyPoint(x, y).buffer(0.01)):
            out.append(Pose(float(x), float(y), yaw))
    return out


def passage(foot: Pose, width_m: float, length_m: float) -> Polygon:
    """Make a rectangle that leads from a front edge outwards, beginning half a metre before it."""
    area = Frame(foot.x, foot.y, foot.yaw_deg).area(rectangle(-0.5, -width_m / 2, length_m, width_m / 2))
    return Polygon(area.exterior)


def tier_parts(
    tier: Tier, feet: Sequence[Pose], *, concrete: str, step: str, seat: Callable[[float, float, int], str],
    clear: BaseGeometry | None = None,
) -> Parts:  # fmt: skip
    """Make a tier: steps, a front wall with a parapet, walls along portals, half steps in gangways, and seats.

    `feet` are those of gangways, from `gangways`; ``seat(x, y, row)`` gives a seat's material; none stands in
    `clear`.
    """
    holes = unary_union(tier.portals) if tier.portals else Polygon()
    bodies: list[Mesh] = []
    for row in range(tier.rows):
        area, top = tier.band(row), tier.level_m(row)
        if tier.is_cut(row):
            cheeks = unary_union([p.buffer(0.22, join_style="mitre") for p in tier.portals]).difference(holes)
            bodies.append(plates(area.intersection(cheeks), tier.foot_m, top + 0.8))
            area = area.difference(holes)
        elif row and tier.is_cut(row - 1):
            lip = tier.edge(row + 0.25).difference(tier.edge(row)).intersection(holes)
            bodies.append(plates(lip.intersection(area), top - 0.2, top + 0.9))
        bodies.append(plates(area, top - tier.riser_m - 0.22, top))
    front = tier.within(tier.edge(0.0).difference(tier.core.buffer(tier.front_m - 0.22, quad_segs=QUARTER)))
    walls = plates(front.difference(holes), tier.foot_m, tier.z_m + _PARAPET_M)
    parts: Parts = [(concrete, merge(bodies)), (step, merge([walls, *_half_steps(tier, feet, holes)]))]
    return parts + _seats(tier, feet, holes, seat, Polygon() if clear is None else clear)


def _half_steps(tier: Tier, feet: Sequence[Pose], holes: BaseGeometry) -> list[Mesh]:
    out = []
    for foot in feet:
        frame = Frame(foot.x, foot.y, foot.yaw_deg)
        for row in range(tier.rows - 1):
            at = frame.at((row + 0.75) * tier.tread_m, 0.0)
            if tier.is_cut(row) and shapely.contains_xy(holes.buffer(AISLE_M / 2), *at):
                continue
            tread = box(size=(tier.tread_m / 2, AISLE_M, tier.riser_m / 2))
            step = translated(tread, ((row + 0.75) * tier.tread_m, 0, 0))
            out.append(posed(step, rotation(0.0, 0.0, frame.yaw_deg), (frame.x, frame.y, tier.level_m(row))))
    return out


def _seats(
    tier: Tier, feet: Sequence[Pose], holes: BaseGeometry, seat: Callable[[float, float, int], str],
    clear: BaseGeometry,
) -> Parts:  # fmt: skip
    aisles = [passage(f, AISLE_M + SEAT_M, (tier.rows + 1) * tier.tread_m) for f in feet]
    shut = unary_union([*aisles, clear])
    # Beside a portal the seats keep off its cheeks, over it they stand as everywhere.
    low = shut.union(holes.buffer(0.6))
    inside = tier.region.buffer(-0.35) if tier.region is not None else tier.edge(tier.rows)
    for area in (shut, low, inside):
        shapely.prepare(area)
    places: dict[str, list[tuple[float, float, float, float]]] = {}
    for row in range(tier.rows):
        line = tier.edge(row + 0.62).exterior
        count = int(line.length // SEAT_M)
        for k in range(count):
            s = line.length * k / count
            p = line.interpolate(s)
            if not shapely.contains_xy(inside, p.x, p.y):
                continue
            if shapely.contains_xy(low if tier.is_cut(row) else shut, p.x, p.y):
                continue
            q = line.interpolate((s + 0.1) % line.length)
            yaw = math.atan2(q.y - p.y, q.x - p.x)
            places.setdefault(seat(p.x, p.y, row), []).append((p.x, p.y, tier.level_m(row), yaw))
    # Shapely's outlines run clockwise, so that outwards lies to the left of the way.
    back = translated(box(size=(0.44, 0.06, 0.46), taper=(0.85, 1.0)), (0.0, 0.13, 0.36))
    one = merge([back, translated(box(size=(0.44, 0.34, 0.43), taper=(1.0, 0.9)), (0.0, -0.09, 0.0))])
    return [(material, _copies(one, np.array(where))) for material, where in sorted(places.items())]


def _copies(body: Mesh, where: np.ndarray) -> Mesh:
    """Copy a mesh to (n, 4) places: x, y, z in metres and yaw in radians."""
    c, s = np.cos(where[:, 3])[:, None], np.sin(where[:, 3])[:, None]
    x, y, z = body.vertices.T
    across, ahead = where[:, :1] + c * x - s * y, where[:, 1:2] + s * x + c * y
    placed = np.stack([across, ahead, where[:, 2:3] + z[None]], axis=2)
    offsets = np.arange(len(where)) * len(body.vertices)
    return mesh(placed.reshape(-1, 3), (body.faces[None] + offsets[:, None, None]).reshape(-1, 3))


@part_builder
def stand_ends(*, tier: Tier, strips: Areas, material: Material) -> Parts:
    """Close a tier's ends: stepped walls in strips across its rows, up to a handrail's height over each."""
    rows = range(tier.rows)
    bodies = [plates(tier.band(k).intersection(s), tier.foot_m, tier.level_m(k) + 0.8) for s in strips for k in rows]
    return [(material, merge(bodies))]


@part_builder
def stand_back_wall(
    *, tier: Tier, top_m: Number, gates: list[tuple[Number, Number, Number]], gate_m: tuple[Number, Number],
    wall: Material, band: Material, thickness_m: Number = 0.3,
) -> Parts:  # fmt: skip
    """Make the outer wall behind a tier's last row, with a cornice, and gateways that one can fly through.

    Gates are (x, y, direction outwards), just inside the wall; their size is (width, height).
    """
    passages = [passage(Pose(*gate), gate_m[0], 3.0) for gate in gates]
    back = tier.edge(tier.rows)
    ring = tier.within(back.buffer(thickness_m, join_style="mitre").difference(back))
    cornice = tier.within(back.buffer(thickness_m + 0.2, join_style="mitre").difference(back))
    openings = unary_union(passages)
    walls = [plates(ring.difference(openings), tier.foot_m, top_m),
             plates(ring.intersection(openings), tier.foot_m + gate_m[1], top_m)]  # fmt: skip
    frames = unary_union([g.buffer(0.25, join_style="mitre").difference(g) for g in passages]).intersection(cornice)
    trims = [plates(cornice, top_m - 0.45, top_m + 0.12),
             plates(frames.difference(openings), tier.foot_m, tier.foot_m + gate_m[1])]  # fmt: skip
    return [(wall, merge(walls)), (band, merge(trims))]


@part_builder
def stand_walkway(*, tier: Tier, depth_m: Number, thickness_m: Number = 0.35, material: Material) -> Parts:
    """Lay a level walkway before a tier's front edge, at the height of its foot."""
    before = tier.core.buffer(tier.front_m - depth_m, quad_segs=QUARTER)
    area = tier.within(tier.edge(0).difference(before))
    return [(material, plates(area, tier.foot_m - thickness_m, tier.foot_m))]


@part_builder
def stand_platforms(*, areas: Areas, z: tuple[Number, Number], floor: Material, rim: Material) -> Parts:
    """Make level platforms among the rows, between two heights, with a low rim on which nothing is hung."""
    parts: Parts = []
    for area in areas:
        inner = area.buffer(-0.12, join_style="mitre")
        parts += [(floor, plates(area, *z)), (rim, plates(area.difference(inner), z[1], z[1] + 0.12))]
    return parts


@part_builder
def cantilever_roof(
    *, at: At, yaw_deg: Number, size_m: tuple[Number, Number], z_m: Number, roof: Material, truss: Material,
    fascia: Material, foot_m: Number = 0.0, bay_m: Annotated[Number, Field(ge=1.0)] = 6.0, rise_m: Number = 2.4,
) -> Parts:  # fmt: skip
    """Make a level roof of (length, depth), its underside at `z_m`, that hangs from cantilevered trusses above it.

    `at` is the middle of its back edge, where the columns stand on `foot_m`; it reaches forward along `yaw_deg`.
    """
    length_m, depth_m = size_m
    half = length_m / 2
    top = z_m + 0.22
    deck = block(0.0, -half, depth_m, half, z_m, top)
    band = [block(depth_m - 0.1, -half, depth_m + 0.12, half, z_m - 0.25, top + 0.55)]
    band += [block(0.0, v - 0.1, depth_m, v + 0.1, z_m - 0.1, top + 0.2) for v in (-half, half)]
    bars = []
    count = max(round(length_m / bay_m), 1)
    for k in range(count + 1):
        v = -half + 0.5 + (length_m - 1.0) * k / count
        bars.append(block(0.2, v - 0.2, 0.7, v + 0.2, foot_m, top + rise_m))
        head, nose = (0.45, v, top + rise_m - 0.1), (depth_m - 0.3, v, top + 0.35)
        bars.append(sweep(path=[head, nose], section=(0.16, 0.22)))
        bars.append(sweep(path=[(0.45, v, top + 0.1), (depth_m - 0.2, v, top + 0.1)], section=(0.14, 0.2)))
        for j in range(1, 5):
            u = 0.45 + (depth_m - 0.75) * j / 5
            z = top + rise_m - 0.1 + (0.45 - rise_m) * j / 5
            before = 0.45 + (depth_m - 0.75) * (j - 1) / 5
            bars.append(sweep(path=[(before, v, top + 0.1), (u, v, z)], section=(0.09, 0.09)))
            bars.append(block(u - 0.05, v - 0.05, u + 0.05, v + 0.05, top, z))
    beams = [block(u - 0.08, -half, u + 0.08, half, z_m - 0.22, z_m) for u in np.linspace(0.6, depth_m - 0.5, 4)]
    parts = [(roof, deck), (fascia, merge(band)), (truss, merge([*bars, *beams]))]
    return Frame(*at, yaw_deg).parts(parts)


@part_builder
def hoardings(
    *, boards: list[tuple[Number, Number, Literal[-1, 1], str, Material, Material]], yaw_deg: Number = 0.0,
    length_m: Number = 4.4,
) -> Parts:  # fmt: skip
    """Set up advertising boards along `yaw_deg`: x, y, 1 to be read from the left of it, word, its material, ink."""
    half = length_m / 2
    parts: Parts = []
    for x, y, side, word, colour, ink in boards:
        board: Parts = [
            (colour, block(-half, -0.06, half, 0.06, 0.08, 0.95)),
            (ink, letters(word, 0.5, (0.0, side * 0.06, 0.28), side * 90.0, 0.02)),
            ("iron", block(0.2 - half, -0.1, half - 0.2, 0.1, 0.0, 0.08)),
        ]
        parts += Frame(x, y, yaw_deg).parts(board)
    return parts
