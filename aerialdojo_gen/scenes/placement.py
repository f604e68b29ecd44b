"""A thing of the catalogue and where it goes: what `Site.place` takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypedDict

# Where there is no room: placed all the same, left out, an error.
Fit = Literal["as_is", "skip", "must"]
# In place of a variant: the thing draws it.
DRAWN = "*"


class Room(TypedDict, total=False):
    """How a thing is settled, and what it keeps free of what follows, metres; see `Site.place`."""

    settle_m: float | None
    clear_m: float
    margin_m: float
    room_m: float


@dataclass(frozen=True)
class Placement:
    """A prop of the catalogue, and where it goes."""

    category: str
    x: float  # Metres, world frame
    y: float
    yaw_deg: float = 0.0  # Direction of its front, counter-clockwise from +x
    variant: str | None = None  # The one used least so far where absent
    z: float | None = None  # Height of its foot; on the ground where absent
    place: str = ""  # Where it is, in words
    node: str | None = None  # The next free one of the category where absent
    design: str | None = None  # One of the scene's side, drawn for the node, where absent
    scale: float = 1.0
    stretch: tuple[float, float, float] | None = None  # Factors along its own axes, beside its design's
    params: Mapping[str, float] | None = None
    roles: Mapping[str, str] | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)
    solid: bool = True  # Whether it takes the ground that it stands on
