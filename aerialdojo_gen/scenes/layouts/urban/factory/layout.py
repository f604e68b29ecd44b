"""A factory: a big steel and chemical works, or a brickworks beside its clay pit.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.urban.factory.brickworks import build_brickworks
from aerialdojo_gen.scenes.layouts.urban.factory.works import build_works
from aerialdojo_gen.scenes.layouts.urban.parts.industry import Place, set_out
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"works"`` (152 by 124 m) or ``"brickworks"`` (96 by 84 m).
    sign : str
        What is written on the main hall.
    places : tuple of Place
        Everything that stands about.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["works", "brickworks"] = "works"
    sign: str = "NORTH WORKS"
    places: tuple[Place, ...] = ()


def build(site: Site) -> None:
    """Build the factory."""
    parameters: Parameters = site.parameters
    if parameters.plan == "brickworks":
        build_brickworks(site, parameters.sign)
    else:
        build_works(site, parameters.sign)
    set_out(site, parameters.places)
