"""A town from a map."""
