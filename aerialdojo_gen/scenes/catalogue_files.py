"""Where the catalogue's files lie; by itself, so that who asks only for that loads no geometry."""

from __future__ import annotations

from pathlib import Path

# What tasks may ask for, what they are told from, and what else a place is full of.
TARGETS = "props"
FOLDERS = ("landmarks", TARGETS, "scenery")


def catalogue_files(folder: Path) -> list[Path]:
    """List the files of a `scene_assets` folder that categories stand in, in a fixed order."""
    return [path for name in FOLDERS for path in sorted((folder / name).glob("*.toml"))]
