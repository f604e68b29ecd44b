"""Scenes: the in-memory model, recipes, props, layouts and the GLB on disk."""
