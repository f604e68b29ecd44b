"""Streets: carriageways with marks and pavements, zebra crossings, arrows."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from aerialdojo_gen.scenes import grammar_streets
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.plans.values import Line, Material, Number
from aerialdojo_gen.scenes.site import Site


@site_builder
def streets(
    site: Site, *, paths: list[Line], lanes: Annotated[int, Field(ge=1, le=12)] = 2, lane_m: Number = 3.25,
    pavement_m: Number = 2.0, surface: Material = "asphalt", pavement: Material = "paving", marks: bool = True,
) -> None:  # fmt: skip
    """Paint streets that may cross, along their middle lines."""
    grammar_streets.streets(
        site, paths, lanes=lanes, lane_m=lane_m, pavement_m=pavement_m, surface=surface, pavement=pavement,
        marks=marks,
    )  # fmt: skip


@site_builder
def crossings(
    site: Site, *, at: list[tuple[Number, Number, Number, Number]], width_m: Number = 3.0,
    surface: Material = "asphalt",
) -> None:  # fmt: skip
    """Paint zebra crossings: middle, direction of walking and length of each (x, y, yaw_deg, length_m)."""
    for one in at:
        grammar_streets.crossing(site, *one, width_m, surface)


@site_builder
def arrows(
    site: Site, *, at: list[tuple[Number, Number, Number]], length_m: Number = 3.0, material: Material = "marking"
) -> None:
    """Paint straight arrows on the ground: middle and direction of each (x, y, yaw_deg)."""
    for one in at:
        grammar_streets.arrow(site, *one, length_m, material)
