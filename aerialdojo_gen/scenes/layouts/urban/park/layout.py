"""An amusement park: a small fair on the terraces of a hillside, or a larger park about a lake.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.scenes.layouts.urban.park.hill_fair import build_hill_fair
from aerialdojo_gen.scenes.layouts.urban.park.lake_park import build_lake_park
from aerialdojo_gen.scenes.layouts.urban.parts.furniture import Furniture, furnish
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"hill"`` (84 by 76 m) or ``"lake"`` (120 by 108 m).
    furniture : tuple of Furniture
        What stands where.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["hill", "lake"] = "hill"
    furniture: tuple[Furniture, ...] = ()


def build(site: Site) -> None:
    """Build the park."""
    parameters: Parameters = site.parameters
    (build_hill_fair if parameters.plan == "hill" else build_lake_park)(site)
    furnish(site, parameters.furniture)
