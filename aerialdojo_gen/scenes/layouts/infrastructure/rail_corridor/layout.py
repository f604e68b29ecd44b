"""A railway: a country station at a viaduct.

North is +y; the line runs along x.
"""

from __future__ import annotations

from aerialdojo_gen.scenes.layouts.infrastructure.rail_corridor.country import build_country
from aerialdojo_gen.scenes.site import Site


def build(site: Site) -> None:
    """Build the railway."""
    build_country(site)
