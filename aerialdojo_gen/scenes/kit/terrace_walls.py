"""Retaining walls of terraces, with hedges on them, and flights of stairs between them."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.ops import unary_union

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, block
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.plans.values import Material, Number
from aerialdojo_gen.scenes.site import Site


@site_builder
def terrace_walls(
    site: Site, *, steps: list[tuple[Number, Number, Number]], half_m: Number, stair_m: Number, stone: Material,
    tread: Material, hedge: Material, treads: Annotated[int, Field(ge=2, le=60)] = 10, node: str | None = None,
) -> None:  # fmt: skip
    """Put up planted double walls along x at steps (y, lower level, upper level), with stairs in their middle.

    The walls reach from `stair_m` to `half_m` on both sides; the stairs climb north between two cheeks.
    """
    parts: Parts = []
    areas = []
    for at, low, high in steps:
        for s in (-1, 1):
            x0, x1 = sorted((s * stair_m, s * half_m))
            parts.append((stone, block(x0, at - 0.6, x1, at - 0.25, low - 0.3, high + 0.5)))
            parts.append((stone, block(x0, at + 0.5, x1, at + 0.75, high - 0.6, high + 0.5)))
            parts.append(("soil", block(x0, at - 0.25, x1, at + 0.5, low, high + 0.42)))
            for a in np.arange(x0 + 0.4, x1 - 2.4, 2.9):
                parts.append((hedge, block(a, at - 0.2, a + 2.3, at + 0.45, high + 0.42, high + 1.05)))
            areas.append(rectangle(x0, at - 0.6, x1, at + 0.75))
            a, b = sorted((s * stair_m, s * stair_m - s * 0.4))
            parts.append((stone, block(a, at - 4.2, b, at + 0.75, low - 0.3, high + 0.5)))
        rise, run = (high - low) / treads, 3.6 / treads
        flight = [
            block(-stair_m + 0.4, at - 3.6 + run * i, stair_m - 0.4, at + 0.9, low - 0.1, low + rise * (i + 1))
            for i in range(treads)
        ]
        parts.append((tread, merge(flight)))
    site.add(node, "terrace_wall", parts, {"material": "stone"}, footprint=unary_union(areas))
