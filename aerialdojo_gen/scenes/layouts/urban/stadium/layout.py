"""A stadium: a football ground with stands all round, or an athletics ground with one main stand and grass banks.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.urban.parts.furniture import Furniture, furnish
from aerialdojo_gen.scenes.layouts.urban.stadium.athletics import build_athletics
from aerialdojo_gen.scenes.layouts.urban.stadium.bowl import build_bowl
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"bowl"`` (116 by 100 m) or ``"athletics"`` (112 by 128 m).
    furniture : tuple of Furniture
        What stands where.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["bowl", "athletics"] = "bowl"
    furniture: tuple[Furniture, ...] = ()


def build(site: Site) -> None:
    """Build the stadium."""
    parameters: Parameters = site.parameters
    (build_bowl if parameters.plan == "bowl" else build_athletics)(site)
    furnish(site, parameters.furniture)
