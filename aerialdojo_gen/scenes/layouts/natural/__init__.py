"""Natural layouts, one folder a type."""
