"""An island: a tropical one with a volcano and a lagoon village, or a rocky northern islet with a fishing hamlet."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.natural.island import islet, tropics
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"tropical"`` (144 by 132 m) or ``"islet"`` (120 by 108 m).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["tropical", "islet"] = "tropical"


def build(site: Site) -> None:
    """Build the island."""
    parameters: Parameters = site.parameters
    if parameters.plan == "islet":
        islet.build_islet(site)
    else:
        tropics.build_tropics(site)
