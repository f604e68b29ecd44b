"""Alleys: a back alley among brick tenements, or the lanes of an old market town."""
