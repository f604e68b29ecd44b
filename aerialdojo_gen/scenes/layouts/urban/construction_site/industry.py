"""What works and building sites share: things set out by a recipe, guard rails, lattice towers, galleries, tracks.

Functions that make structure return meshes in world coordinates with their materials, to be given to `Site.add`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from pydantic import BaseModel, ConfigDict
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.grammar_props import next_variant
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of, ribbon
from aerialdojo_gen.scenes.kit.structures import Parts, block
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes import box
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.values import Degrees, Metres

Point3 = tuple[float, float, float]


class Place(BaseModel):
    """Things of one place, as a recipe lists them.

    Attributes
    ----------
    place : str
        How a person says where: it goes into the attributes, because descriptions speak of it.
    z : float or None
        Height of the floor, metres; the ground's where absent.
    roof : bool
        Whether it is the roof of a building, whose outline is taken up to the parapet: nothing is checked.
    things : tuple of (category, x, y, yaw)
        Metres and degrees; ``"excavator/blue"`` asks for a variant, otherwise the rarest so far is taken.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    place: str = ""
    z: Metres | None = None
    roof: bool = False
    things: tuple[tuple[str, Metres, Metres, Degrees], ...]


def set_out(site: Site, places: Sequence[Place]) -> None:
    """Place all things of a recipe; `AssetError` lists those whose ground is taken."""
    refused = []
    for group in places:
        attributes = {"place": group.place} if group.place else None
        for name, x, y, yaw in group.things:
            category, _, variant = name.partition("/")
            look = variant or next_variant(site, category)
            if group.roof:
                site.place(category, x, y, yaw, z=group.z, variant=look, attributes=attributes)
            elif site.try_place(category, x, y, yaw, z=group.z, variant=look, attributes=attributes) is None:
                refused.append(f"{name} at ({x:g}, {y:g})")
    if refused:
        raise AssetError(f"{site.name}: no room for {'; '.join(refused)}")


def guard_rails(
    path: BaseGeometry,
    z_m: float,
    *,
    material: str = "marking_yellow",
    toe: str | None = "planks",
    post_m: float = 2.4,
) -> Parts:
    """Make a guard rail along lines on a floor at `z_m`: posts, a knee rail, a handrail and a toe board.

    Parameters
    ----------
    path : LineString or MultiLineString
        World frame, metres.
    z_m : float
        Height of the floor.
    material, toe : str
        Of the rails and of the toe board; None leaves the board out.
    post_m : float
        About the distance between posts.
    """
    steel: list[Mesh] = []
    boards: list[Mesh] = []
    for line in getattr(path, "geoms", [path]):
        for a, b in pairwise(line.coords):
            length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
            if length < 0.4:
                continue
            turn = rotation(0.0, 0.0, float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0]))))
            middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
            for level in (0.52, 1.04):
                steel.append(translated(rotated(box(size=[length, 0.06, 0.06]), turn), (*middle, z_m + level)))
            if toe is not None:
                boards.append(translated(rotated(box(size=[length, 0.04, 0.2]), turn), (*middle, z_m)))
            count = max(round(length / post_m), 1)
            for k in range(count + 1):
                at = (a[0] + (b[0] - a[0]) * k / count, a[1] + (b[1] - a[1]) * k / count, z_m)
                steel.append(translated(box(size=[0.07, 0.07, 1.1]), at))
    parts: Parts = [(material, merge(steel))] if steel else []
    if toe is not None and boards:
        parts.append((toe, merge(boards)))
    return parts


def rim(plan: BaseGeometry, gaps: Sequence[BaseGeometry] = (), inset_m: float = 0.15) -> BaseGeometry:
    """Give the lines along a floor's edges, a little inside of them, without what lies in the gaps."""
    lines: BaseGeometry = plan.buffer(-inset_m, join_style="mitre").boundary
    for gap in gaps:
        lines = lines.difference(gap)
    return lines


def posts(points: Sequence[tuple[float, float]], z0: float, z1: float, width_m: float) -> Mesh:
    """Make square posts at points from `z0` to `z1`, metres."""
    h = width_m / 2
    return merge([block(x - h, y - h, x + h, y + h, z0, z1) for x, y in points])


def bars(lines: Sequence[tuple[Point3, Point3]], width_m: float) -> Mesh:
    """Make straight members of a square section between pairs of points, metres."""
    return merge([sweep(path=[a, b], section=(width_m, width_m)) for a, b in lines])


def trestle(x: float, y: float, z0: float, z1: float, half_m: float, width_m: float = 0.18) -> Mesh:
    """Make a braced steel tower of four legs about (x, y)."""
    corners = [(x - half_m, y - half_m), (x + half_m, y - half_m), (x + half_m, y + half_m), (x - half_m, y + half_m)]
    lines: list[tuple[Point3, Point3]] = [((u, v, z0), (u, v, z1)) for u, v in corners]
    bays = max(round((z1 - z0) / 3.0), 1)
    for k in range(bays):
        low, high = z0 + (z1 - z0) * k / bays, z0 + (z1 - z0) * (k + 1) / bays
        for a, b in pairwise([*corners, corners[0]]):
            lines.append(((*a, low), (*b, high)) if k % 2 else ((*b, low), (*a, high)))
            lines.append(((*a, high - 0.1), (*b, high - 0.1)))
    return bars(lines, width_m)


def pipes(path: Sequence[Point3], offsets: Sequence[tuple[float, float, float, str]]) -> Parts:
    """Lay pipes along a level polyline: (sideways, up, radius, material) each, metres."""
    flat = LineString([p[:2] for p in path])
    out: Parts = []
    for side, up, radius, material in offsets:
        line = flat.offset_curve(side, join_style="mitre") if side else flat
        z = path[0][2] + up
        out.append((material, sweep(path=[(x, y, z) for x, y in line.coords], radius=radius, sides=8)))
    return out


def track(site: Site, path: Sequence[tuple[float, float]], gauge_m: float = 1.5, bed: str | None = "gravel") -> None:
    """Lay a straight track on level ground: ballast, sleepers and rails; without `bed` the rails lie flush."""
    if bed is not None:
        site.paint(ribbon(path, 3.4), bed)
    parts: Parts = []
    z = site.ground_z(*path[0])
    for a, b in pairwise(path):
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        turn = rotation(0.0, 0.0, float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0]))))
        high = 0.16 if bed is not None else 0.03
        rails = [translated(box(size=[length, 0.08, high]), (length / 2, s * gauge_m / 2, 0.0)) for s in (-1, 1)]
        parts.append(("rust", translated(rotated(merge(rails), turn), (*a, z))))
        if bed is not None:
            ties = [translated(box(size=[0.25, 2.5, 0.06]), (s, 0.0, 0.0)) for s in np.arange(0.6, length, 1.2)]
            parts.append(("wood:#5b4634", translated(rotated(merge(ties), turn), (*a, z))))
    site.add(None, "railway_track", parts)


def plates(area: BaseGeometry, z0: float, z1: float) -> Mesh:
    """Extrude every polygon of an area between two heights, metres."""
    return merge([slab(p, z0, z1) for p in polygons_of(area)])
