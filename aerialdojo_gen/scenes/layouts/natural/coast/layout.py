"""A coast: a seaside resort with its promenade and pier, or a cliff coast with a fishing cove."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.natural.coast import cove, resort
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"resort"`` (150 by 120 m) or ``"cove"`` (120 by 105 m).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["resort", "cove"] = "resort"


def build(site: Site) -> None:
    """Build the coast."""
    parameters: Parameters = site.parameters
    if parameters.plan == "cove":
        cove.build_cove(site)
    else:
        resort.build_resort(site)
