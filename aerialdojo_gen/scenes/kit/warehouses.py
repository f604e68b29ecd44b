"""Warehouses and other halls with big doors, and roofs on columns."""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import edge_strip, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, letters
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.plans.values import Box, Material, Number
from aerialdojo_gen.scenes.site import Site


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
    if panes:
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
    for x, y in posts:
        site.occupy(rectangle(x - 0.3, y - 0.3, x + 0.3, y + 0.3))
    return on + height_m + 0.25
