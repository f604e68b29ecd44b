"""Worlds: plans written by a generator for each scene type, from a seed and knobs."""
