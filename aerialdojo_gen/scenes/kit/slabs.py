"""Plain bodies over an area, as parts of structures."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_frames import Parts
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.kit import part_builder
from aerialdojo_gen.scenes.plans.values import Areas, Material, Number


@part_builder
def area_slab(area: Areas, z: tuple[Number, Number], role: Material) -> Parts:
    """Extrude an area, or several, between two heights: a deck, a hull, walls around a yard, panes of a front."""
    return [(role, slab(piece, *z)) for one in area for piece in polygons_of(one)]
