"""Collision world, clearance grid, cost-to-go and Hybrid A*."""
