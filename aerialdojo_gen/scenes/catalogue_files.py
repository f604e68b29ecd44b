"""Paths of the catalogue's files; a module of its own, so that listing them loads no geometry."""

from __future__ import annotations

from pathlib import Path

# Target categories, landmarks for descriptions, and scenery.
TARGETS = "props"
FOLDERS = ("landmarks", TARGETS, "scenery")


def catalogue_files(folder: Path) -> list[Path]:
    """List the files of a `scene_assets` folder that categories stand in, in a fixed order."""
    return [path for name in FOLDERS for path in sorted((folder / name).glob("*.toml"))]
