"""What the tests of the annotation tool share: a yard, and a real server."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

YARD = "U_Courtyard_0"
AUTHOR = {"who": "Ada", "client": "tab-1"}


@contextmanager
def served(
    project: Path, scene: str, pipeline: Path, data: Path, port: int = 0
) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run ``aerialdojo-gen annotate``; gives the page's address and the process, which is ended at last."""
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "annotate", "--scene", scene, "--pipeline", str(pipeline),
               "--data", str(data), "--no-browser", "--port", str(port)]  # fmt: skip
    process = subprocess.Popen(command, cwd=project, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        line = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", line)
        assert found, line + (process.communicate(timeout=20)[0] or "")
        yield found[0], process
    finally:
        process.terminate()
        process.communicate(timeout=20)


def yard_pipeline(project: Path, folder: Path) -> Path:
    """Write a pipeline of the smoke yards whose annotations are a copy in a folder."""
    shutil.copytree(project / "annotations" / "smoke", folder / "annotations")
    path = folder / "pipeline.toml"
    path.write_text(
        f'name = "yards"\nseed = 7\nscene_assets = "{project / "scene_assets"}"\n'
        f'recipes = "{project / "scene_assets" / "smoke"}"\nannotations = "annotations"\n'
    )
    return path
