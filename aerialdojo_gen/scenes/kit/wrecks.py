"""What a damaged building is: its size, its look, and what was torn out of it.

A building's own frame has its origin in the middle of the plan, x along its length; its front looks along -y (south
where its yaw is 0). z = 0 is the ground floor.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from pydantic import Field
from shapely.geometry import Point, Polygon

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.wreckage import Bite, remains
from aerialdojo_gen.scenes.plans.values import Material, Number


@dataclass(frozen=True)
class Style:
    """What a building looks like."""

    wall: Material = "plaster:#cfc3ab"
    band: Material = "concrete"  # Of sills and balconies
    floor: Material = "concrete"  # Of the floors' edges and undersides
    inner: Annotated[tuple[Material, ...], Field(min_length=4)] = (
        "plaster:#b9c7b0", "plaster:#c9b0a0", "plaster:#a9b6c4", "plaster:#d3c79a",
    )  # fmt: skip
    roof: Material = "gravel:#8f8a82"
    storey_m: Annotated[Number, Field(ge=2, le=20)] = 3.1
    bay_m: Annotated[Number, Field(ge=1, le=50)] = 3.4
    window_m: tuple[Number, Number, Number] = (1.5, 0.9, 2.3)  # Width, sill and head
    wall_m: Annotated[Number, Field(ge=0.05, le=2)] = 0.28
    columns: bool = True  # Whether a frame of columns carries the floors
    shops: bool = False  # Wide shop windows in the ground storey of the front
    panes: Number = 0.55  # Shares of the windows that kept their panes, and that have a plume of soot above
    soot: Number = 0.0


@dataclass(frozen=True)
class Wreck:
    """A damaged building."""

    frame: Frame
    length_m: float
    depth_m: float
    storeys: int
    style: Style = field(default_factory=Style)
    bites: tuple[Bite, ...] = ()  # In its own frame
    lean_deg: float = 0.0  # How far the whole of it leans to its front
    ridge_m: float = 0.0  # Height of a pitched roof's ridge over the eaves; 0 makes a flat roof
    rooms_m: float = 6.8  # Distance of the partitions across it
    balconies: bool = False  # Whether the front has them

    @property
    def plan(self) -> Polygon:
        """Its outline in its own frame, metres."""
        x, y = self.length_m / 2, self.depth_m / 2
        return rectangle(-x, -y, x, y)

    @property
    def height_m(self) -> float:
        """Height of the eaves, metres."""
        return self.storeys * self.style.storey_m

    def bears(self, x: float, y: float, storey: int, radius_m: float = 0.6) -> bool:
        """Whether a floor (`storeys`: the roof) carries a disc about a point of its own frame."""
        floor = remains(self.plan, storey * self.style.storey_m, self.bites)
        return bool(floor.buffer(-radius_m).contains(Point(x, y)))
