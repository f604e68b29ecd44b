"""Plain bodies over an area, as parts of structures."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_frames import Parts
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.kit import part_builder
from aerialdojo_gen.scenes.plans.values import Area, Material, Number


@part_builder
def area_slab(area: Area, z: tuple[Number, Number], role: Material) -> Parts:
    """Extrude an area between two heights: a deck, a hull, walls around a yard."""
    return [(role, slab(piece, *z)) for piece in polygons_of(area)]
