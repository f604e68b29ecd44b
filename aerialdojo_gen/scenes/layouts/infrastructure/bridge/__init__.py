"""A bridge: a cable-stayed road bridge over a city river, or a steel arch over a rocky gorge."""
