"""A railway: a city station in a walled cutting with a goods yard, or a country station at a viaduct.

North is +y; the line runs along x.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.infrastructure.rail_corridor.city import build_city
from aerialdojo_gen.scenes.layouts.infrastructure.rail_corridor.country import build_country
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"city"`` (150 by 112 m) or ``"country"`` (116 by 92 m).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["city", "country"] = "city"


def build(site: Site) -> None:
    """Build the railway."""
    parameters: Parameters = site.parameters
    if parameters.plan == "city":
        build_city(site)
    else:
        build_country(site)
