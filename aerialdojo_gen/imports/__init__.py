"""Meshes that nobody here made: read within bounds, repaired with a word on it, and turned into scenes."""
