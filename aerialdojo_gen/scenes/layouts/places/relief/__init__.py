"""Open country from a height model."""
