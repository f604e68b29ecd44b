"""Buildings of a town, as maps have them: bodies between two heights over outlines, with roofs and shop windows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field
from shapely.geometry import Polygon

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.grammar_buildings import facade
from aerialdojo_gen.scenes.grammar_frames import Parts, block
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.roofs import PARAPET_M, any_roof
from aerialdojo_gen.scenes.mesh import translated
from aerialdojo_gen.scenes.plans.values import Area, Material, Number
from aerialdojo_gen.scenes.site import Site

_SHOP_M = 4.0
# A shop window wants storeys above it, or it is the whole house.
_MIN_ABOVE_M = 2.8
_SUNK_M, _MIN_M2 = 0.3, 0.5


@dataclass(frozen=True)
class Body:
    """A part of a building, between two heights over the lowest ground about the building."""

    outline: Area
    top_m: Annotated[Number, Field(ge=0.5, le=500)]  # The roof is within it
    base_m: Annotated[Number, Field(ge=0, le=400)] = 0.0
    roof: Literal["flat", "gabled", "hipped", "dome"] = "flat"
    roof_m: Annotated[Number, Field(ge=0, le=60)] = 0.0  # Height of the roof over the eaves

    @property
    def plan(self) -> Polygon:
        """Its outline, in one piece."""
        if not isinstance(self.outline, Polygon) or self.outline.area < _MIN_M2:
            raise AssetError(f"outline: must be an area in one piece, of {_MIN_M2:g} square metres or more")
        return self.outline


@dataclass(frozen=True)
class Building:
    """A building of one body or several."""

    bodies: Annotated[list[Body], Field(min_length=1, max_length=100)]
    wall: Material
    roofing: Material = "concrete:#77787a"
    category: str = "building"
    colour: str = ""  # Of its walls, and the street that it is on, as a person says it
    street: str = ""
    name: str = ""  # As on the map
    shops: bool = False  # Whether there are shop windows along its ground floor
    canopy: bool = False  # A roof on posts


@site_builder
def buildings(site: Site, *, buildings: list[Building]) -> None:
    """Put up buildings; each takes its ground.

    Its floor is the lowest ground about it, as maps count heights, and its walls reach a little below.
    """
    for one in buildings:
        plans, base = [body.plan for body in one.bodies], building_base(site, one)
        parts: Parts = []
        for body, plan in zip(one.bodies, plans, strict=True):
            parts += _canopy(body, plan, base, one) if one.canopy else _body(site, body, plan, base, one)
        attributes = {"colour": one.colour} if one.colour else {}
        attributes |= {"place": f"on {one.street}"} if one.street else {}
        instance = site.add(None, one.category, parts, attributes)
        low = float(instance.bounds[0, 2])
        for plan, body in zip(plans, one.bodies, strict=True):
            # What stands on a flat roof stands within its parapet.
            top = base + body.top_m - (PARAPET_M if body.roof == "flat" else 0.0)
            site.occupy(plan.buffer(0.15), low if body.base_m < 3.0 else base + body.base_m, top - 0.01)


def building_base(site: Site, building: Building) -> float:
    """Height of a building's ground floor: the lowest ground about it, metres."""
    return min(site.ground_z(x, y) for body in building.bodies for x, y in body.plan.exterior.coords)


def _body(site: Site, body: Body, plan: Polygon, base: float, building: Building) -> Parts:
    top, foot = base + body.top_m, base + body.base_m
    rise = min(body.roof_m, body.top_m - body.base_m - 1.0) if body.roof != "flat" else 0.0
    rise = rise if rise >= 0.3 else 0.0
    eaves, parts = top - rise, Parts()
    tile = site.catalogue.materials.tile_m
    if body.base_m <= 0.0:
        parts.append(("stone", facade(plan, foot - _SUNK_M, foot, tile("stone"))))
    else:
        parts += [(building.wall, slab(p, foot, foot + 0.2)) for p in polygons_of(plan.buffer(-0.01))]
    if building.shops and body.base_m <= 0.0 and eaves - foot >= _SHOP_M + _MIN_ABOVE_M:
        parts.append(("shopfront", facade(plan, foot, foot + _SHOP_M, tile("shopfront"))))
        foot += _SHOP_M
    parts.append((building.wall, facade(plan, foot, eaves, tile(building.wall))))
    return parts + any_roof(plan, top, rise, body.roof if rise else "flat", building.wall, building.roofing)


def _canopy(body: Body, plan: Polygon, base: float, building: Building) -> Parts:
    top = base + body.top_m
    parts = [(building.roofing, slab(p, top - 0.35, top)) for p in polygons_of(plan)]
    inner = plan.buffer(-0.4, join_style="mitre")
    corners = [c for p in polygons_of(inner) for c in p.simplify(1.0).exterior.coords[:-1]]
    post = block(-0.12, -0.12, 0.12, 0.12, base - _SUNK_M, top - 0.3)
    return parts + [("steel", translated(post, (x, y, 0.0))) for x, y in corners]
