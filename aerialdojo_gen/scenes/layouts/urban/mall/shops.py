"""Shopping buildings of urban layouts: shells, rows of shop fronts, anchor stores, and what stands on their roofs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import facade
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, Point, block, canopy, letters, parapet
from aerialdojo_gen.scenes.site import Site

STOREY_M = 5.0
_SHOPS = (
    "books", "shoes", "bakery", "sport", "pharmacy", "toys", "flowers", "phones", "fashion", "coffee", "games",
    "jewels",
)  # fmt: skip


def shopping_hall(site: Site, plan: Polygon, passage: BaseGeometry, *, node: str, category: str) -> None:
    """Put up a hall of two storeys, its ground storey cut through by a passage that one can fly along.

    Parameters
    ----------
    site : Site
        Where; its palette may name ``shop_wall``, ``upper_wall``, ``roof`` and ``cornice``.
    plan : Polygon
        Outline, metres.
    passage : Polygon or MultiPolygon
        What is left open of the ground storey.
    node, category : str
        Names of the structure.
    """
    wall = site.material("shop_wall", "plaster:#d9cdb8")
    upper = site.material("upper_wall", "facade_office:#d6cab4")
    cornice = site.material("cornice", "#f0ebdf")
    tile = site.catalogue.materials.tile_m
    low, top = plan.difference(passage), 2 * STOREY_M
    parts: Parts = []
    for piece in getattr(low, "geoms", [low]):
        parts.append((wall, facade(piece, 0.0, STOREY_M, tile(wall))))
    parts.append((upper, facade(plan, STOREY_M, top, tile(upper))))
    parts.append(
        (cornice, slab(plan.buffer(0.18, join_style="mitre").difference(plan), STOREY_M - 0.2, STOREY_M + 0.1))
    )
    for piece in getattr(passage, "geoms", [passage]):
        parts.append((site.material("soffit", "planks:#b08a58"), slab(piece, STOREY_M - 0.2, STOREY_M - 0.02)))
    parts.append(
        (site.material("roof", "gravel:#b3aea4"), slab(plan.buffer(-0.02, join_style="mitre"), top - 0.3, top))
    )
    parts.append((wall, parapet(plan, top, 0.8)))
    coping = plan.buffer(0.12, join_style="mitre").difference(plan.buffer(-0.32, join_style="mitre"))
    parts.append((cornice, slab(coping, top + 0.8, top + 0.95)))
    site.add(node, category, parts, {"storeys": "two"}, footprint=low)


def anchor_store(
    site: Site, x0: float, y0: float, x1: float, y1: float, height_m: float, *, sign: str, wall: str, node: str
) -> None:
    """Put up a department store's front: a taller block with its name in letters to the south, and a canopy."""
    middle = (x0 + x1) / 2
    door = 7.0
    glass = site.material("entrance_glass", "curtain_wall")
    trim = "#f0ebdf"
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
    parts += canopy(middle - 6.0, y0 - 5.0, middle + 6.0, y0, 4.4, roof=trim, posts=posts)
    site.add(node, "anchor_store", parts, {"sign": sign.lower()}, footprint=rectangle(x0, y0 - 1.7, x1, y1))


def shop_row(
    site: Site, centres: Sequence[Point], yaw_deg: float, place: str, names: Iterator[str], *, z: float | None = None
) -> None:
    """Set shop fronts against a wall; `centres` lie in the wall's plane, `yaw_deg` looks away from it."""
    for x, y in centres:
        site.place("storefront", x, y, yaw_deg, z=z, variant=next(names), attributes={"place": place})


def shop_names(start: int = 0) -> Iterator[str]:
    """Name shops without end, every name once before one comes again."""
    k = start
    while True:
        yield _SHOPS[k % len(_SHOPS)]
        k += 1
