"""Real places: towns from a map and reliefs from a height model, as `add-map` and `add-terrain` write their recipes."""
