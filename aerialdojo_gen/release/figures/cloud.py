"""The objects' categories as a word cloud."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path

from matplotlib import font_manager
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch
from matplotlib.textpath import TextPath
from matplotlib.transforms import Affine2D
from wordcloud import WordCloud

from aerialdojo_gen import store
from aerialdojo_gen.release.figures.style import FAMILY_COLOURS, OTHER_COLOUR, WIDTH_IN, styled

_SIZE_PX = (1440, 720)


def categories(data: Path, scenes: Sequence[str]) -> Figure:
    """Draw every category as large as it has objects, in the colour of the family where most of them stand.

    Raises
    ------
    StoreError
        A part of the release is missing or damaged.
    """
    objects: Counter[str] = Counter()
    homes: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for scene in scenes:
        family = store.read_scene(data, "release/scenes", scene, ["family"]).to_pylist()[0]["family"]
        for category in store.read_scene(data, "release/objects", scene, ["category"])["category"].to_pylist():
            name = category.replace("_", " ")
            objects[name] += 1
            homes[name][family] += 1
    width, height = _SIZE_PX
    font = font_manager.FontProperties(family="DejaVu Sans")
    path = font_manager.findfont(font)
    # Sorted first: words of one size take their places by name, not by where they were met.
    cloud = WordCloud(
        width=width, height=height, font_path=path, max_words=len(objects), prefer_horizontal=1.0,
        relative_scaling=0.4, min_font_size=9, max_font_size=64, margin=3, random_state=0,
    ).generate_from_frequencies(dict(sorted(objects.items())))  # fmt: skip
    with styled():
        figure = Figure(figsize=(WIDTH_IN, WIDTH_IN * height / width + 0.3))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0 - 0.3 / figure.get_figheight()))
        axes.set_xlim(0, width)
        axes.set_ylim(height, 0)
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
