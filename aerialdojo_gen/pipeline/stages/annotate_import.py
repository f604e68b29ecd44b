"""`annotate-import`: an annotation file becomes tables, where it is right."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.pipeline.stage import Job, Output, ProjectPaths, Stage
from aerialdojo_gen.scenes.catalogue_files import catalogue_files

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import AnnotateImportConfig


def run(job: Job, config: AnnotateImportConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.annotate_import.run`."""
    from aerialdojo_gen.pipeline.stages.work import annotate_import

    return annotate_import.run(job, config)


def sources(roots: ProjectPaths, scene: str) -> list[Path]:
    """List the annotation file and the catalogue; AssetError where there is no such file."""
    if missing := missing_input(roots, scene):
        raise AssetError(missing)
    return [_file(roots, scene), *catalogue_files(roots.scene_assets)]


def missing_input(roots: ProjectPaths, scene: str) -> str:
    """Say that a scene has no annotation file, and how to make one; empty where it has."""
    file = _file(roots, scene)
    if file.is_file():
        return ""
    return (
        f"{scene} has no annotations: {file} is missing; draft them: {command('annotate-draft', scene)} "
        f"or make them by hand: {command('annotate', scene=scene)}"
    )


def _file(roots: ProjectPaths, scene: str) -> Path:
    return roots.annotations / f"{scene}.json"


STAGE = Stage(
    "annotate-import",
    "Check the annotations against the scenes and import them.",
    reads=("scenes",),
    writes=("landmarks", "objects", "chosen_anchors"),
    run=run,
    sources=sources,
    missing_input=missing_input,
    seconds=(0.5, 0.0),
)
