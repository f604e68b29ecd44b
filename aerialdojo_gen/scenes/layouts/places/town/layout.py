"""A town as a map has it: ground, streets, buildings, things, and what such streets have by rule."""

from __future__ import annotations

import shapely

from aerialdojo_gen.scenes.layouts.places.town.buildings import put_up
from aerialdojo_gen.scenes.layouts.places.town.model import Parameters
from aerialdojo_gen.scenes.layouts.places.town.streets import lay
from aerialdojo_gen.scenes.layouts.places.town.things import by_rule, set_out
from aerialdojo_gen.scenes.site import Site

__all__ = ["Parameters", "build"]


def build(site: Site) -> None:
    """Build the town."""
    p: Parameters = site.parameters
    site.set_ground(p.heights.terrain(site.recipe.size_m) if p.heights else None, p.ground)
    for area in p.areas:
        site.paint(area.plan, area.material)
    wet = [area.plan for area in p.areas if area.material.startswith("water")]
    streets = lay(site, p)
    for building in p.buildings:
        put_up(site, building)
    if wet:
        site.occupy(shapely.union_all(wet))
    set_out(site, p, streets)
    by_rule(site, p, streets)
