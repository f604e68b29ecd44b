"""A courtyard drawn by hand: walls, roofs on posts and props stand where the recipe says.

The smallest way to a scene: no generator, every coordinate in the recipe. The smoke pipeline's scenes are of it.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from aerialdojo_gen.scenes.grammar_scatter import slab, wall
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.mesh import translated
from aerialdojo_gen.scenes.shapes import cylinder
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.values import At, Box, Degrees, Metres, Roof, Stretch

_POST_RADIUS_M = 0.12
_ROOF_M = 0.2


class Thing(BaseModel):
    """A prop of the catalogue: where it stands and where it looks."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    category: str
    at: At
    yaw: Degrees = 0.0
    z: Metres | None = None
    variant: str | None = None


class Parameters(BaseModel):
    """The drawing.

    Attributes
    ----------
    walls : tuple of (x0, y0, x1, y1, height)
        Brick walls, metres.
    roofs : tuple of (x0, y0, x1, y1, height)
        Flat roofs on four posts, metres; a drone can fly under them.
    paths : tuple of (x0, y0, x1, y1)
        Paved rectangles on the lawn, metres.
    things : tuple of Thing
        Props.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    walls: tuple[Stretch, ...] = ()
    roofs: tuple[Roof, ...] = ()
    paths: tuple[Box, ...] = ()
    things: tuple[Thing, ...] = Field(min_length=1)


def build(site: Site) -> None:
    """Build the courtyard that the recipe draws."""
    drawing: Parameters = site.parameters
    for x0, y0, x1, y1 in drawing.paths:
        site.paint(rectangle(x0, y0, x1, y1), site.material("path", "paving"))
    for x0, y0, x1, y1, height in drawing.walls:
        body = wall(site, [(x0, y0), (x1, y1)], height, 0.3)
        site.add(None, "wall", [(site.material("wall", "brick"), body)])
    for x0, y0, x1, y1, height in drawing.roofs:
        posts = [
            translated(
                cylinder(radius=_POST_RADIUS_M, height=height - _ROOF_M, segments=8), (x, y, site.ground_z(x, y))
            )
            for x in (x0 + 0.2, x1 - 0.2)
            for y in (y0 + 0.2, y1 - 0.2)
        ]
        deck = slab(rectangle(x0, y0, x1, y1), height - _ROOF_M, height)
        wood = site.material("post", "planks")
        site.add(None, "roof", [(site.material("roof", "roof_tiles"), deck), *((wood, post) for post in posts)])
    for thing in drawing.things:
        site.place(thing.category, *thing.at, thing.yaw, z=thing.z, variant=thing.variant)
