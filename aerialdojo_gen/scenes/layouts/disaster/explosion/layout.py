"""A place after an explosion: an industrial yard about a crater, or a street of torn fronts.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from aerialdojo_gen.scenes.layouts.disaster.explosion.street import build_street
from aerialdojo_gen.scenes.layouts.disaster.explosion.yard import build_yard
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"yard"`` (74 by 68 m) or ``"street"`` (110 by 84 m).
    crater_m : float
        Radius of the crater's crest, metres.
    litter : float
        Factor on the number of loose pieces.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["yard", "street"] = "yard"
    crater_m: float = Field(default=5.5, ge=3.0, le=8.0)
    litter: float = Field(default=1.0, ge=0.2, le=2.0)


def build(site: Site) -> None:
    """Build the place."""
    parameters: Parameters = site.parameters
    builder = build_street if parameters.plan == "street" else build_yard
    builder(site, parameters.crater_m, parameters.litter)
