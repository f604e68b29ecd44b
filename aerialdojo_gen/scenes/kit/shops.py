"""Shopping buildings: halls of shops cut through by passages, and department stores."""

from __future__ import annotations

from shapely.geometry import Polygon

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.grammar_buildings import facade
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import edge_strip, polygons_of, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy, letters, parapet
from aerialdojo_gen.scenes.plans.values import Area, Box, Material, Number
from aerialdojo_gen.scenes.site import Site


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
