"""What the tests of the annotation tool share: a yard, and a real server."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

YARD = "U_Courtyard_0"
AUTHOR = {"who": "Ada", "client": "tab-1"}


class Place(NamedTuple):
    """What ``annotate`` is told to open."""

    scene: str
    pipeline: Path
    data: Path
    annotations: Path


def yard_in(project: Path, folder: Path) -> Place:
    """The yard of a pipeline of the smoke yards whose annotations are a copy in a folder."""
    shutil.copytree(project / "annotations" / "smoke", folder / "annotations")
    pipeline = folder / "pipeline.toml"
    pipeline.write_text(
        f'name = "yards"\nseed = 7\nscene_assets = "{project / "scene_assets"}"\n'
        f'recipes = "{project / "scene_assets" / "smoke"}"\nannotations = "annotations"\n'
    )
    return Place(YARD, pipeline, folder / "data", folder / "annotations" / f"{YARD}.json")


def command_of(place: Place, *more: object) -> list[str]:
    """The arguments of ``annotate`` for a place."""
    return ["annotate", "--scene", place.scene, "--pipeline", str(place.pipeline), "--data", str(place.data),
            "--no-browser", *map(str, more)]  # fmt: skip


@contextmanager
def served(project: Path, place: Place, port: int = 0) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run ``aerialdojo-gen annotate``; gives the page's address and the process, which is ended at last."""
    command = [sys.executable, "-m", "aerialdojo_gen.cli", *command_of(place, "--port", port)]
    process = subprocess.Popen(command, cwd=project, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        line = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", line)
        assert found, line + (process.communicate(timeout=20)[0] or "")
        yield found[0], process
    finally:
        process.terminate()
        process.communicate(timeout=20)
