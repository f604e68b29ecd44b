"""Blocks of flats with balconies and an archway, halls of shops cut through by passages, and department stores."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import Polygon

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.grammar import Frame, slab
from aerialdojo_gen.scenes.ground import edge_strip, polygons_of, rectangle
from aerialdojo_gen.scenes.kit import part_builder, site_builder
from aerialdojo_gen.scenes.kit.buildings import Roof, facade, put_up_building
from aerialdojo_gen.scenes.kit.structures import block, canopy, columns, letters, parapet
from aerialdojo_gen.scenes.mesh import Parts, merge
from aerialdojo_gen.scenes.plans.values import Area, At, Box, Material, Number
from aerialdojo_gen.scenes.site import Site

_STOREY_M = 3.2
# From one balcony to the next along the front, its depth and its width.
_PITCH_M, _DEPTH_M, _WIDE_M = 6.4, 1.6, 3.2


@site_builder
def flats(
    site: Site, *, at: At, yaw_deg: Number, size_m: tuple[Number, Number],
    storeys: Annotated[int, Field(ge=2, le=30)], wall: Material, band: Material, name: str, arch_m: Number = 6.0,
    base: Material = "blocks:#8d867a", paving: Material = "paving", roof: Material = "gravel:#a09a90",
) -> float:  # fmt: skip
    """Put up flats, with balconies along the front and a passage through the middle; gives the height of the roof.

    `at` is the middle, `yaw_deg` what the front looks along, `size_m` the length of the front and the depth; the last
    word of the `name` stands on the front.
    """
    frame = Frame(*at, yaw_deg)
    half, d, gap = size_m[0] / 2, size_m[1] / 2, arch_m / 2
    top = storeys * _STOREY_M
    low = rectangle(-d, -half, d, -gap).union(rectangle(-d, gap, d, half))
    site.paint(frame.area(rectangle(-d - 1.2, -gap, d + 4.5, gap)), paving)
    parts: Parts = [
        (base, block(-d, -half, d, -gap, 0.0, _STOREY_M)),
        (base, block(-d, gap, d, half, 0.0, _STOREY_M)),
        ("concrete", block(-d - 0.12, -half - 0.12, d + 0.12, half + 0.12, _STOREY_M - 0.2, _STOREY_M)),
        (band, columns([(s * (d - 0.4), 0.0) for s in (-1, 1)], 0.0, _STOREY_M - 0.2, 0.3)),
    ]
    for s in (-1, 1):
        for side in (-1, 1):
            v = side * (gap + (half - gap) / 2)
            parts.append(("window", block(s * (d - 0.05), v - 0.8, s * (d + 0.05), v + 0.8, 0.0, 2.3)))
            parts.append((band, block(s * d, v - 1.4, s * (d + 1.5), v + 1.4, 2.5, 2.65)))
            for k in (-1, 1):
                w = v + k * (half - gap) * 0.3
                parts.append(("glass", block(s * (d - 0.05), w - 0.7, s * (d + 0.04), w + 0.7, 1.0, 2.2)))
    site.add(None, "flats_base", frame.parts(parts), {"place": name}, footprint=frame.area(low))
    sign: Parts = [("marking", letters(name.split()[-1], 1.8, (d + 0.02, half - 2.4, top - 2.6), 0.0, 0.08))]
    node = site.node("flats")
    put_up_building(
        site, frame.area(rectangle(-d, -half, d, half)), site.laid_out(wall, node, flush=True), Roof(roof),
        (storeys - 1) * _STOREY_M, z=_STOREY_M, node=node, category="flats", attributes={"place": name},
        extra=[*frame.parts(sign), *frame.parts(_balconies(size_m[0], d, storeys, band))],
    )  # fmt: skip
    return top


@part_builder
def long_balconies(
    *, x0: Number, x1: Number, y: Number, z: list[Number], depth_m: Number = 1.1,
    bays: Annotated[int, Field(ge=1, le=100)] = 8, floor: Material = "concrete:#efece4", rail: Material = "iron",
) -> Parts:  # fmt: skip
    """Make balconies along a front that looks to -y, at heights: a slab, and a rail on a post at each bay's end."""
    floors, rails, edge = [], [], y - depth_m
    for level in z:
        floors.append(block(x0, edge, x1, y, level, level + 0.15))
        rails.append(block(x0, edge, x1, edge + 0.06, level + 0.95, level + 1.05))
        rails += [block(x - 0.02, edge, x + 0.03, edge + 0.06, level + 0.15, level + 0.95)
                  for x in np.arange(x0, x1 + 0.1, (x1 - x0) / bays).tolist()]  # fmt: skip
    return [(floor, merge(floors)), (rail, merge(rails))]


def _balconies(length_m: float, d: float, storeys: int, band: str) -> Parts:
    floors, panels, doors = [], [], []
    count = int((length_m - 2.0) // _PITCH_M)
    along = [(k - (count - 1) / 2) * _PITCH_M for k in range(count)]
    for v, z in [(v, _STOREY_M * (s + 1)) for s in range(storeys - 1) for v in along]:
        a, b = v - _WIDE_M / 2, v + _WIDE_M / 2
        floors.append(block(d, a, d + _DEPTH_M, b, z - 0.2, z))
        # Bars in place of parapets: what stands on a balcony is seen.
        for low, high in ((0.0, 0.16), (0.42, 0.46), (0.69, 0.73), (0.94, 1.02)):
            panels.append(block(d + _DEPTH_M - 0.08, a, d + _DEPTH_M, b, z + low, z + high))
            panels += [block(d, w, d + _DEPTH_M - 0.08, w + 0.06, z + low, z + high) for w in (a, b - 0.06)]
        panels += [block(d + _DEPTH_M - 0.08, w, d + _DEPTH_M, w + 0.08, z, z + 1.0) for w in (a, b - 0.08)]
        doors.append(block(d - 0.05, v - 1.1, d + 0.05, v + 1.1, z, z + 2.2))
    return [("concrete", merge(floors)), (band, merge(panels)), ("glass", merge(doors))]


@site_builder
def shopping_hall(
    site: Site, *, node: str, outline: Area, passages: Area, wall: Material, upper_wall: Material,
    category: str = "mall_building", storey_m: Number = 5.0, cornice: Material = "#f0ebdf",
    soffit: Material = "planks:#b08a58", roof: Material = "gravel:#b3aea4",
) -> float:  # fmt: skip
    """Put up a hall of two storeys with passages through the lower one; gives the height of its roof, metres.

    It takes its ground, but for the passages, which are left open of the ground storey; the soffit is their ceiling.
    """
    if not isinstance(outline, Polygon):
        raise AssetError("outline: must be an area in one piece")
    tile = site.catalogue.materials.tile_m
    low, top = outline.difference(passages), 2 * storey_m
    edge = outline.buffer(0.18, join_style="mitre").difference(outline)
    coping = edge_strip(outline, 0.32, 0.12)
    parts: Parts = [(wall, facade(piece, 0.0, storey_m, tile(wall))) for piece in polygons_of(low)]
    parts.append((upper_wall, facade(outline, storey_m, top, tile(upper_wall))))
    parts.append((cornice, slab(edge, storey_m - 0.2, storey_m + 0.1)))
    parts += [(soffit, slab(piece, storey_m - 0.2, storey_m - 0.02)) for piece in polygons_of(passages)]
    parts.append((roof, slab(outline.buffer(-0.02, join_style="mitre"), top - 0.3, top)))
    parts.append((wall, parapet(outline, top, 0.8)))
    parts.append((cornice, slab(coping, top + 0.8, top + 0.95)))
    site.add(node, category, parts, {"storeys": "two"}, footprint=low)
    return top


@site_builder
def anchor_store(
    site: Site, *, node: str, box: Box, height_m: Number, sign: str, wall: Material,
    glass: Material = "curtain_wall", trim: Material = "#f0ebdf",
) -> float:  # fmt: skip
    """Put up a department store, its name and door to the south; gives the height of its roof, metres.

    The box is its plan without the porch and its canopy in front; `sign` is its name, in letters on the front.
    """
    x0, y0, x1, y1 = box
    middle = (x0 + x1) / 2
    door = 7.0
    parts: Parts = [
        (wall, block(x0, y0, x1, y1, 0.0, height_m)),
        (trim, block(x0 - 0.15, y0 - 0.15, x1 + 0.15, y1 + 0.15, height_m, height_m + 0.3)),
        (trim, block(x0 - 0.1, y0 - 0.1, x1 + 0.1, y1 + 0.1, 0.0, 0.6)),
        (trim, block(x0 - 0.1, y0 - 0.1, x1 + 0.1, y1 + 0.1, 5.6, 5.9)),
        (glass, block(middle - door / 2, y0 - 1.6, middle + door / 2, y0, 0.0, 3.8)),
        ("iron", block(middle - door / 2 - 0.2, y0 - 1.7, middle + door / 2 + 0.2, y0, 3.8, 4.1)),
        ("window", block(middle - 1.4, y0 - 1.64, middle + 1.4, y0 - 1.58, 0.05, 2.6)),
        ("chrome", block(middle - 0.05, y0 - 1.7, middle + 0.05, y0 - 1.6, 0.05, 2.6)),
        ("marking", letters(sign, 2.2, (middle, y0, 8.0), -90.0, 0.25)),
    ]
    for side in (-1, 1):
        edge = middle + side * (x1 - x0) * 0.34
        parts.append((glass, block(edge - 2.2, y0 - 0.12, edge + 2.2, y0 + 0.1, 0.8, 4.6)))
        parts.append(("iron", block(edge - 0.06, y0 - 0.18, edge + 0.06, y0 - 0.1, 0.8, 4.6)))
    posts = [(middle - 5.0, y0 - 4.4), (middle + 5.0, y0 - 4.4)]
    parts += canopy((middle - 6.0, y0 - 5.0, middle + 6.0, y0), 4.4, roof=trim, posts=posts)
    site.add(node, "anchor_store", parts, {"sign": sign.lower()}, footprint=rectangle(x0, y0 - 1.7, x1, y1))
    return height_m + 0.3
