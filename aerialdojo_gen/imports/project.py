"""A project folder: scenes, annotations and the pipeline file of both."""

from __future__ import annotations

import json
from pathlib import Path

from aerialdojo_gen.pipeline.registry import STAGES
from aerialdojo_gen.store.atomic import atomic_write, make_folder

PIPELINE = "pipeline.toml"
_PIPELINE = """\
# Scenes of our own.
name = "{name}"
seed = 0
scenes = ["*"]
recipes = "scenes"
annotations = "annotations"
stages = {stages}
"""


def make_project(project: Path) -> None:
    """Make a project's folders and its pipeline file, where it has none."""
    for folder in ("scenes", "annotations"):
        make_folder(project / folder)
    if (project / PIPELINE).exists():
        return
    name = "".join(c if c.isalnum() or c in "._-" else "-" for c in project.resolve().name).strip("._-") or "scenes"
    stages = json.dumps([stage.name for stage in STAGES if stage.name != "render"])
    atomic_write(project, PIPELINE, _PIPELINE.format(name=name, stages=stages))
