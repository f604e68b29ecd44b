"""Layouts, one a scene type: how such a place is built, drawing from the catalogue."""
