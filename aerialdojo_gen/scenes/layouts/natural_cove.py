"""A cliff coast with a fishing cove."""

from __future__ import annotations

from aerialdojo_gen.scenes.site import Site


def build_cove(site: Site) -> None:
    """Build the cove."""
