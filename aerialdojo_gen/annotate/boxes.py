"""Boxes in an imported scene's recipe: what the annotation tool adds to it and takes from it."""

from __future__ import annotations

import json
from pathlib import Path

from aerialdojo_gen.atomic import atomic_file
from aerialdojo_gen.errors import AerialDojoError
from aerialdojo_gen.scenes.recipe import Cut, load_imported

_HEAD = "\n[[imported.cuts]]\n"


def nodes(recipe: Path) -> list[str]:
    """Nodes that boxes made; none in a scene that is not imported."""
    imported = load_imported(recipe)
    return [cut.node for cut in imported.cuts] if imported else []


def add(recipe: Path, cut: Cut) -> None:
    """Add a box to a recipe.

    Raises
    ------
    AerialDojoError
        It is not an imported scene's.
    """
    if load_imported(recipe) is None:
        raise AerialDojoError(
            "this scene is built from a recipe, every thing in it has a node: there is nothing to box"
        )
    lines = [
        f"node = {json.dumps(cut.node)}",
        f"category = {json.dumps(cut.category)}",
        f"low_m = {list(cut.low_m)}",
        f"high_m = {list(cut.high_m)}",
    ]
    _write(recipe, recipe.read_text(encoding="utf-8") + _HEAD + "\n".join(lines) + "\n")


def remove(recipe: Path, node: str) -> None:
    """Take a box out of a recipe; `AerialDojoError` where there is none of that node."""
    head, *blocks = recipe.read_text(encoding="utf-8").split(_HEAD)
    kept = [block for block in blocks if f"node = {json.dumps(node)}\n" not in block]
    if len(kept) == len(blocks):
        raise AerialDojoError(f"{node} was not made by a box")
    _write(recipe, _HEAD.join([head, *kept]))


def _write(recipe: Path, text: str) -> None:
    with atomic_file(recipe.parent, recipe.name) as path:
        path.write_text(text, encoding="utf-8")
