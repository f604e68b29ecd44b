"""A bridge: a cable-stayed road bridge over a city river, or a steel arch over a rocky gorge.

North is +y; the road runs along x.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.infrastructure.bridge.gorge import build_gorge
from aerialdojo_gen.scenes.layouts.infrastructure.bridge.river import build_river
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"river"`` (172 by 104 m) or ``"gorge"`` (112 by 88 m).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["river", "gorge"] = "river"


def build(site: Site) -> None:
    """Build the bridge."""
    parameters: Parameters = site.parameters
    if parameters.plan == "river":
        build_river(site)
    else:
        build_gorge(site)
