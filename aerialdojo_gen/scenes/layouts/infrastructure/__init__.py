"""Layouts of infrastructure, one folder a type."""
