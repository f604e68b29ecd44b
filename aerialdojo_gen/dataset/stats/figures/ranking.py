"""The most frequent categories and names of the objects, as ranked bars."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from aerialdojo_gen.dataset.stats.figures.style import FAMILY_COLOURS, OTHER_COLOUR, WIDTH_IN, family_order, styled
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

_COLUMNS, _ROWS = 2, 30


def categories(root: DataRoot, scenes: Sequence[str]) -> Figure:
    """Draw the categories with the most objects, in the colour of the family where most of them stand."""
    counts: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for scene in scenes:
        family = store.read_scene(root, "release/scenes", scene, ["family"]).to_pylist()[0]["family"]
        for category in store.read_scene(root, "release/objects", scene, ["category"])["category"].to_pylist():
            counts[category.replace("_", " ")][family] += 1
    return _ranking(counts, "objects", "categories")


def names(root: DataRoot, scenes: Sequence[str]) -> Figure:
    """Draw the names that most tasks have as their target (paper, Fig. 2), in the colour of their main family."""
    counts: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for scene in scenes:
        for subset in ("train", "test"):
            table = store.read_scene(root, f"tasks/{subset}", scene, ["family", "target_name"])
            for family, name in zip(table["family"].to_pylist(), table["target_name"].to_pylist(), strict=True):
                counts[name][family] += 1
    return _ranking(counts, "tasks", "names")


def _ranking(counts: Mapping[str, Counter[str]], unit: str, things: str) -> Figure:
    """Draw a bar for each of the words with the highest counts, from the top down, in columns."""
    ranked = sorted(counts, key=lambda word: (-counts[word].total(), word))
    shown = ranked[: _COLUMNS * _ROWS]
    families = {word: min((-n, family) for family, n in counts[word].items())[1] for word in shown}
    rows = max(1, -(-len(shown) // _COLUMNS))
    longest = max((counts[word].total() for word in shown), default=1)
    with styled():
        figure = Figure(figsize=(WIDTH_IN, 0.9 + 0.165 * rows), layout="constrained")
        for column, axes in enumerate(figure.subplots(1, _COLUMNS)):
            words = shown[column * rows : (column + 1) * rows]
            colours = [FAMILY_COLOURS.get(families[word], OTHER_COLOUR) for word in words]
            bars = axes.barh(range(len(words)), [counts[word].total() for word in words], height=0.72, color=colours)
            axes.bar_label(bars, [f"{counts[word].total():,}" for word in words], padding=2, fontsize=7)
            axes.set_yticks(range(len(words)), words)
            axes.set_ylim(rows - 0.4, -0.6)
            axes.set_xlim(0, 1.16 * longest)
            axes.tick_params(axis="y", length=0)
            axes.set_xlabel(unit)
            axes.grid(axis="x")
        figure.suptitle(f"{len(shown)} of {len(ranked)} {things}", x=0.01, ha="left", fontsize="medium")
        order = family_order(families.values())
        patches = [Patch(color=FAMILY_COLOURS.get(f, OTHER_COLOUR), label=f) for f in order]
        figure.legend(handles=patches, loc="outside upper right", ncols=max(len(patches), 1))
    return figure
