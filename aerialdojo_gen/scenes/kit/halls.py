"""Halls along the axes: open ones to fly into, sheds on posts, and warehouses, whose doors are shut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from shapely.geometry import Polygon

from aerialdojo_gen.scenes.grammar import Frame, between_gates, plates, slab
from aerialdojo_gen.scenes.ground import edge_strip, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.buildings import pitched_roof, wall_with_openings
from aerialdojo_gen.scenes.kit.steelwork import bars, posts
from aerialdojo_gen.scenes.kit.structures import block, columns, letters
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge
from aerialdojo_gen.scenes.plans.values import Box, Material, Number, Spacing
from aerialdojo_gen.scenes.shapes import extrude, upright
from aerialdojo_gen.scenes.site import Site

_Opening = tuple[Number, Number, Number, Number]
_Side = Literal["s", "n", "w", "e"]
_T = 0.15


@dataclass(frozen=True)
class HallRoof:
    """What covers a hall; `rise_m` is that of its teeth or of its ridge, which runs along the longer side."""

    material: Material
    kind: Literal["saw", "flat", "gable"] = "flat"
    rise_m: Number = 2.6
    teeth: Annotated[int, Field(ge=1, le=50)] = 4  # Their glazed faces look north
    parapet_m: Number = 0.7  # Of a flat roof
    lights: Annotated[int, Field(ge=0, le=50)] = 0  # Roof lights of a flat roof, in a row


@site_builder
def hall(
    site: Site, *, category: str, box: Box, eaves_m: Number, wall: Material, roof: HallRoof,
    gates: dict[_Side, list[_Opening]] = {},  # noqa: B006
    base: Material = "brick:#8a4f40", name: str = "", sign_side: _Side = "s", letter_m: Number = 1.2,
) -> float:  # fmt: skip
    """Put up a hall at z = 0 with open gates and bands of windows; gives the height of its eaves.

    The walls take their ground, the floor inside stays free; `base` is the material of their lowest 1.2 m. Gates are
    (from, to, sill, head) by side, along the wall from its west or south end; the name stands high on a side.
    """
    x0, y0, x1, y1 = box
    parts = {"saw": _saw_roof, "flat": _flat_roof, "gable": _gable_roof}[roof.kind](box, eaves_m, wall, roof)
    ends = {
        "s": ((x0, y0 + _T), (x1, y0 + _T)), "n": ((x0, y1 - _T), (x1, y1 - _T)),
        "w": ((x0 + _T, y0 + 2 * _T), (x0 + _T, y1 - 2 * _T)), "e": ((x1 - _T, y0 + 2 * _T), (x1 - _T, y1 - 2 * _T)),
    }  # fmt: skip
    for side, (a, b) in ends.items():
        openings = gates.get(side, [])  # type: ignore[call-overload]
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        low = [(u0, u1, s, min(h, 1.2)) for u0, u1, s, h in openings if s < 1.2]
        high = [(u0, u1, max(s - 1.2, 0.0), h - 1.2) for u0, u1, s, h in openings if h > 1.2]
        parts.append((base, wall_with_openings(a, b, 0.0, 1.2, low, 0.34)))
        parts.append((wall, wall_with_openings(a, b, 1.2, eaves_m, high, 0.3)))
        parts += _shutters(side, a, openings) + _windows(side, a, length, eaves_m, openings)
        doors = [(u0, u1) for u0, u1, sill, _ in openings if sill < 0.5]
        for u0, u1 in between_gates(0.0, length, doors, 0.05):
            x, y = a
            area = (x + u0, y - 0.2, x + u1, y + 0.2) if side in "sn" else (x - 0.2, y + u0, x + 0.2, y + u1)
            site.occupy(rectangle(*area), -1.0, 6.0)
    if name:
        x, y, yaw = {
            "s": ((x0 + x1) / 2, y0 - 0.03, -90.0), "e": (x1 + 0.03, (y0 + y1) / 2, 0.0),
            "n": ((x0 + x1) / 2, y1 + 0.03, 90.0), "w": (x0 - 0.03, (y0 + y1) / 2, 180.0),
        }[sign_side]  # fmt: skip
        parts.append(("marking", letters(name, letter_m, (x, y, eaves_m - letter_m - 0.35), yaw, 0.12)))
    site.add(None, category, parts)
    return eaves_m


@site_builder
def overhead_crane(site: Site, *, box: Box, at_x: Number, z_m: Number, colour: Material = "#e0a92a") -> None:
    """Hang a travelling crane in a hall: runways on columns along x, a bridge at `at_x`, a hoist and its hook."""
    x0, _, x1, _ = box
    ys = (box[1] + 1.0, box[3] - 1.0)
    count = max(int((x1 - x0) // 8.0), 1)
    feet = [(x0 + 1.0 + (x1 - x0 - 2.0) * k / count, y) for k in range(count + 1) for y in ys]
    y = (ys[0] + ys[1]) / 2 + 2.0
    bridge = [block(at_x + d, ys[0] - 0.3, at_x + d + 0.4, ys[1] + 0.3, z_m, z_m + 0.7) for d in (-1.0, 0.6)]
    parts: Parts = [
        ("steel", posts(feet, 0.0, z_m - 0.5, 0.34)),
        ("steel", merge([block(x0 + 0.8, y - 0.2, x1 - 0.8, y + 0.2, z_m - 0.5, z_m) for y in ys])),
        (colour, merge(bridge)),
        ("iron", block(at_x - 0.9, y - 0.7, at_x + 0.9, y + 0.7, z_m + 0.7, z_m + 1.3)),
        ("iron", block(at_x - 0.04, y - 0.04, at_x + 0.04, y + 0.04, z_m - 2.0, z_m + 0.7)),
        (colour, block(at_x - 0.3, y - 0.2, at_x + 0.3, y + 0.2, z_m - 2.5, z_m - 2.0)),
    ]
    site.add(None, "overhead_crane", parts)
    site.occupy_about(feet, 0.3, 0.0, z_m)


@site_builder
def shed_on_posts(
    site: Site, *, box: Box, eaves_m: Number, rise_m: Number, roof: Material,
    post_m: Spacing = 5.0, on: Number = 0.0, post: Material = "wood",
) -> float:  # fmt: skip
    """Put up a gable roof on posts without walls, about `post_m` apart; gives the height of its eaves."""
    x0, y0, x1, y1 = box
    n, m = (max(round(d / post_m), 1) for d in (x1 - x0 - 0.8, y1 - y0 - 0.8))
    xs = [x0 + 0.4 + (x1 - x0 - 0.8) * k / n for k in range(n + 1)]
    ys = [y0 + 0.4 + (y1 - y0 - 0.8) * k / m for k in range(m + 1)]
    feet = [(x, y) for i, x in enumerate(xs) for j, y in enumerate(ys) if i in (0, n) or j in (0, m)]
    top = on + eaves_m
    z = top - 0.15
    across = [((x, ys[0], z), (x, ys[-1], z)) for x in (xs if x1 - x0 >= y1 - y0 else (xs[0], xs[-1]))]
    along = [((xs[0], y, z), (xs[-1], y, z)) for y in (ys if x1 - x0 < y1 - y0 else (ys[0], ys[-1]))]
    ties = across + along if x1 - x0 >= y1 - y0 else along + across
    cover = pitched_roof(rectangle(*box), top, rise_m, "", roof, overhang_m=0.5)[:1]
    site.add(None, "shed", [*cover, (post, posts(feet, on, top, 0.24)), (post, bars(ties, 0.22))])
    site.occupy_about(feet, 0.2, on, top)
    return top


def across_x(points: Sequence[tuple[float, float]], x0: float, x1: float) -> Mesh:
    """Extrude an outline of (y, z) from `x0` to `x1`, metres."""
    body = extrude(Polygon(points), x1 - x0)
    return Mesh(body.vertices[:, [2, 0, 1]] + np.array([x0, 0.0, 0.0]), body.faces)


def _shutters(side: str, a: tuple[float, float], openings: Sequence[_Opening]) -> Parts:
    """Frame every gate, and hang a rolled-up shutter in its head."""
    frames, drums = [], []
    for u0, u1, sill, head in openings:
        frames += [_along(side, a, u0 - 0.2, u0, 0.24, sill, head), _along(side, a, u1, u1 + 0.2, 0.24, sill, head),
                   _along(side, a, u0 - 0.2, u1 + 0.2, 0.24, head, head + 0.25)]  # fmt: skip
        drums.append(_along(side, a, u0, u1, 0.3, head - 0.35, head))
    return [("marking_yellow", merge(frames)), ("sheet_metal", merge(drums))]


def _along(side: str, a: tuple[float, float], u0: float, u1: float, half_m: float, z0: float, z1: float) -> Mesh:
    if side in "sn":
        return block(a[0] + u0, a[1] - half_m, a[0] + u1, a[1] + half_m, z0, z1)
    return block(a[0] - half_m, a[1] + u0, a[0] + half_m, a[1] + u1, z0, z1)


def _windows(side: str, a: tuple[float, float], length: float, eaves: float, openings: Sequence[_Opening]) -> Parts:
    """Set tall windows between the gates and pilasters between the windows."""
    panes, piers = [], []
    count = max(int(length // 4.0), 1)
    wide = length / count
    for k in range(count):
        u0, u1 = k * wide + wide * 0.2, (k + 1) * wide - wide * 0.2
        if all(u1 < g0 - 0.4 or u0 > g1 + 0.4 for g0, g1, _, _ in openings):
            panes.append(_along(side, a, u0, u1, 0.19, 1.7, eaves - 1.9))
        if k and all(not g0 - 0.4 < k * wide < g1 + 0.4 for g0, g1, _, _ in openings):
            piers.append(_along(side, a, k * wide - 0.2, k * wide + 0.2, 0.3, 0.0, eaves - 0.1))
    return [("glass:#6f8796", merge(panes)), ("concrete:#9d978c", merge(piers))]


def _saw_roof(box: Box, z: float, wall: str, roof: HallRoof) -> Parts:
    x0, y0, x1, y1 = box
    wide, rise, out = (y1 - y0) / roof.teeth, roof.rise_m, 0.35
    sheets, panes, gables, beams = [], [], [], []
    for k in range(roof.teeth):
        a, b = y0 + k * wide, y0 + (k + 1) * wide
        slope = [(a, z), (b - 0.15, z + rise), (b - 0.15, z + rise + 0.18), (a, z + 0.18)]
        end = [(a, z), (b - 0.2, z), (b - 0.2, z + rise)]
        sheets.append(across_x(slope, x0 - out, x1 + out))
        panes.append(block(x0, b - 0.2, x1, b - 0.08, z + 0.25, z + rise))
        gables += [across_x(end, x - 0.1, x + 0.1) for x in (x0 + _T, x1 - _T)]
        beams.append(block(x0 + 0.3, b - 0.25, x1 - 0.3, b - 0.03, z - 0.35, z + 0.25))
    return [(roof.material, merge(sheets)), ("curtain_wall:#87a3b2", merge(panes)), (wall, merge(gables)),
            ("steel", merge(beams))]  # fmt: skip


def _flat_roof(box: Box, z: float, wall: str, roof: HallRoof) -> Parts:
    x0, y0, x1, y1 = box
    plan = rectangle(*box)
    parts: Parts = [(roof.material, block(x0 + 0.02, y0 + 0.02, x1 - 0.02, y1 - 0.02, z - 0.3, z)),
                    ("concrete", plates(edge_strip(plan, 0.3), z, z + roof.parapet_m))]  # fmt: skip
    for k in range(roof.lights):
        x, y = x0 + (x1 - x0) * (k + 0.5) / roof.lights, (y0 + y1) / 2
        parts.append(("glass:#a9c0cc", block(x - 1.0, y - 2.6, x + 1.0, y + 2.6, z, z + 0.5)))
    return parts


def _gable_roof(box: Box, z: float, wall: str, roof: HallRoof) -> Parts:
    x0, y0, x1, y1 = box
    sheet = pitched_roof(rectangle(*box), z, roof.rise_m, "", roof.material, overhang_m=0.5)[:1]
    along_x = x1 - x0 >= y1 - y0
    low, high, start, end = (y0, y1, x0, x1) if along_x else (x0, x1, y0, y1)
    gable = [(low, z), (high, z), ((low + high) / 2, z + roof.rise_m)]
    walls = [
        across_x(gable, u - 0.12, u + 0.12) if along_x else upright([Polygon(gable)], 0.24, u)
        for u in (start + _T, end - _T)
    ]
    return [*sheet, (wall, merge(walls))]


@site_builder
def warehouse(
    site: Site, *, box: Box, height_m: Number, wall: Material, roof: Material, doors: Material, name: str = "",
    lettering: Material = "#f1f0ea", facing_deg: Number = -90.0, ridge_m: Number = 0.0, category: str = "warehouse",
    on: Number = 0.0,
) -> float:  # fmt: skip
    """Put up a hall with big doors along its front, and a flat or pitched roof; gives the height of its eaves.

    The name stands on the front, which faces a multiple of 90 degrees; without `ridge_m`, the ridge's height over the
    eaves, the roof is flat with a low rim. `on` is the height of the floor.
    """
    x0, y0, x1, y1 = box
    plan, top = rectangle(*box), on + height_m
    parts: Parts = [(wall, block(*box, on, top - 0.02)),
                    ("concrete", slab(edge_strip(plan, 0.02, 0.06), on, on + 0.9))]  # fmt: skip
    if ridge_m:
        parts += pitched_roof(plan, top - 0.02, ridge_m, wall, roof, overhang_m=0.5)
    else:
        parts += [(roof, block(x0 + 0.05, y0 + 0.05, x1 - 0.05, y1 - 0.05, top - 0.02, top)),
                  ("sheet_metal:#6e757c", slab(edge_strip(plan, 0.25, 0.12), top - 0.4, top + 0.3))]  # fmt: skip
    middle = ((x0 + x1) / 2, (y0 + y1) / 2)
    along_x = facing_deg % 180.0 == 90.0
    out, wide = ((y1 - y0) / 2, x1 - x0) if along_x else ((x1 - x0) / 2, y1 - y0)
    count = max(int(wide // 6.5), 1)
    local: Parts = []
    for k in range(count):
        v = (k - (count - 1) / 2) * wide / count
        panels = [block(out, v - 1.9, out + 0.12 - 0.05 * (j % 2), v + 1.9, 0.05 + 0.6 * j, 0.63 + 0.6 * j)
                  for j in range(6)]  # fmt: skip
        local.append((doors, merge(panels)))
        local.append(("#f1f0ea", merge([block(out, v + s - 0.12, out + 0.16, v + s + 0.12, 0.0, 3.8)
                                        for s in (-2.0, 2.0)])))  # fmt: skip
    panes = [block(out, v - 0.9, out + 0.06, v + 0.9, height_m - 1.5, height_m - 0.7)
             for v in np.arange(-wide / 2 + 2.0, wide / 2 - 1.5, 3.0)]  # fmt: skip
    if name:
        panes = panes[:1] + panes[-1:]
        sign = letters(name, 0.9, (out + 0.02, 0.0, height_m - 1.6), 0.0, 0.08)
        local.append((lettering, sign))
    local.append(("window", merge(panes)))
    parts += Frame(*middle, facing_deg).parts(local, on)
    site.add(None, category, parts, footprint=plan)
    return top


@site_builder
def roof_on_columns(site: Site, *, box: Box, height_m: Number, roof: Material, on: Number = 0.0) -> float:
    """Put up a roof on columns that one can fly under; gives the height of its top."""
    x0, y0, x1, y1 = box
    nx, ny = max(round((x1 - x0) / 8.0), 1), max(round((y1 - y0) / 8.0), 1)
    posts = [(x0 + 0.5 + (x1 - x0 - 1.0) * i / nx, y0 + 0.5 + (y1 - y0 - 1.0) * j / ny)
             for i in range(nx + 1) for j in range(ny + 1)]  # fmt: skip
    beams = [block(x - 0.12, y0 + 0.2, x + 0.12, y1 - 0.2, on + height_m - 0.45, on + height_m)
             for x in sorted({p[0] for p in posts})]  # fmt: skip
    parts: Parts = [
        ("steel", columns(posts, on, on + height_m - 0.45, 0.18, 6)),
        ("steel", merge(beams)),
        (roof, block(*box, on + height_m, on + height_m + 0.25)),
    ]
    site.add(None, "open_shed", parts)
    site.occupy_about(posts, 0.3, -100.0, 1000.0)
    return on + height_m + 0.25
