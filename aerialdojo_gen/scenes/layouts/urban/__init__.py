"""Urban layouts, one folder a type."""
