"""The yards of building sites and terminals: hoardings, offices, bays, foundations; containers, masts, heaps."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import LineString

from aerialdojo_gen.scenes.grammar import Frame, leg, plates
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.steelwork import guard_rails, posts
from aerialdojo_gen.scenes.kit.structures import block, columns, letters, stairs
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import Area, At, Line, Material, Materials, Number
from aerialdojo_gen.scenes.shapes import box, cone, crown
from aerialdojo_gen.scenes.site import Site

CABIN_M = (2.6, 6.2, 2.75)
_Count = Annotated[int, Field(ge=1, le=40)]


@site_builder
def hoarding(
    site: Site, *, line: Line, boards: Material, third: Material = "#e8e6df", name: str = "", height_m: Number = 2.4,
) -> None:  # fmt: skip
    """Fence a site along a line: panels on posts, every third one of another material and with a name outside."""
    parts: Parts = []
    wood: list[Mesh] = []
    count = 0
    for a, b in pairwise(line):
        length, yaw = leg(a, b)
        turn = rotation(0.0, 0.0, yaw)
        n = max(round(length / 4.0), 1)
        wide = length / n
        c, s = np.cos(np.radians(yaw - 90)), np.sin(np.radians(yaw - 90))
        for k in range(n):
            t = (k + 0.5) / n
            x, y = a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t
            z = site.ground_z(x, y)
            panel = rotated(box(size=[wide - 0.06, 0.06, height_m - 0.15]), turn)
            rail = rotated(box(size=[wide, 0.16, 0.12]), turn)
            post = (a[0] + (b[0] - a[0]) * k / n, a[1] + (b[1] - a[1]) * k / n, z)
            parts.append((boards if count % 3 else third, translated(panel, (x, y, z + 0.12))))
            wood += [translated(rail, (x, y, z + height_m - 0.03)),
                     translated(box(size=[0.14, 0.14, height_m]), post)]  # fmt: skip
            if name and count % 3 == 0:
                at = (x + 0.04 * c, y + 0.04 * s, z + 1.1)
                parts.append(("marking", letters(name, 0.5, at, yaw - 90.0, 0.03)))
            count += 1
    plan = LineString(line).buffer(0.15, cap_style="flat", join_style="mitre")
    site.add(None, "hoarding", [("wood:#7a664c", merge(wood)), *parts], footprint=plan)


@site_builder
def site_offices(
    site: Site, *, at: At, yaw_deg: Number = 0.0, columns: _Count, storeys: _Count,
    colours: Materials, on: Number = 0.0,
) -> float:  # fmt: skip
    """Stack cabins, with galleries and stairs along their front; gives the height of the stack's roof.

    `at` is the middle of the back, on ground at the height `on`; the cabins take the colours in turn.
    """
    wide, deep, high = CABIN_M
    half = columns * wide / 2
    parts: Parts = []
    for s in range(storeys):
        z = 0.15 + s * high
        for k in range(columns):
            parts += _cabin(-half + k * wide, z, colours[(k + 2 * s) % len(colours)])
        if s:
            parts.append(("sheet_metal", block(deep, -half, deep + 1.25, half + 1.3, z - 0.1, z)))
            edge = [(deep + 1.15, -half + 0.1), (deep + 1.15, half - (0.1 if s > 1 else 0.0))]
            parts += guard_rails(LineString(edge), z)
            feet = [(deep + 1.15, v) for v in (-half + 0.1, 0.0, half - 0.1)]
            parts.append(("metal", posts(feet, 0.0, z - 0.1, 0.12)))
        if s + 1 < storeys:
            # Each flight climbs away from the stack's side, one above the other.
            foot = (deep + 0.6, half + 0.1 + 4.4)
            parts += stairs(foot, -90.0, 1.1, high, 4.4, z_m=z if s else 0.0, tread="sheet_metal")
    top = 0.15 + storeys * high
    parts.append(("sheet_metal:#8f9598", block(0.0, -half, deep, half, top - 0.06, top)))
    frame = Frame(*at, yaw_deg)
    plan = rectangle(0.0, -half, deep + 1.25, half + (4.8 if storeys > 1 else 0.0))
    body = rectangle(-0.1, -half, deep + 1.25, half)
    site.add(None, "site_offices", frame.parts(parts, on))
    site.occupy(frame.area(body), on - 1.0, on + top - 0.05)
    site.occupy(frame.area(plan.difference(body)), on - 1.0, on + top - 0.05)
    return on + top


def _cabin(v: float, z: float, colour: str) -> Parts:
    wide, deep, high = CABIN_M
    frame = [block(-0.04, v, deep + 0.04, v + wide, z + d, z + d + 0.14) for d in (0.0, high - 0.2)]
    return [
        (colour, block(0.0, v + 0.03, deep, v + wide - 0.03, z, z + high - 0.06)),
        ("metal", merge(frame)),
        ("window", block(deep - 0.02, v + 1.35, deep + 0.05, v + 2.35, z + 1.0, z + 2.1)),
        ("#f2f0ea", block(deep - 0.02, v + 0.25, deep + 0.06, v + 1.1, z + 0.14, z + 2.15)),
        ("window", block(-0.05, v + 0.7, 0.02, v + 1.9, z + 1.0, z + 2.1)),
    ]


@site_builder
def aggregate_bays(
    site: Site, *, at: At, yaw_deg: Number = 0.0, materials: Materials,
    bay_m: tuple[Number, Number] = (5.0, 5.0), wall: Material = "blocks",
) -> None:  # fmt: skip
    """Build open bays (depth, width) side by side, each with a heap of its material.

    `at` is the middle of their back, and they open along `yaw_deg`.
    """
    (deep, wide), n = bay_m, len(materials)
    frame, half = Frame(*at, yaw_deg), n * wide / 2
    z = min(site.ground_z(*frame.at(u, v)) for u in (0.0, deep) for v in (-half, half))
    for k, material in enumerate(materials):
        low, last = -half + k * wide, k == n - 1
        high = low + wide
        walls = [block(-0.3, low - 0.3, 0.3, high - 0.3, 0.0, 2.4), block(0.3, low - 0.3, deep, low + 0.3, 0.0, 2.4)]
        if last:
            walls += [block(-0.3, high - 0.3, 0.3, high + 0.3, 0.0, 2.4),
                      block(0.3, high - 0.3, deep, high + 0.3, 0.0, 2.4)]  # fmt: skip
        heap = crown(radii=(deep * 0.48, wide * 0.42, 1.9), noise=0.12, seed=k + 3)
        heap = translated(heap, (deep * 0.48, low + wide / 2, 0.0))
        # What lies below the ground is pressed flat.
        heap = Mesh(np.maximum(heap.vertices, (-np.inf, -np.inf, -0.05)), heap.faces)
        area = rectangle(-0.3, low - 0.3, deep + 0.3, high + (0.3 if last else -0.31))
        parts: Parts = [(wall, merge(walls)), (material, heap)]
        site.add(None, "aggregate_bay", frame.parts(parts, z), footprint=frame.area(area))


@site_builder
def precast_racks(
    site: Site, *, at: list[At], yaw_deg: Number = 0.0, panels: _Count, length_m: Number,
    material: Material = "concrete:#c2beb4", rack: Material = "paint:#c9542c",
) -> None:  # fmt: skip
    """Stand precast wall panels on edge in racks, side by side along `yaw_deg`."""
    wide, out = (panels - 1) * 0.62 + 0.2, length_m * 0.35
    body = [block(k * 0.62, -length_m / 2, k * 0.62 + 0.2, length_m / 2, 0.25, 3.1) for k in range(panels)]
    feet = [block(-0.5, v - 0.12, wide + 0.5, v + 0.12, 0.0, 0.25) for v in (-out, out)]
    masts = [block(u, v - 0.1, u + 0.16, v + 0.1, 0.0, 3.4) for u in (-0.3, wide + 0.14) for v in (-out, out)]
    parts: Parts = [(material, merge(body)), (rack, merge([*feet, *masts]))]
    plan = rectangle(-0.6, -length_m / 2, wide + 0.6, length_m / 2)
    for x, y in at:
        frame = Frame(x, y, yaw_deg)
        world = frame.parts(parts, site.ground_z(x, y))
        site.add(None, "precast_rack", world, footprint=frame.area(plan))


@site_builder
def raft_foundation(
    site: Site, *, area: Area, z: tuple[Number, Number], columns: list[At] = [],  # noqa: B006
    walls: list[tuple[At, At]] = [], material: Material = "concrete:#b9b5ab",  # noqa: B006
) -> float:  # fmt: skip
    """Cast a raft between two heights, with bars for columns, and walls that stand half formed; gives its top.

    Walls are 3 m high, with panels of formwork to the right of their lines.
    """
    z0, top = z
    parts: Parts = [(material, plates(area, z0, top))]
    dots = [(x + i * 0.2, y + j * 0.2) for x, y in columns for i in (-1, 1) for j in (-1, 1)]
    parts.append(("rust", posts(dots, top, top + 1.6, 0.045)))
    parts += [("rust", posts(columns, top + low, top + low + 0.06, 0.46)) for low in (0.5, 1.1)]
    for a, b in walls:
        line = LineString([a, b])
        n = max(round(line.length / 1.4), 1)
        tops = [line.interpolate(line.length * (k + 0.5) / n) for k in range(n)]
        side = line.buffer(-0.32, cap_style="flat", single_sided=True).difference(line.buffer(0.16, cap_style="flat"))
        wall: Parts = [
            ("concrete", plates(line.buffer(0.15, cap_style="flat"), top, top + 3.0)),
            ("rust", posts([(p.x, p.y) for p in tops], top + 3.0, top + 3.8, 0.05)),
            ("planks:#d1a03c", plates(side, top + 0.05, top + 2.8)),
        ]
        site.add(None, "raft_wall", wall)
        site.occupy(line.buffer(0.5, cap_style="flat"), top - 0.2, top + 3.8)
    site.add(None, "foundation", parts)
    site.occupy_about(columns, 0.35, top - 0.2, top + 1.6)
    return top


LONG_M, WIDE_M, HIGH_M = 12.19, 2.44, 2.59
COLOURS = ("#a83c32", "#2f5f9e", "#4c8a5a", "#d0702c", "#8d8f92", "#d9b03a", "#6a4a3a", "#dfe2e2")
_Row = Annotated[list[Annotated[int, Field(ge=0, le=8)]], Field(min_length=1, max_length=20)]


@dataclass(frozen=True)
class Stack:
    """Containers in bays end to end and rows side by side."""

    at: At  # Its south-west corner before it is turned about it, metres
    tiers: Annotated[list[_Row], Field(min_length=1, max_length=20)]  # Of every row (along y) of every bay (along x)


@site_builder
def container_stacks(site: Site, *, stacks: list[Stack], yaw_deg: Number = 0.0, on: Number = 0.0) -> None:
    """Stack long containers on a floor at the height `on`; every stack takes its ground."""
    for stack in stacks:
        rng = site.rng_for("stack", *stack.at)
        bodies: dict[str, list[Mesh]] = {}
        dark: list[Mesh] = []
        for i, bay in enumerate(stack.tiers):
            for j, high in enumerate(bay):
                for k in range(high):
                    colour = COLOURS[int(rng.integers(len(COLOURS)))]
                    u, v, w = i * (LONG_M + 0.5), j * (WIDE_M + 0.12), k * HIGH_M
                    body = block(u, v, u + LONG_M, v + WIDE_M, w, w + HIGH_M - 0.04)
                    bodies.setdefault(colour, []).append(body)
                    for end, out in ((u, -1), (u + LONG_M, 1)):
                        a, b = sorted((end, end + out * 0.03))
                        dark += [block(a, v + s, b, v + s + 0.07, w + 0.1, w + 2.4) for s in (0.35, 0.95, 1.42, 2.0)]
        made = [*((f"corrugated:{c}", m) for c, m in sorted(bodies.items())), ("#c9ccce", dark)]
        frame = Frame(*stack.at, yaw_deg)
        length = len(stack.tiers) * (LONG_M + 0.5) - 0.5
        width = max(len(bay) for bay in stack.tiers) * (WIDE_M + 0.12) - 0.12
        parts = frame.parts([(name, merge(m)) for name, m in made], on)
        site.add(None, "container_stack", parts, footprint=frame.area(rectangle(0, 0, length, width)))


@site_builder
def light_masts(site: Site, *, at: list[At], foot_m: Number, top_m: Number) -> None:
    """Put up masts with three floodlights below a bar across the top, from `foot_m` to `top_m`."""
    parts: Parts = []
    for x, y in at:
        lamps = [block(x + s - 0.3, y - 0.4, x + s + 0.3, y + 0.4, top_m - 0.3, top_m) for s in (-1.1, 0.0, 1.1)]
        parts.append(("steel", columns([(x, y)], foot_m, top_m, 0.22, 6)))
        parts.append(("#33373b", block(x - 1.6, y - 0.3, x + 1.6, y + 0.3, top_m, top_m + 0.4)))
        parts.append(("light", merge(lamps)))
        site.occupy(disc(x, y, 0.6, 8))
    site.add(None, "light_masts", parts)


@site_builder
def bulk_heaps(
    site: Site, *, heaps: list[tuple[Number, Number, Number, Material]], on: Number = 0.0, steepness: Number = 0.62
) -> None:
    """Heap up cones of bulk goods: x, y, radius and material of each, `steepness` times as high as the radius."""
    parts: Parts = []
    for x, y, radius, material in heaps:
        body = cone(radius=radius, height=radius * steepness, segments=18)
        parts.append((material, translated(body, (x, y, on - 0.02))))
        site.occupy(disc(x, y, radius))
    site.add(None, "bulk_heaps", parts)


@site_builder
def brick_stacks(
    site: Site, *, stacks: list[tuple[Number, Number, Number, Number, Material]], wide_m: Number = 1.8,
    on: Number = 0.0,
) -> None:  # fmt: skip
    """Set up stacks of bricks along x, with a half layer on each: x, y, length, height and material of each."""
    for x, y, long_m, high_m, material in stacks:
        u, v, z = long_m / 2, wide_m / 2, on + high_m
        bodies = [block(x - u, y - v, x + u, y + v, on, z),
                  block(x - u + 0.4, y - v + 0.3, x + u - 1.2, y + v - 0.3, z, z + 0.35)]  # fmt: skip
        site.add(None, "brick_stack", [(material, merge(bodies))], footprint=rectangle(x - u, y - v, x + u, y + v))
