"""Figures of a release, as PNG and SVG: what it is made of, lengths, detours, difficulty, categories, names, maps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aerialdojo_gen.dataset.stats.figures.charts import (
    categories,
    composition,
    detours,
    difficulty,
    lengths,
    names,
    save,
    shares,
)
from aerialdojo_gen.dataset.stats.figures.maps import maps
from aerialdojo_gen.dataset.stats.measures import has_difficulty, read_tasks
from aerialdojo_gen.store.root import Where, open_root

__all__ = ["draw_figures"]


def draw_figures(data: Where, scenes: Sequence[str], folder: Path) -> list[Path]:
    """Draw all figures."""
    root = open_root(data)
    tasks = read_tasks(root, scenes)
    figures = {
        "composition": composition(tasks),
        "shares": shares(tasks),
        "lengths": lengths(tasks),
        "detours": detours(tasks),
        **({"difficulty": difficulty(tasks)} if has_difficulty(tasks) else {}),
        "categories": categories(root, scenes),
        "names": names(root, scenes),
        "maps": maps(root, scenes),
    }
    return [path for name, figure in figures.items() for path in save(figure, folder, name)]
