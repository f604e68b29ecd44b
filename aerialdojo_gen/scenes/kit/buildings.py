"""Whole buildings on an outline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shapely.geometry import Polygon

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes import grammar_buildings
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.plans.values import Area, Bodies, Material, Number
from aerialdojo_gen.scenes.site import Site

_RoofKind = Literal["flat", "gable", "hip"]


@site_builder
def building(
    site: Site, *, outline: Area, wall: Material, roof: Material, storeys: int = 2, storey_m: Number = 3.2,
    roof_kind: _RoofKind = "flat", roof_m: Number = 2.5, parapet_m: Number = 0.6, overhang_m: Number = 0.4,
    on: Number | None = None, category: str = "building", attributes: dict[str, str] = {},  # noqa: B006
    extra: Bodies = [],  # noqa: B006
) -> float:  # fmt: skip
    """Put up a building on an outline, on its lowest corner's ground; gives the height of its walls' top, metres."""
    if not isinstance(outline, Polygon):
        raise AssetError("outline: must be an area in one piece")
    z = min(site.ground_z(x, y) for x, y in outline.exterior.coords) if on is None else on
    height_m, form = storeys * storey_m, grammar_buildings.Roof(roof, roof_kind, roof_m, parapet_m, overhang_m)
    grammar_buildings.building(
        site, outline, wall, form, height_m, z=z, category=category, attributes=attributes, extra=extra
    )
    return z + height_m


@dataclass(frozen=True)
class Block:
    """One of several plain buildings."""

    outline: Area
    wall: Material
    storeys: int = 2
    roof: Material | None = None  # Its own, and the kind of it
    roof_kind: _RoofKind = "flat"


@site_builder
def town_blocks(
    site: Site, *, blocks: list[Block], roof: Material, storey_m: Number = 3.2, roof_m: Number = 2.5,
    overhang_m: Number = 0.4, on: Number | None = None, category: str = "town_block",
) -> None:  # fmt: skip
    """Put up plain buildings, each on its own outline; their roofs are flat where they say no other kind."""
    for one in blocks:
        building(
            site, outline=one.outline, wall=one.wall, storeys=one.storeys, storey_m=storey_m, roof=one.roof or roof,
            roof_kind=one.roof_kind, roof_m=roof_m, overhang_m=overhang_m, on=on, category=category,
        )  # fmt: skip
