"""The objects' categories and names as word clouds."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

from matplotlib import font_manager
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch
from matplotlib.textpath import TextPath
from matplotlib.transforms import Affine2D
from wordcloud import WordCloud

from aerialdojo_gen.dataset.stats.figures.style import FAMILY_COLOURS, OTHER_COLOUR, WIDTH_IN, styled
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

_SIZE_PX = (1440, 720)
_MARGIN_PX = 8
# More would be too small to be read in print.
_MOST_NAMES = 160


def categories(root: DataRoot, scenes: Sequence[str]) -> Figure:
    """Draw every category as large as it has objects, in the colour of the family where most of them stand."""
    homes: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for scene in scenes:
        family = store.read_scene(root, "release/scenes", scene, ["family"]).to_pylist()[0]["family"]
        for category in store.read_scene(root, "release/objects", scene, ["category"])["category"].to_pylist():
            homes[category.replace("_", " ")][family] += 1
    return _cloud(homes)


def names(root: DataRoot, scenes: Sequence[str]) -> Figure:
    """Draw the names of the objects (paper, Fig. 2), each as large as it is sought by tasks, the most sought ones."""
    homes: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for scene in scenes:
        for subset in ("train", "test"):
            table = store.read_scene(root, f"tasks/{subset}", scene, ["family", "target_name"])
            for family, name in zip(table["family"].to_pylist(), table["target_name"].to_pylist(), strict=True):
                homes[name][family] += 1
    sought = sorted(homes, key=lambda name: (-homes[name].total(), name))[:_MOST_NAMES]
    return _cloud({name: homes[name] for name in sought})


def _cloud(homes: Mapping[str, Counter[str]]) -> Figure:
    """Draw words as large as they are counted, in the colour of the family that counts most of them."""
    counts = {word: found.total() for word, found in homes.items()}
    width, height = _SIZE_PX
    font = font_manager.FontProperties(family="DejaVu Sans")
    path = font_manager.findfont(font)
    # Sorted first: words of one size take their places by name, not by where they were met.
    cloud = WordCloud(
        width=width, height=height, font_path=path, max_words=len(counts), prefer_horizontal=1.0,
        relative_scaling=0.4, min_font_size=9, max_font_size=64, margin=3, random_state=0,
    ).generate_from_frequencies(dict(sorted(counts.items())))  # fmt: skip
    with styled():
        figure = Figure(figsize=(WIDTH_IN, WIDTH_IN * height / width + 0.3))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0 - 0.3 / figure.get_figheight()))
        # A word may begin at the very edge, and its outline reach over it.
        axes.set_xlim(-_MARGIN_PX, width + _MARGIN_PX)
        axes.set_ylim(height + _MARGIN_PX, -_MARGIN_PX)
        axes.set_axis_off()
        shown = set()
        for (word, _), size, (row, column), _, _ in cloud.layout_:
            family = min((-n, name) for name, n in homes[word].items())[1]
            shown.add(family)
            outline = TextPath((0, 0), word, size=size, prop=font)
            # WordCloud places the ink of a word, not its line: its left top corner is the layout's position.
            ink = outline.get_extents()
            place = Affine2D().translate(-ink.x0, -ink.y1).scale(1, -1).translate(column, row)
            colour = FAMILY_COLOURS.get(family, OTHER_COLOUR)
            axes.add_patch(PathPatch(place.transform_path(outline), facecolor=colour, lw=0))
        order = [*(f for f in FAMILY_COLOURS if f in shown), *sorted(shown - {*FAMILY_COLOURS})]
        patches = [Patch(color=FAMILY_COLOURS.get(f, OTHER_COLOUR), label=f) for f in order]
        figure.legend(handles=patches, loc="upper center", ncols=max(len(patches), 1))
    return figure
