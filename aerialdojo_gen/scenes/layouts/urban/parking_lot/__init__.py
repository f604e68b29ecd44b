"""A parking lot: a city's, with solar roofs, a parking deck and offices, or a small park-and-ride by a bus stop."""
