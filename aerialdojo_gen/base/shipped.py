"""Where the recipes, annotations and pipelines lie that come with the program, and how a pipeline file names them."""

from __future__ import annotations

import os
from pathlib import Path

# A path of a wheel's own folder would end with the environment that it is installed in.
_PREFIX = "shipped:"


def home() -> Path:
    """Return the folder of scene_assets/, annotations/ and pipelines/: the package's, or what a wheel carries."""
    package = Path(__file__).resolve().parents[1]
    return package.parent if (package.parent / "pipelines" / "paper").is_dir() else package / "_shipped"


def read_path(text: str, folder: Path) -> Path:
    """Return the path that a file in `folder` names: relative to it, or of `home` after ``shipped:``."""
    return (home() / text.removeprefix(_PREFIX) if text.startswith(_PREFIX) else folder / text).resolve()


def written_path(path: str | Path, folder: Path) -> str:
    """Return how a file in `folder` names a path; the inverse of `read_path`."""
    if Path(path).is_relative_to(home()) and not folder.is_relative_to(home()):
        return _PREFIX + Path(path).relative_to(home()).as_posix()
    return Path(os.path.relpath(path, folder)).as_posix()
