"""The yards of building sites: hoardings, stacked offices, aggregate bays, precast stores, foundations."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, letters, stairs
from aerialdojo_gen.scenes.layouts.urban.construction_site.industry import guard_rails, plates, posts
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes import box, crown
from aerialdojo_gen.scenes.site import Site

Xy = tuple[float, float]
CABIN_M = (2.6, 6.2, 2.75)


def hoarding(site: Site, path: Sequence[Xy], colours: tuple[str, str], sign: str = "", height_m: float = 2.4) -> None:
    """Fence a site along a path: panels in two colours on posts, `sign` written on every third panel from outside."""
    panels: dict[str, list[Mesh]] = {}
    wood: list[Mesh] = []
    count = 0
    for a, b in pairwise(path):
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        yaw = float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0])))
        turn = rotation(0.0, 0.0, yaw)
        n = max(round(length / 4.0), 1)
        wide = length / n
        for k in range(n):
            t = (k + 0.5) / n
            x, y = a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t
            z = site.ground_z(x, y)
            colour = colours[count % 3 == 0]
            panels.setdefault(colour, []).append(
                translated(rotated(box(size=[wide - 0.06, 0.06, height_m - 0.15]), turn), (x, y, z + 0.12))
            )
            wood.append(translated(rotated(box(size=[wide, 0.16, 0.12]), turn), (x, y, z + height_m - 0.03)))
            wood.append(
                translated(
                    box(size=[0.14, 0.14, height_m]), (a[0] + (b[0] - a[0]) * k / n, a[1] + (b[1] - a[1]) * k / n, z)
                )
            )
            if sign and count % 3 == 0:
                c, s = np.cos(np.radians(yaw - 90)), np.sin(np.radians(yaw - 90))
                panels.setdefault("marking", []).append(
                    letters(sign, 0.5, (x + 0.04 * c, y + 0.04 * s, z + 1.1), yaw - 90.0, 0.03)
                )
            count += 1
    parts: Parts = [("wood:#7a664c", merge(wood))] + [(m, merge(b)) for m, b in panels.items()]
    site.add(None, "hoarding", parts, footprint=LineString(path).buffer(0.15, cap_style="flat", join_style="mitre"))


def offices(site: Site, frame: Frame, columns: int, storeys: int, colours: Sequence[str], base: float = 0.0) -> float:
    """Stack site offices, with a gallery and stairs along their front.

    Parameters
    ----------
    site : Site
        Where; the stack takes its ground.
    frame : Frame
        Middle of the back; u looks out of the front, cabins stand side by side along v.
    columns, storeys : int
        How many side by side, and one on the other.
    colours : sequence of str
        Materials of the cabins in turn.
    base : float
        Height of the ground, metres.

    Returns
    -------
    float
        Height of the stack's roof, metres.
    """
    wide, deep, high = CABIN_M
    half = columns * wide / 2
    parts: Parts = []
    for s in range(storeys):
        z = 0.15 + s * high
        for k in range(columns):
            v = -half + k * wide
            colour = colours[(k + 2 * s) % len(colours)]
            parts.append((colour, block(0.0, v + 0.03, deep, v + wide - 0.03, z, z + high - 0.06)))
            parts.append(
                (
                    "metal",
                    merge([block(-0.04, v, deep + 0.04, v + wide, z + d, z + d + 0.14) for d in (0.0, high - 0.2)]),
                )
            )
            parts.append(("window", block(deep - 0.02, v + 1.35, deep + 0.05, v + 2.35, z + 1.0, z + 2.1)))
            parts.append(("#f2f0ea", block(deep - 0.02, v + 0.25, deep + 0.06, v + 1.1, z + 0.14, z + 2.15)))
            parts.append(("window", block(-0.05, v + 0.7, 0.02, v + 1.9, z + 1.0, z + 2.1)))
        if s:
            parts.append(("sheet_metal", block(deep, -half, deep + 1.25, half + 1.3, z - 0.1, z)))
            gap = [(deep + 1.15, -half + 0.1), (deep + 1.15, half - (0.1 if s > 1 else 0.0))]
            parts += guard_rails(LineString(gap), z, toe=None)
            parts.append(
                ("metal", posts([(deep + 1.15, v) for v in (-half + 0.1, 0.0, half - 0.1)], 0.0, z - 0.1, 0.12))
            )
        if s + 1 < storeys:
            # Each flight climbs away from the stack's side, one above the other.
            parts += stairs(
                (deep + 0.6, half + 0.1 + 4.4), -90.0, 1.1, high, 4.4, z_m=z if s else 0.0, tread="sheet_metal"
            )
    top = 0.15 + storeys * high
    parts.append(("sheet_metal:#8f9598", block(0.0, -half, deep, half, top - 0.06, top)))
    world = frame.parts(parts, base)
    plan = rectangle(0.0, -half, deep + 1.25, half + (4.8 if storeys > 1 else 0.0))
    body = rectangle(-0.1, -half, deep + 1.25, half)
    site.add(None, "site_offices", world)
    site.occupy(frame.area(body), base - 1.0, base + top - 0.05)
    site.occupy(frame.area(plan.difference(body)), base - 1.0, base + top - 0.05)
    return base + top


def aggregate_bays(
    site: Site, frame: Frame, materials: Sequence[str], deep_m: float = 5.0, wide_m: float = 5.0
) -> None:
    """Build open bays of concrete blocks side by side along v, each with a heap of its material."""
    n = len(materials)
    half = n * wide_m / 2
    z = min(site.ground_z(*frame.at(u, v)) for u in (0.0, deep_m) for v in (-half, half))
    for k, material in enumerate(materials):
        low = -half + k * wide_m
        high = low + wide_m
        walls = [
            block(-0.3, low - 0.3, 0.3, high - 0.3, 0.0, 2.4),
            block(0.3, low - 0.3, deep_m, low + 0.3, 0.0, 2.4),
        ]
        if k == n - 1:
            walls += [block(-0.3, high - 0.3, 0.3, high + 0.3, 0.0, 2.4)]
            walls += [block(0.3, high - 0.3, deep_m, high + 0.3, 0.0, 2.4)]
        heap = crown(radii=(deep_m * 0.48, wide_m * 0.42, 1.9), noise=0.12, seed=k + 3)
        parts: Parts = [
            ("blocks", merge(walls)),
            (material, _half(translated(heap, (deep_m * 0.48, low + wide_m / 2, 0.0)))),
        ]
        area = rectangle(-0.3, low - 0.3, deep_m + 0.3, high + (0.3 if k == n - 1 else -0.31))
        site.add(None, "aggregate_bay", frame.parts(parts, z), footprint=frame.area(area))


def precast_stack(site: Site, frame: Frame, count: int, length_m: float, material: str = "concrete:#c2beb4") -> None:
    """Stand precast wall panels on edge in an A-frame rack, side by side along u."""
    parts: Parts = []
    bodies = [block(k * 0.62, -length_m / 2, k * 0.62 + 0.2, length_m / 2, 0.25, 3.1) for k in range(count)]
    parts.append((material, merge(bodies)))
    wide = (count - 1) * 0.62 + 0.2
    feet = [block(-0.5, v - 0.12, wide + 0.5, v + 0.12, 0.0, 0.25) for v in (-length_m * 0.35, length_m * 0.35)]
    masts = [
        block(u, v - 0.1, u + 0.16, v + 0.1, 0.0, 3.4)
        for u in (-0.3, wide + 0.14)
        for v in (-length_m * 0.35, length_m * 0.35)
    ]
    parts.append(("paint:#c9542c", merge([*feet, *masts])))
    z = site.ground_z(frame.x, frame.y)
    site.add(
        None,
        "precast_rack",
        frame.parts(parts, z),
        footprint=frame.area(rectangle(-0.6, -length_m / 2, wide + 0.6, length_m / 2)),
    )


def foundation(
    site: Site, plan: BaseGeometry, z0: float, z1: float, columns: Sequence[Xy], walls: Sequence[tuple[Xy, Xy]]
) -> None:
    """Cast a raft whose top is at `z1`, with starter bars for columns and walls that stand half formed.

    Parameters
    ----------
    site : Site
        Where.
    plan : shapely geometry
        Outline of the raft, metres.
    z0, z1 : float
        Underside and top.
    columns : sequence of (x, y)
        Where bars for columns rise.
    walls : sequence of (a, b)
        Walls 3 m high with panels of formwork on one side.
    """
    parts: Parts = [("concrete:#b9b5ab", plates(plan, z0, z1))]
    dots = [(x + i * 0.2, y + j * 0.2) for x, y in columns for i in (-1, 1) for j in (-1, 1)]
    parts.append(("rust", posts(dots, z1, z1 + 1.6, 0.045)))
    if columns:
        parts.append(("rust", posts(list(columns), z1 + 0.5, z1 + 0.56, 0.46)))
        parts.append(("rust", posts(list(columns), z1 + 1.1, z1 + 1.16, 0.46)))
    for a, b in walls:
        line = LineString([a, b])
        wall: Parts = [("concrete", plates(line.buffer(0.15, cap_style="flat"), z1, z1 + 3.0))]
        n = max(round(line.length / 1.4), 1)
        tops = [line.interpolate(line.length * (k + 0.5) / n) for k in range(n)]
        wall.append(("rust", posts([(p.x, p.y) for p in tops], z1 + 3.0, z1 + 3.8, 0.05)))
        side = line.buffer(-0.32, cap_style="flat", single_sided=True).difference(line.buffer(0.16, cap_style="flat"))
        wall.append(("planks:#d1a03c", plates(side, z1 + 0.05, z1 + 2.8)))
        site.add(None, "raft_wall", wall)
        site.occupy(line.buffer(0.5, cap_style="flat"), z1 - 0.2, z1 + 3.8)
    site.add(None, "foundation", parts)
    for x, y in columns:
        site.occupy(rectangle(x - 0.35, y - 0.35, x + 0.35, y + 0.35), z1 - 0.2, z1 + 1.6)


def _half(body: Mesh) -> Mesh:
    """Press what lies below z = 0 flat."""
    v = body.vertices.copy()
    v[:, 2] = np.maximum(v[:, 2], -0.05)
    return Mesh(v, body.faces)
