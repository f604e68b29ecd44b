"""`build-scenes`: a recipe becomes a mesh and a row of `scenes`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerialdojo_gen.pipeline.stage import Job, Output, Roots, Stage
from aerialdojo_gen.scenes.catalogue_files import catalogue_files

if TYPE_CHECKING:
    from aerialdojo_gen.config.sections import BuildScenesConfig


def run(job: Job, config: BuildScenesConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.stages.work.build_scenes.run`."""
    from aerialdojo_gen.stages.work import build_scenes

    return build_scenes.run(job, config)


def sources(roots: Roots, scene: str) -> list[Path]:
    """List recipe, mesh beside it, materials and catalogue."""
    mesh = roots.recipes / f"{scene}.glb"
    return [
        roots.recipes / f"{scene}.toml",
        *([mesh] if mesh.is_file() else []),
        roots.scene_assets / "materials.toml",
        *catalogue_files(roots.scene_assets),
    ]


STAGE = Stage(
    "build-scenes",
    "Build the scenes' meshes from their recipes.",
    reads=(),
    writes=("scenes",),
    run=run,
    sources=sources,
)
