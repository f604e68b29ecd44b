"""What closes and covers stands: outer walls with gateways, walls at their ends, platforms, roofs on trusses."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import Pose, slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.kit import part_builder
from aerialdojo_gen.scenes.kit.stands import QUARTER, Tier, passage
from aerialdojo_gen.scenes.kit.steelwork import plates
from aerialdojo_gen.scenes.kit.structures import Parts, block, letters
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.plans.values import Areas, At, Material, Number
from aerialdojo_gen.scenes.shapes_extruded import sweep


@part_builder
def stand_ends(*, tier: Tier, strips: Areas, material: Material) -> Parts:
    """Close a tier's ends: stepped walls in strips across its rows, up to a handrail's height over each."""
    bodies = []
    for strip in strips:
        for row in range(tier.rows):
            area = tier.band(row).intersection(strip)
            bodies += [slab(p, tier.foot_m, tier.level_m(row) + 0.8) for p in polygons_of(area)]
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
    ring = back.buffer(thickness_m, join_style="mitre").difference(back)
    cornice = back.buffer(thickness_m + 0.2, join_style="mitre").difference(back)
    openings = unary_union(passages)
    if tier.region is not None:
        ring, cornice = ring.intersection(tier.region), cornice.intersection(tier.region)
    walls = [slab(p, tier.foot_m, top_m) for p in polygons_of(ring.difference(openings))]
    walls += [slab(p, tier.foot_m + gate_m[1], top_m) for p in polygons_of(ring.intersection(openings))]
    frames = unary_union([g.buffer(0.25, join_style="mitre").difference(g) for g in passages]).intersection(cornice)
    trims = [slab(p, top_m - 0.45, top_m + 0.12) for p in polygons_of(cornice)]
    trims += [slab(p, tier.foot_m, tier.foot_m + gate_m[1]) for p in polygons_of(frames.difference(openings))]
    return [(wall, merge(walls)), (band, merge(trims))]


@part_builder
def stand_walkway(*, tier: Tier, depth_m: Number, thickness_m: Number = 0.35, material: Material) -> Parts:
    """Lay a level walkway before a tier's front edge, at the height of its foot."""
    before = tier.core.buffer(tier.front_m - depth_m, quad_segs=QUARTER)
    area = tier.edge(0).difference(before)
    if tier.region is not None:
        area = area.intersection(tier.region)
    return [(material, slab(p, tier.foot_m - thickness_m, tier.foot_m)) for p in polygons_of(area)]


@part_builder
def stand_platforms(*, areas: Areas, z: tuple[Number, Number], floor: Material, rim: Material) -> Parts:
    """Make level platforms among the rows, between two heights, with a low rim on which nothing is hung."""
    parts: Parts = []
    for area in areas:
        inner = area.buffer(-0.12, join_style="mitre")
        rims = [slab(p, z[1], z[1] + 0.12) for p in polygons_of(area.difference(inner))]
        parts += [(floor, plates(area, *z)), (rim, merge(rims))]
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
