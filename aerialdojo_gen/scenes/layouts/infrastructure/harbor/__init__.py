"""A harbour: a container port with a ferry berth and a fishing basin, or a small marina below a fishing village."""
