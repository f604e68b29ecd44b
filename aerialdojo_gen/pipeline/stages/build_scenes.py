"""`build-scenes`: a recipe becomes a mesh and a row of `scenes`."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerialdojo_gen.base.errors import AssetError, Malformed
from aerialdojo_gen.base.safe_parse import loads_toml, read_toml
from aerialdojo_gen.pipeline.stage import Job, Output, ProjectPaths, Stage
from aerialdojo_gen.scenes import layouts
from aerialdojo_gen.scenes.catalogue_files import catalogue_files

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import BuildScenesConfig
    from aerialdojo_gen.pipeline.code_digest import Choice


def run(job: Job, config: BuildScenesConfig) -> Output:
    """Do a shard's work: `aerialdojo_gen.pipeline.stages.work.build_scenes.run`."""
    from aerialdojo_gen.pipeline.stages.work import build_scenes

    return build_scenes.run(job, config)


def sources(roots: ProjectPaths, scene: str) -> list[Path]:
    """List recipe, mesh beside it, materials and catalogue."""
    mesh = roots.recipes / f"{scene}.glb"
    return [
        roots.recipes / f"{scene}.toml",
        *([mesh] if mesh.is_file() else []),
        roots.scene_assets / "materials.toml",
        *catalogue_files(roots.scene_assets),
    ]


def imports(roots: ProjectPaths, scene: str) -> Choice | None:
    """Choose the layout that the recipe names; of a recipe that is wrong the stage itself says what is."""
    from aerialdojo_gen.pipeline.code_digest import Choice

    try:
        recipe = _top(roots.recipes / f"{scene}.toml")
    except (AssetError, OSError, UnicodeDecodeError):
        return None
    if "imported" in recipe:
        return Choice(layouts.__name__, ())
    module = layouts.layout_modules().get(str(recipe.get("layout")))
    return Choice(layouts.__name__, (f"{layouts.__name__}.{module}",)) if module else None


def _top(path: Path) -> dict[str, Any]:
    """Read of a recipe what stands before its first table, where that tells all: its lists of things take long."""
    text = path.read_text(encoding="utf-8")
    if "imported" not in text:
        # Inside of a string or a list no table begins: what is before it is no TOML then.
        with contextlib.suppress(Malformed):
            return loads_toml(text.partition("\n[")[0])
    return read_toml(path, AssetError)


STAGE = Stage(
    "build-scenes",
    "Build the scenes' meshes from their recipes.",
    reads=(),
    writes=("scenes",),
    run=run,
    sources=sources,
    imports=imports,
    seconds=(4.0, 0.0),
)
