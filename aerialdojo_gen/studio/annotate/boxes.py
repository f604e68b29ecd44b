"""Boxes in an imported scene's recipe, added and removed by the annotation tool.

A changed recipe is first built in a scratch folder, and replaces the old one only if that succeeds: a recipe that
cannot be built would break every later run.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from aerialdojo_gen.base.errors import AerialDojoError, disk_error
from aerialdojo_gen.pipeline.stage import ProjectPaths
from aerialdojo_gen.scenes.recipe import Cut, load_imported
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.store.staging import scratch_folder

_HEAD = "\n[[imported.cuts]]\n"


def nodes(recipe: Path) -> list[str]:
    """Nodes that boxes made; none in a scene that is not imported."""
    imported = load_imported(recipe)
    return [cut.node for cut in imported.cuts] if imported else []


def with_box(recipe: Path, cut: Cut) -> str:
    """Return a recipe's text with a box more."""
    if load_imported(recipe) is None:
        raise AerialDojoError("this scene is built from a recipe, every thing in it has a node: boxes are not needed")
    lines = [
        f"node = {json.dumps(cut.node)}",
        f"category = {json.dumps(cut.category)}",
        f"low_m = {list(cut.low_m)}",
        f"high_m = {list(cut.high_m)}",
    ]
    return recipe.read_text(encoding="utf-8") + _HEAD + "\n".join(lines) + "\n"


def without_box(recipe: Path, node: str) -> str:
    """Return a recipe's text without the box of a node; `AerialDojoError` where there is none."""
    head, *blocks = recipe.read_text(encoding="utf-8").split(_HEAD)
    kept = [block for block in blocks if f"node = {json.dumps(node)}\n" not in block]
    if len(kept) == len(blocks):
        raise AerialDojoError(f"{node} was not created by a box")
    return _HEAD.join([head, *kept])


@contextlib.contextmanager
def staged(roots: ProjectPaths, scene: str, text: str) -> Iterator[ProjectPaths]:
    """Lay a changed recipe out for a build, with the scene's own mesh beside it."""
    with contextlib.ExitStack() as held:
        try:
            folder = held.enter_context(scratch_folder())
            (folder / f"{scene}.toml").write_text(text, encoding="utf-8")
            (folder / f"{scene}.glb").symlink_to((roots.recipes / f"{scene}.glb").resolve())
        except OSError as error:
            raise disk_error(error, Path(tempfile.gettempdir())) from error
        yield replace(roots, recipes=folder)


def write(recipe: Path, text: str) -> None:
    """Write a recipe, whole or not at all."""
    with atomic_file(recipe.parent, recipe.name) as path:
        path.write_text(text, encoding="utf-8")
