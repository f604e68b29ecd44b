"""Roofs, as parts of structures."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof
from aerialdojo_gen.scenes.grammar_frames import Parts
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import part_builder
from aerialdojo_gen.scenes.plans.values import Material, Number


@part_builder
def gable_roof(
    box: tuple[Number, Number, Number, Number],
    z: Number,
    rise_m: Number,
    wall: Material,
    roof: Material,
    hip: bool = False,
    overhang_m: Number = 0.4,
) -> Parts:
    """Make a gable or hip roof over a rectangle, the ridge along its longer side."""
    return pitched_roof(rectangle(*box), z, rise_m, wall, roof, hip=hip, overhang_m=overhang_m)
