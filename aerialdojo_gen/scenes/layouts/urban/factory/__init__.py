"""A factory: a big steel and chemical works, or a brickworks beside its clay pit."""
