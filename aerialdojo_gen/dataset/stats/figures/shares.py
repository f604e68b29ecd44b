"""What the release consists of (paper, appendix C): families and settings, partitions and subsets, mean lengths."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from aerialdojo_gen.dataset.stats.figures.style import (
    FAMILY_COLOURS,
    OTHER_COLOUR,
    SETTING_COLOURS,
    SETTING_NAMES,
    WIDTH_IN,
    Routes,
    styled,
)
from aerialdojo_gen.store.schemas import SETTINGS

_SUBSET_COLOURS = {"train": "#6b7a8f", "test": "#e0a458"}
_PARTITIONS = ("ID", "OOD")


def shares(routes: Routes) -> Figure:
    """Draw instances by family and setting, train and test by partition, and the mean length by family."""
    there = set(routes.family.tolist())
    families = [*(f for f in FAMILY_COLOURS if f in there), *sorted(there - {*FAMILY_COLOURS})]
    with styled():
        figure = Figure(figsize=(WIDTH_IN, 2.7), layout="constrained")
        left, middle, right = figure.subplots(1, 3, width_ratios=(1.3, 0.8, 1.0))
        by_family = [
            [2 * int(np.sum((routes.family == f) & (routes.setting == s))) for s in SETTINGS] for f in families
        ]
        _grouped(left, families, by_family, [(SETTING_NAMES[s], SETTING_COLOURS[s]) for s in SETTINGS])
        left.set_ylabel("task instances")
        left.set_title("(a) By family and setting", loc="left")
        by_partition = [
            [2 * int(np.sum((routes.partition == p) & (routes.subset == s))) for s in _SUBSET_COLOURS]
            for p in _PARTITIONS
        ]
        _grouped(middle, list(_PARTITIONS), by_partition, list(_SUBSET_COLOURS.items()))
        middle.set_title("(b) Train and test", loc="left")
        means = [float(routes.length_m[routes.family == f].mean()) for f in families]
        bars = right.bar(families, means, width=0.62, color=[FAMILY_COLOURS.get(f, OTHER_COLOUR) for f in families])
        right.bar_label(bars, [f"{mean:.1f}" for mean in means], padding=2, fontsize=7)
        right.set_ylabel("mean length, m")
        right.set_title("(c) Reference trajectories", loc="left")
        right.set_ylim(0.0, 1.14 * max(means, default=1.0))
        for axes in (left, right):
            axes.set_xticks(range(len(families)), families, rotation=22, ha="right", rotation_mode="anchor")
        for axes in (left, middle, right):
            axes.grid(axis="y")
            axes.tick_params(axis="x", length=0)
    return figure


def _grouped(axes: Axes, names: list[str], counts: list[list[int]], kinds: list[tuple[str, str]]) -> None:
    """Draw a group of bars a name, a bar a kind, with their counts above."""
    width = 0.8 / len(kinds)
    for k, (kind, colour) in enumerate(kinds):
        places = np.arange(len(names)) + (k - (len(kinds) - 1) / 2) * width
        bars = axes.bar(places, [row[k] for row in counts], width=0.92 * width, color=colour, label=kind)
        axes.bar_label(bars, [_short(row[k]) for row in counts], padding=1.5, fontsize=5)
    axes.set_xticks(range(len(names)), names)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    axes.set_ylim(0.0, 1.1 * max((max(row) for row in counts), default=1) or 1.0)
    axes.legend(loc="upper right")


def _short(count: int) -> str:
    """Write a count in the little room above a bar: 286, 7.1k, 42k, 114k."""
    return f"{count}" if count < 1000 else f"{count / 1000:.{3 if count >= 100_000 else 2}g}k"
