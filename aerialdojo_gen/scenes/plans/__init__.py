"""Plans: scenes as data. A plan is a TOML file; the kit's builders make what it says."""

HEIGHTS_SUFFIX = ".heights.asc"
"""Ending of the table of heights beside a plan, after the scene's name."""
