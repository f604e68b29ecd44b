"""Real places: towns from a map and reliefs from a height model."""
