"""What stands about yards and terminals: stacked containers, light masts, heaps of bulk goods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns
from aerialdojo_gen.scenes.mesh import Mesh, merge, translated
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.shapes import cone
from aerialdojo_gen.scenes.site import Site

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
