"""Collision world, clearance grid, motion primitives, cost-to-go and Hybrid A*."""
