"""Layouts of disasters, one folder a type."""
