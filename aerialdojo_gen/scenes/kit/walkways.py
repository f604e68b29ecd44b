"""Walkways over ground and water: on stilts, and on piles."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import LineString

from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, columns, deck, railing, stairs
from aerialdojo_gen.scenes.plans.values import Line, Material, Number
from aerialdojo_gen.scenes.site import Site


@site_builder
def raised_walkway(
    site: Site, *, line: Line, z_m: Number, stair_yaws: tuple[Number, Number], width_m: Number = 3.2,
    stilts: Material = "wood", floor: Material = "boards:#a98a62", under: Material = "planks:#7d6446",
    spacing_m: Annotated[Number, Field(ge=1.0)] = 5.0, run_m: Number = 5.4, node: str | None = None,
) -> None:  # fmt: skip
    """Lead a walkway on stilts along a line, with railings, and stairs that climb to its ends in two directions."""
    middle = LineString(line)
    parts: Parts = []
    for p in (middle.interpolate(s) for s in np.arange(1.0, middle.length, spacing_m)):
        x, y = float(p.x), float(p.y)
        parts.append((stilts, columns([(x, y)], site.ground_z(x, y) - 0.2, z_m - 0.3, 0.2)))
    plan = middle.buffer(width_m / 2, cap_style="flat", join_style="mitre")
    parts += deck(plan, z_m, floor=floor, under=under)
    for side in (-1, 1):
        rim = middle.offset_curve(side * (width_m / 2 - 0.1), join_style="mitre")
        for leg in getattr(rim, "geoms", [rim]):
            parts += railing([(float(x), float(y)) for x, y in leg.coords], z_m, pane="iron", height_m=0.95)
    for (x, y), yaw in zip((line[0], line[-1]), stair_yaws, strict=True):
        back = (x - run_m * float(np.cos(np.radians(yaw))), y - run_m * float(np.sin(np.radians(yaw))))
        foot = site.ground_z(*back)
        parts += stairs(back, yaw, width_m - 0.6, z_m - foot, run_m, z_m=foot, tread=under)
    site.add(node, "raised_walkway", parts, {"material": "wooden"})


@part_builder
def piles(
    *, line: Line, z: tuple[Number, Number], spacing_m: Annotated[Number, Field(ge=0.2)] = 3.0,
    radius_m: Number = 0.16, material: Material = "wood",
) -> Parts:  # fmt: skip
    """Drive piles along a line, at its corners and at most `spacing_m` apart."""
    at = [(float(x), float(y)) for x, y in LineString(line).segmentize(spacing_m).coords]
    return [(material, columns(at, *z, radius_m))]
