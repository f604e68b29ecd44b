"""Structure at the water's edge: piers on piles, sea walls, groynes, steps, sand fences and rocky breakwaters.

Every function adds to the site and returns what it added; lengths are metres, the sea lies at z = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import along, slab
from aerialdojo_gen.scenes.kit.structures import Parts, Point, stairs
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import box, cylinder
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site


def bars(path: Sequence[Point], z_m: float, material: str = "#f1f0ea", height_m: float = 1.0) -> Parts:
    """Make an open railing of posts every 2 m and three bars along a path on a floor at `z_m`."""
    bodies: list[Mesh] = []
    for a, b in pairwise(path):
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        turn = rotation(0.0, 0.0, float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0]))))
        middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
        for share, thick in ((0.35, 0.04), (0.68, 0.04), (1.0, 0.09)):
            bar = rotated(box(size=(length, thick, thick)), turn)
            bodies.append(translated(bar, (*middle, z_m + share * height_m - thick)))
        count = max(round(length / 2.0), 1)
        for k in range(count + 1):
            t = k / count
            at = (a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, z_m)
            bodies.append(translated(rotated(box(size=(0.08, 0.08, height_m)), turn), at))
    return [(material, merge(bodies))]


def pier(
    site: Site,
    frame: Frame,
    length_m: float,
    width_m: float,
    z_m: float,
    *,
    bay_m: float = 5.0,
    floor: str = "boards:#9a8462",
    pile: str = "logs:#6f5a44",
    rail: str | None = "#f1f0ea",
    foot_m: float = -1.0,
    gates: Sequence[tuple[float, float]] = (),
    category: str = "pier",
) -> Instance:
    """Put up a pier whose deck (its top at `z_m`) runs from the frame's origin along u, on rows of piles.

    Parameters
    ----------
    site : Site
        Where; the ground below stays free, one can fly under the deck.
    frame : Frame
        Middle of the landward end; u runs out along the pier.
    length_m, width_m, z_m : float
        Of the deck.
    bay_m : float
        Distance of the rows of piles.
    floor, pile, rail : str
        Materials; no railing where `rail` is None.
    foot_m : float
        How deep the piles reach.
    gates : sequence of (float, float)
        Stretches along u where the sides have no railing.
    category : str
        Of the structure.
    """
    w = width_m / 2
    parts: Parts = [
        (floor, translated(box(size=(length_m, width_m, 0.14)), (length_m / 2, 0.0, z_m - 0.14))),
    ]
    wood: list[Mesh] = [
        translated(box(size=(length_m, 0.22, 0.3)), (length_m / 2, v, z_m - 0.44)) for v in (-w + 0.2, 0.0, w - 0.2)
    ]
    count = max(round((length_m - 0.8) / bay_m), 1)
    for k in range(count + 1):
        u = 0.4 + (length_m - 0.8) * k / count
        ground = site.ground_z(*frame.at(u, 0.0))
        foot = min(ground, 0.0) + foot_m
        for v in (-w + 0.3, w - 0.3):
            wood.append(translated(cylinder(radius=0.17, height=z_m - 0.2 - foot, segments=8), (u, v, foot)))
        wood.append(translated(box(size=(0.24, width_m, 0.26)), (u, 0.0, z_m - 0.68)))
        if z_m - ground > 2.4:
            for s in (-1, 1):
                brace = [(u, s * (w - 0.3), ground + 0.4), (u, -s * (w - 0.3), z_m - 0.7)]
                wood.append(sweep(path=brace, radius=0.07, sides=4))
    parts.append((pile, merge(wood)))
    if rail:
        for side in (-w + 0.08, w - 0.08):
            for u0, u1 in _gaps(0.0, length_m, gates):
                parts += bars([(u0, side), (u1, side)], z_m, rail)
    return site.add(None, category, frame.parts(parts))


def end_rail(site: Site, path: Sequence[Point], z_m: float, material: str = "#f1f0ea") -> Instance:
    """Put a railing along a path on a floor at `z_m`."""
    return site.add(None, "railing", bars(path, z_m, material))


def retaining_wall(
    site: Site,
    x0: float,
    x1: float,
    y0: float,
    y1: float,
    z0_m: float,
    z1_m: float,
    *,
    wall: str = "blocks:#a79f92",
    cap: str = "concrete",
    rail: str | None = "#e8ecec",
    gates: Sequence[tuple[float, float]] = (),
) -> Instance:
    """Put up a wall that holds a terrace and looks south (towards -y): body, coping, and a railing along its edge.

    `gates` are stretches along x without railing, where steps arrive.
    """
    parts: Parts = [
        (wall, slab(_rect(x0, y0, x1, y1), z0_m, z1_m - 0.25)),
        (cap, slab(_rect(x0 - 0.02, y0 - 0.15, x1 + 0.02, y1), z1_m - 0.25, z1_m + 0.04)),
    ]
    # Buttresses break the wall's length.
    step = 8.0
    for x in np.arange(x0 + step / 2, x1 - 1.0, step):
        foot = box(size=(0.7, 0.5, z1_m - z0_m - 0.3), taper=(1.0, 0.5))
        parts.append((wall, translated(foot, (float(x), y0 - 0.1, z0_m))))
    if rail:
        for a, b in _gaps(x0, x1, gates):
            parts += bars([(a, y0 + 0.1), (b, y0 + 0.1)], z1_m + 0.04, rail, 1.0)
    return site.add(None, "sea_wall", parts, footprint=_rect(x0, y0 - 0.4, x1, y1))


def flight(
    site: Site, foot: Point, yaw_deg: float, width_m: float, z0_m: float, z1_m: float, run_m: float, **materials: str
) -> Instance:
    """Put up a flight of steps that climbs from `foot` along `yaw_deg`."""
    parts = stairs(foot, yaw_deg, width_m, z1_m - z0_m, run_m, z_m=z0_m, **materials)
    plan = Frame(*foot, yaw_deg).area(_rect(0.0, -width_m / 2 - 0.1, run_m, width_m / 2 + 0.1))
    return site.add(None, "steps", parts, footprint=plan)


def groyne(
    site: Site,
    path: Sequence[Point],
    height_m: float,
    *,
    material: str = "planks:#6f5d47",
    post: str = "logs:#5d4c3a",
) -> Instance:
    """Put up a timber groyne along a path: close planks between posts that follow the beach's fall."""
    line = LineString(path)
    count = max(round(line.length / 2.5), 1)
    points = [line.interpolate(k / count, normalized=True) for k in range(count + 1)]
    xyz = [(p.x, p.y, max(site.ground_z(p.x, p.y), 0.0)) for p in points]
    planks = sweep(path=[(x, y, z + height_m / 2 - 0.3) for x, y, z in xyz], section=(0.14, height_m + 0.2))
    posts = [translated(cylinder(radius=0.16, height=height_m + 1.1, segments=8), (x, y, z - 0.8)) for x, y, z in xyz]
    area = line.buffer(0.3, cap_style="flat")
    return site.add(None, "groyne", [(material, planks), (post, merge(posts))], footprint=area)


def sand_fence(
    site: Site, path: Sequence[Point], *, material: str = "wood:#b39d7c", height_m: float = 1.1
) -> Instance:
    """Put up a chestnut paling along a path over uneven ground: slender pales and two wires."""
    pales = []
    for x, y, yaw in along(path, 0.32):
        pale = rotated(box(size=(0.05, 0.09, height_m)), rotation(0.0, 0.0, yaw + 90.0))
        pales.append(translated(pale, (x, y, site.ground_z(x, y) - 0.1)))
    poses = along(path, 1.6)
    wires = [
        sweep(path=[(p.x, p.y, site.ground_z(p.x, p.y) + h) for p in poses], radius=0.02, sides=3)
        for h in (0.25, 0.8)
    ]
    posts = [
        translated(
            cylinder(radius=0.06, height=height_m + 0.4, segments=6), (p.x, p.y, site.ground_z(p.x, p.y) - 0.3)
        )
        for p in poses[::2]
    ]
    area = LineString(path).buffer(0.2, cap_style="flat")
    return site.add(None, "sand_fence", [(material, merge([*pales, *wires, *posts]))], footprint=area)


def field_wall(
    site: Site, path: Sequence[Point], *, height_m: float = 1.1, material: str = "blocks:#938c80"
) -> Instance:
    """Put up a dry stone wall along a path over uneven ground."""
    poses = along(path, 2.0)
    line = [(p.x, p.y, site.ground_z(p.x, p.y) + height_m / 2 - 0.25) for p in poses]
    area = LineString(path).buffer(0.35, cap_style="flat")
    body = sweep(path=line, section=(0.55, height_m + 0.5))
    return site.add(None, "stone_wall", [(material, body)], footprint=area)


def mole(site: Site, path: Sequence[Point], width_m: float, z_m: float, *, stone: str = "blocks:#9a9488") -> Instance:
    """Put up a solid breakwater of masonry along a path, its walkway at `z_m`, with a parapet on its left side."""
    line = LineString(path)
    body = line.buffer(width_m / 2, cap_style="flat", join_style="mitre")
    parapet = line.offset_curve(width_m / 2 - 0.3).buffer(0.3, cap_style="flat", join_style="mitre")
    parts: Parts = [
        (stone, slab(body, -1.0, z_m - 0.2)),
        ("paving:#a59c8c", slab(body.buffer(0.08, join_style="mitre"), z_m - 0.2, z_m)),
        (stone, slab(parapet, z_m, z_m + 0.9)),
    ]
    return site.add(None, "breakwater", parts, footprint=body)


def _gaps(start: float, end: float, gates: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    out, at = [], start
    for a, b in sorted(gates):
        if a - at > 0.3:
            out.append((at, a))
        at = max(at, b)
    if end - at > 0.3:
        out.append((at, end))
    return out


def _rect(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    return Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
