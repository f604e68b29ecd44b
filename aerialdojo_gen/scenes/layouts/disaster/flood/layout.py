"""A flood: a village street under brown water behind a broken dyke, or a farm on its mound in a drowned polder.

North is +y; the water stands at z = 0.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.disaster.flood.polder import build_polder
from aerialdojo_gen.scenes.layouts.disaster.flood.village import build_village
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"village"`` (88 by 80 m) or ``"polder"`` (84 by 76 m).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["village", "polder"] = "village"


def build(site: Site) -> None:
    """Build the flood."""
    parameters: Parameters = site.parameters
    if parameters.plan == "polder":
        build_polder(site)
    else:
        build_village(site)
