"""A harbour: a container port with a ferry berth and a fishing basin, or a small marina below a fishing village.

North is +y; the water stands at z = 0 and the quays at 2 m.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.infrastructure.harbor.container_port import build_port
from aerialdojo_gen.scenes.layouts.infrastructure.harbor.marina import build_marina
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"port"`` (250 by 150 m) or ``"marina"`` (124 by 100 m).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["port", "marina"] = "port"


def build(site: Site) -> None:
    """Build the harbour."""
    parameters: Parameters = site.parameters
    if parameters.plan == "marina":
        build_marina(site)
    else:
        build_port(site)
