"""Railways: tracks on ballast, platforms with roofs, overhead lines.

Rolling stock of the catalogue has z = 0 at the top of the rail, `RAIL_M` above the ground that a track is laid on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.grammar import Frame, along, leg, slab
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.structures import Point, block, columns
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, Box, Line, Material, Number, Spacing
from aerialdojo_gen.scenes.shapes import box as cuboid
from aerialdojo_gen.scenes.shapes import cylinder, sweep
from aerialdojo_gen.scenes.site import Site

BED_M = 0.35
RAIL_M = 0.56
_GAUGE_M = 1.44
_SLEEPER_M = (0.26, 2.4, 0.2)
_SPACING_M = 0.7


@site_builder
def ballast(site: Site, *, lines: list[Line], material: Material = "gravel:#867e74") -> None:
    """Paint the beds of tracks, a low shoulder about a higher middle; beds that meet become one."""
    beds = shapely.unary_union([ribbon(line, 4.4) for line in lines])
    site.paint(beds, material, BED_M / 2, material)
    site.paint(shapely.unary_union([ribbon(line, 3.2) for line in lines]), material, BED_M, material)


@site_builder
def tracks(
    site: Site, *, lines: list[Line], on: Number = BED_M, clear: Area | None = None,
    sleeper: Material = "planks:#5f4a38", rail: Material = "rust:#7a6a5e",
) -> None:  # fmt: skip
    """Lay sleepers and rails along middle lines.

    `on` is the height of the ballast's top, `RAIL_M` - `BED_M` below that of the rails; in the area `clear` another
    track has sleepers already.
    """
    for line in lines:
        site.add(None, "track", _track(line, on, clear, sleeper, rail))


def _track(line: Sequence[Point], on: float, clear: Area | None, sleeper: str, rail: str) -> Parts:
    middle = LineString(line)
    top = on + RAIL_M - BED_M
    tie = translated(cuboid(size=_SLEEPER_M), (0.0, 0.0, on - 0.15))
    ties = [
        posed(tie, rotation(0.0, 0.0, yaw), (x, y, 0.0))
        for x, y, yaw in along(line, _SPACING_M, start_m=0.2, end_m=0.2)
        if clear is None or not shapely.contains_xy(clear, x, y)
    ]
    runs = [middle.offset_curve(side * _GAUGE_M / 2, join_style="mitre") for side in (-1, 1)]
    rails = [sweep(path=[(x, y, top - 0.08) for x, y in run.coords], section=(0.14, 0.16)) for run in runs]
    return [(sleeper, merge(ties)), (rail, merge(rails))]


@site_builder
def light_tracks(site: Site, *, lines: list[Line], gauge_m: Number = 1.5, bed: Material = "gravel") -> None:
    """Lay tracks of a works along lines of straight legs on level ground: a bed, rails and sleepers."""
    for line in lines:
        site.paint(ribbon(line, 3.4), bed)
        z = site.ground_z(*line[0])
        parts: Parts = []
        for a, b in pairwise(line):
            length, yaw_deg = leg(a, b)
            rail = cuboid(size=[length, 0.08, 0.16])
            rails = [translated(rail, (length / 2, s * gauge_m / 2, 0.0)) for s in (-1, 1)]
            ties = [translated(cuboid(size=[0.25, 2.5, 0.06]), (s, 0.0, 0.0)) for s in np.arange(0.6, length, 1.2)]
            parts += Frame(*a, yaw_deg).parts([("rust", merge(rails)), ("wood:#5b4634", merge(ties))], z)
        site.add(None, "railway_track", parts)


@site_builder
def rail_platform(site: Site, *, box: Box, top_m: Number, floor: Material, foot_m: Number = 0.0) -> None:
    """Build a platform with a coping and a yellow line along both edges that run along x."""
    (x0, y0, x1, y1), z0, z1 = box, foot_m, top_m
    parts: Parts = [("blocks:#8f8a82", block(x0, y0, x1, y1, z0, z1 - 0.2))]
    parts.append((floor, block(x0, y0 + 0.6, x1, y1 - 0.6, z1 - 0.2, z1)))
    parts.append(("concrete:#c4c0b6", merge([block(x0, y0 - 0.06, x1, y0 + 0.6, z1 - 0.2, z1),
                                              block(x0, y1 - 0.6, x1, y1 + 0.06, z1 - 0.2, z1)])))  # fmt: skip
    lines = [block(x0, y, x1, y + 0.12, z1 - 0.05, z1 + 0.008) for y in (y0 + 0.62, y1 - 0.74)]
    parts.append(("marking_yellow", merge(lines)))
    site.add(None, "platform", parts)
    site.occupy(rectangle(x0, y0, x1, y1), z0, z1 - 0.05)


@part_builder
def butterfly_roof(
    *, box: Box, z_m: Number, foot_m: Number, roof: Material, frame: Material,
    spacing_m: Spacing = 8.0, rows: Sequence[Number] = (),
) -> Parts:  # fmt: skip
    """Make a platform's roof that falls to a gutter in its middle, on posts in `rows` (y, metres)."""
    x0, y0, x1, y1 = box
    if x1 <= x0 or y1 <= y0:
        raise AssetError(f"box is [x0, y0, x1, y1] with x0 < x1 and y0 < y1, got {list(box)}")
    middle, rise = (y0 + y1) / 2, 0.55
    half = (y1 - y0) / 2
    pitch = math.degrees(math.atan2(rise, half))
    leaf = cuboid(size=(x1 - x0, float(np.hypot(half, rise)), 0.14))
    x, z = (x0 + x1) / 2, z_m + rise / 2
    wing = [posed(leaf, rotation(s * pitch, 0.0, 0.0), (x, middle + s * half / 2, z)) for s in (-1.0, 1.0)]
    count = max(round((x1 - x0 - 2.0) / spacing_m), 1)
    steps = [x0 + 1.0 + (x1 - x0 - 2.0) * k / count for k in range(count + 1)]
    posts = columns([(x, y) for x in steps for y in (rows or (middle,))], foot_m, z_m + 0.1, 0.13)
    ends = (y0 + 0.3, middle, y1 - 0.3)
    arms = [
        sweep(path=[(x, y, z_m + rise * abs(y - middle) / (y1 - middle) - 0.08) for y in ends], section=(0.14, 0.16))
        for x in steps
    ]
    rim = [block(x0, y - 0.06, x1, y + 0.06, z_m + rise - 0.25, z_m + rise + 0.2) for y in (y0, y1)]
    return [(roof, merge(wing)), (frame, merge([posts, *arms, *rim]))]


@site_builder
def overhead_portals(
    site: Site, *, at_x: list[Number], posts: tuple[Number, Number], feet: list[tuple[Number, Number]],
    tracks: list[Number], z_m: Number, wire_m: Number,
) -> None:  # fmt: skip
    """Put up lattice portals across tracks along x (y, metres) that carry their wires at `wire_m`.

    Each portal has two posts (y, metres), which stand on its own two `feet` (heights).
    """
    if len(feet) != len(at_x):
        raise AssetError(f"feet: {len(feet)} pairs of heights for {len(at_x)} portals")
    low, high = sorted(posts)
    for x, foot in zip(at_x, feet, strict=True):
        stood = list(zip(posts, foot, strict=True))
        bars = [block(x - 0.17, y - 0.17, x + 0.17, y + 0.17, f, z_m + 0.7) for y, f in stood]
        bars += [block(x - 0.09, low, x + 0.09, high, z, z + 0.12) for z in (z_m, z_m + 0.58)]
        ys = np.linspace(low, high, max(round((high - low) / 1.4), 2) + 1)
        zigzag = [(x, float(y), z_m + (0.06 if k % 2 else 0.62)) for k, y in enumerate(ys)]
        bars.append(sweep(path=zigzag, section=(0.07, 0.07)))
        bars += [block(x - 0.05, y - 0.05, x + 0.05, y + 0.05, wire_m + 0.6, z_m) for y in tracks]
        insulator = cylinder(radius=0.11, height=0.5, segments=8)
        insulators = merge([translated(insulator, (x, y, wire_m + 0.08)) for y in tracks])
        blocks = merge([block(x - 0.45, y - 0.45, x + 0.45, y + 0.45, f - 0.3, f + 0.25) for y, f in stood])
        parts: Parts = [("#7b8288", merge(bars)), ("#7a3f2c", insulators), ("concrete", blocks)]
        site.add(None, "overhead_line_portal", parts)
        for y, f in stood:
            site.occupy(rectangle(x - 0.5, y - 0.5, x + 0.5, y + 0.5), f, f + 7.0)


@site_builder
def overhead_wires(site: Site, *, x0: Number, x1: Number, tracks: list[Number], wire_m: Number) -> None:
    """Hang a contact wire and a carrying wire over tracks that run along x, metres."""
    bodies: list[Mesh] = []
    for y in tracks:
        bodies += [block(x0, y - 0.02, x1, y + 0.02, z, z + 0.04) for z in (wire_m, wire_m + 0.55)]
        bodies += [
            block(x - 0.015, y - 0.015, x + 0.015, y + 0.015, wire_m, wire_m + 0.55)
            for x in np.arange(x0 + 4, x1, 8.0)
        ]
    site.add(None, "overhead_wire", [("#33373b", merge(bodies))])


@part_builder
def footbridge_roof(*, box: Box, on: Number, roof: Material, frame: Material) -> Parts:
    """Make a light roof on posts over a footbridge that runs along y."""
    (x0, y0, x1, y1), floor_m = box, on
    posts = [block(x - 0.07, y - 0.07, x + 0.07, y + 0.07, floor_m, floor_m + 2.7)
             for x in (x0 + 0.1, x1 - 0.1)
             for y in np.linspace(y0 + 0.2, y1 - 0.2, max(round((y1 - y0) / 4.5), 1) + 1)]  # fmt: skip
    top = slab(rectangle(x0 - 0.3, y0, x1 + 0.3, y1), floor_m + 2.7, floor_m + 2.86)
    return [(frame, merge(posts)), (roof, top)]
