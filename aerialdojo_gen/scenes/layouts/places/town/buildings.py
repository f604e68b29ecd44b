"""Buildings of a town."""

from __future__ import annotations

from shapely.geometry import Polygon

from aerialdojo_gen.scenes.grammar_buildings import facade
from aerialdojo_gen.scenes.grammar_frames import block
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.layouts.places.town.model import Body, Building
from aerialdojo_gen.scenes.layouts.places.town.roofs import PARAPET_M, Parts, roof
from aerialdojo_gen.scenes.mesh import translated
from aerialdojo_gen.scenes.site import Site

_SHOP_M = 4.0
# A shop window wants storeys above it, or it is the whole house.
_LEAST_ABOVE_M = 2.8
_SUNK_M = 0.3


def put_up(site: Site, building: Building) -> None:
    """Put up a building; it takes its ground.

    Its floor is the lowest ground about it, as OpenStreetMap counts heights, and its walls reach a little below.
    """
    plans, base = [body.plan for body in building.bodies], building_base(site, building)
    parts: Parts = []
    for body, plan in zip(building.bodies, plans, strict=True):
        parts += _canopy(body, plan, base, building) if building.canopy else _body(site, body, plan, base, building)
    attributes = {"colour": building.colour} if building.colour else {}
    attributes |= {"place": f"on {building.street}"} if building.street else {}
    instance = site.add(None, building.category, parts, attributes)
    low = float(instance.bounds[0, 2])
    for plan, body in zip(plans, building.bodies, strict=True):
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
    if building.shops and body.base_m <= 0.0 and eaves - foot >= _SHOP_M + _LEAST_ABOVE_M:
        parts.append(("shopfront", facade(plan, foot, foot + _SHOP_M, tile("shopfront"))))
        foot += _SHOP_M
    parts.append((building.wall, facade(plan, foot, eaves, tile(building.wall))))
    return parts + roof(plan, top, rise, body.roof if rise else "flat", building.wall, building.roofing)


def _canopy(body: Body, plan: Polygon, base: float, building: Building) -> Parts:
    top = base + body.top_m
    parts = [(building.roofing, slab(p, top - 0.35, top)) for p in polygons_of(plan)]
    inner = plan.buffer(-0.4, join_style="mitre")
    corners = [c for p in polygons_of(inner) for c in p.simplify(1.0).exterior.coords[:-1]]
    post = block(-0.12, -0.12, 0.12, 0.12, base - _SUNK_M, top - 0.3)
    return parts + [("steel", translated(post, (x, y, 0.0))) for x, y in corners]
