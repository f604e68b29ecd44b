"""Furniture of urban layouts as data: what stands where, place by place, drawn in the recipe."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict, Field

from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.values import At, Degrees, Metres


class Thing(BaseModel):
    """A prop of the catalogue, or a straight row of them.

    Attributes
    ----------
    category : str
        Key of the catalogue.
    variant : str or None
        Its look; drawn where absent.
    at : (x, y)
        Where it stands, or the first of a row, metres.
    yaw : float
        Direction of its front, degrees, counter-clockwise from +x.
    z : float or None
        Height of the floor that it stands on, metres; the place's, or the ground's, where absent.
    count : int
        How many stand in the row.
    step : (dx, dy)
        From one to the next, metres.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    category: str
    variant: str | None = None
    at: At
    yaw: Degrees = 0.0
    z: Metres | None = None
    count: int = Field(default=1, ge=1, le=1000)
    step: At = (0.0, 0.0)


class Furniture(BaseModel):
    """Things of one place.

    Attributes
    ----------
    place : str
        How a person says where: it goes into the attributes, because descriptions speak of it.
    z : float or None
        Height of the floor, metres; the ground's where absent.
    things : tuple of Thing
        In the order of their node names.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    place: str
    z: Metres | None = None
    things: tuple[Thing, ...]


def furnish(site: Site, furniture: Sequence[Furniture]) -> None:
    """Place all of it; `AssetError` names an unknown category or variant."""
    for group in furniture:
        for thing in group.things:
            z = group.z if thing.z is None else thing.z
            for k in range(thing.count):
                x, y = (a + k * d for a, d in zip(thing.at, thing.step, strict=True))
                site.place(
                    thing.category, x, y, thing.yaw, z=z, variant=thing.variant, attributes={"place": group.place}
                )
