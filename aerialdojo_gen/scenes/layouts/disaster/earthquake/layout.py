"""A town after an earthquake: a square among fallen blocks of flats, or an old town of masonry on a hill.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from aerialdojo_gen.scenes.layouts.disaster.earthquake.old_town import build_old_town
from aerialdojo_gen.scenes.layouts.disaster.earthquake.square import build_square
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"square"`` (88 by 80 m) or ``"old_town"`` (104 by 92 m).
    drop_m : float
        By how much the ground has sunk along the fault, metres.
    litter : float
        Factor on the number of loose pieces.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["square", "old_town"] = "square"
    drop_m: float = Field(default=1.5, ge=0.0, le=3.0)
    litter: float = Field(default=1.0, ge=0.2, le=2.0)


def build(site: Site) -> None:
    """Build the town."""
    parameters: Parameters = site.parameters
    builder = build_old_town if parameters.plan == "old_town" else build_square
    builder(site, parameters.drop_m, parameters.litter)
