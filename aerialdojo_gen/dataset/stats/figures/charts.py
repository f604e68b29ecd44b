"""Charts of a release's tasks and objects, and what all figures share: colours, type, files that never change.

What tasks are made of, how long they are, how far from straight, how hard; the most frequent categories and names.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import DETOUR
from aerialdojo_gen.dataset.stats.tables import family_order
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import FAMILIES, SETTINGS

# Settings are ordered, so they are shades of one colour; families are not (Paul Tol's muted scheme).
SETTING_COLOURS = dict(zip(SETTINGS, ("#9ecae1", "#4292c6", "#08417c"), strict=True))
SETTING_NAMES = dict(zip(SETTINGS, ("Base", "Standard", "Long-horizon"), strict=True))
FAMILY_COLOURS = dict(zip(FAMILIES.values(), ("#cc6677", "#117733", "#b58900", "#882255"), strict=True))
OTHER_COLOUR = "#555555"
WIDTH_IN = 7.2
_DPI = 200
_COLUMNS, _ROWS = 2, 30  # Of a ranking
_THOUSANDS = FuncFormatter(lambda value, _: f"{value:,.0f}")
_SUBSET_COLOURS = {"train": "#6b7a8f", "test": "#e0a458"}
_PARTITIONS = ("ID", "OOD")
# A curve of tens of thousands of steps is cut down to what a printed page can show.
_STEPS = 2000

_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    # Letters as outlines: the figure looks the same where the font is not installed.
    "svg.fonttype": "path",
    "svg.hashsalt": "aerialdojo-gen",
}


def styled() -> AbstractContextManager[None]:
    """Draw in the common style; nothing of it stays behind."""
    return mpl.rc_context(_STYLE)


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and as SVG, each whole or not at all, without a date."""
    paths = []
    with styled():
        for suffix, metadata in ((".png", {"Software": None}), (".svg", {"Date": None, "Creator": None})):
            with atomic_file(folder, name + suffix) as path:
                figure.savefig(path, dpi=_DPI, metadata=metadata, facecolor="white")
            figure.set_layout_engine("none")  # it is laid out: a quarter of the time
            paths.append(folder / (name + suffix))
    return paths


def _bars(axes: Axes, names: list[str], counts: NDArray[np.int64]) -> None:
    """Draw one bar a name from the top down, in the settings' shades, with its sum at its end."""
    rows = np.arange(len(names))
    left = np.zeros(len(names))
    for setting, part in zip(SETTINGS, counts.T, strict=True):
        axes.barh(rows, part, left=left, height=0.72, color=SETTING_COLOURS[setting], label=SETTING_NAMES[setting])
        left += part
    for row, total in zip(rows, left, strict=True):
        axes.annotate(f"{total:,.0f}", (total, row), (3, 0), textcoords="offset points", va="center", fontsize=7)
    axes.set_yticks(rows, names)
    axes.set(ylim=(len(names) - 0.4, -0.6), xlim=(0, max(1.0, float(left.max())) * 1.16), xlabel="task instances")
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.xaxis.set_major_formatter(_THOUSANDS)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x")


def _counts(tasks: pd.DataFrame, key: str, names: Iterable[str], by: str, kinds: Iterable[str]) -> NDArray[np.int64]:
    """Task instances (two a navigation task) by the values of two columns."""
    found = pd.crosstab(tasks[key], tasks[by]).reindex(index=[*names], columns=[*kinds], fill_value=0)
    return np.asarray(2 * found.to_numpy(), dtype=np.int64)


def composition(tasks: pd.DataFrame) -> Figure:
    """Draw task instances by family and by scene type, in shades of their length setting."""
    families = family_order(tasks["family"])
    family_of = dict(zip(tasks["scene_type"], tasks["family"], strict=True))
    n = tasks["scene_type"].value_counts()
    types = sorted(family_of, key=lambda kind: (families.index(family_of[kind]), -n[kind], kind))
    with styled():
        figure = Figure(figsize=(WIDTH_IN, max(2.2, 0.9 + 0.165 * len(types))), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.25))
        _bars(left, families, _counts(tasks, "family", families, "setting", SETTINGS))
        left.set(title="By scene family")
        spaced = [re.sub(r"(?<=[a-z])(?=[A-Z])", " ", kind) for kind in types]
        _bars(right, spaced, _counts(tasks, "scene_type", types, "setting", SETTINGS))
        right.set(title="By scene type")
        for axes, owners in ((left, families), (right, [family_of[kind] for kind in types])):
            for label, owner in zip(axes.get_yticklabels(), owners, strict=True):
                label.set_color(FAMILY_COLOURS.get(owner, OTHER_COLOUR))
        handles, names = left.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper right", ncols=3, title=None)
    return figure


def _histogram(axes: Axes, tasks: pd.DataFrame, name: str, edges: NDArray[np.float64]) -> None:
    parts = [tasks[name][tasks["setting"] == s].to_numpy(np.float64) for s in SETTINGS]
    colours, names = ([of[s] for s in SETTINGS] for of in (SETTING_COLOURS, SETTING_NAMES))
    axes.hist(parts, bins=edges.tolist(), stacked=True, color=colours, label=names)
    axes.yaxis.set_major_formatter(_THOUSANDS)
    axes.grid(axis="y")
    axes.set_xlim(0, float(edges[-1]))


def lengths(tasks: pd.DataFrame) -> Figure:
    """Draw how long the reference trajectories are, in metres and in actions."""
    with styled():
        figure = Figure(figsize=(WIDTH_IN, 2.5), layout="constrained")
        left, right = figure.subplots(1, 2)
        _histogram(left, tasks, "length_m", np.arange(0.0, 101.0, 2.0))
        left.set(xlabel="length of the reference trajectory, m", ylabel="navigation tasks per 2 m")
        left.legend(loc="upper right")
        most = int(tasks["n_actions"].max()) if len(tasks) else 0
        step = max(1, round(most / 50))
        _histogram(right, tasks, "n_actions", np.arange(0.5, most + 2.0 * step, step))
        per = "action" if step == 1 else f"{step} actions"
        right.set(xlabel="actions, Stop included", ylabel=f"navigation tasks per {per}")
    return figure


def detours(tasks: pd.DataFrame) -> Figure:
    """Draw how much longer than the straight line the reference trajectories are."""
    with styled():
        figure = Figure(figsize=(WIDTH_IN * 0.62, 2.6), layout="constrained")
        axes = figure.subplots()
        _beyond(axes, tasks, "detour_ratio", 1.0, 1.5, 0.995, 1.6, " (median {:.2f})")
        axes.set(xlabel="detour ratio κ = length / straight distance", ylabel="tasks with a larger ratio, %")
        axes.axvline(1.05, color="#888888", lw=0.8, ls=(0, (3, 2)))
        axes.annotate(
            "kept from 1.05", (1.05, 50), (-2, 0), textcoords="offset points", fontsize=6.5, color="#666666",
            rotation=90, ha="right", va="center",
        )  # fmt: skip
        axes.grid()
        axes.legend(loc="upper right")
    return figure


def shares(tasks: pd.DataFrame) -> Figure:
    """Draw instances by family and setting, train and test by partition, and the mean length by family."""
    families = family_order(tasks["family"])
    with styled():
        figure = Figure(figsize=(WIDTH_IN, 2.7), layout="constrained")
        left, middle, right = figure.subplots(1, 3, width_ratios=(1.3, 0.8, 1.0))
        by_family = _counts(tasks, "family", families, "setting", SETTINGS)
        _grouped(left, families, by_family, [(SETTING_NAMES[s], SETTING_COLOURS[s]) for s in SETTINGS])
        left.set(ylabel="task instances", title="(a) By family and setting")
        by_partition = _counts(tasks, "partition", _PARTITIONS, "subset", _SUBSET_COLOURS)
        _grouped(middle, list(_PARTITIONS), by_partition, list(_SUBSET_COLOURS.items()))
        middle.set(title="(b) Train and test")
        means = [float(tasks["length_m"][tasks["family"] == f].to_numpy().mean()) for f in families]
        bars = right.bar(families, means, width=0.62, color=[FAMILY_COLOURS.get(f, OTHER_COLOUR) for f in families])
        right.bar_label(bars, [f"{mean:.1f}" for mean in means], padding=2, fontsize=7)
        top = 1.14 * max(means, default=1.0)
        right.set(ylabel="mean length, m", title="(c) Reference trajectories", ylim=(0.0, top))
        for axes in (left, right):
            axes.set_xticks(range(len(families)), families, rotation=22, ha="right", rotation_mode="anchor")
        for axes in (left, middle, right):
            axes.grid(axis="y")
            axes.tick_params(axis="x", length=0)
    return figure


def _grouped(axes: Axes, names: list[str], counts: NDArray[np.int64], kinds: list[tuple[str, str]]) -> None:
    """Draw a group of bars a name, a bar a kind, with their counts above."""
    width = 0.8 / len(kinds)
    for k, (kind, colour) in enumerate(kinds):
        places = np.arange(len(names)) + (k - (len(kinds) - 1) / 2) * width
        bars = axes.bar(places, counts[:, k], width=0.92 * width, color=colour, label=kind)
        # There is little room above a bar: 286, 7.1k, 42k, 114k.
        above = [f"{n}" if n < 1000 else f"{n / 1000:.{3 if n >= 100_000 else 2}g}k" for n in counts[:, k].tolist()]
        axes.bar_label(bars, above, padding=1.5, fontsize=5)
    axes.set_xticks(range(len(names)), names)
    axes.yaxis.set_major_formatter(_THOUSANDS)
    axes.set_ylim(0.0, 1.1 * int(counts.max(initial=0)) or 1.0)
    axes.legend(loc="upper right")


def difficulty(tasks: pd.DataFrame) -> Figure:
    """Draw the shares of tasks with a greater detour, with a greater climb, and with what makes a task easy."""
    with styled():
        figure = Figure(figsize=(WIDTH_IN, 2.5), layout="constrained")
        left, middle, right = figure.subplots(1, 3, width_ratios=(1.1, 1.0, 1.1))
        _beyond(left, tasks, "plan_detour", 1.0, 1.1)
        left.axvline(DETOUR, color="#888888", lw=0.8, ls=(0, (3, 2)))
        left.set(xlabel="length / shortest without obstacles", ylabel="tasks beyond, %", title="(a) Detour")
        left.legend(loc="upper right")
        _beyond(middle, tasks, "climb_m", 0.0, 0.1)
        middle.set(xlabel="metres flown upwards", title="(b) Climb")
        easy = {
            f"detour\nbelow {DETOUR}": tasks["plan_detour"] < DETOUR,
            "straight\nline free": tasks["straight_line_free"] == 1.0,
            "target\nin view": tasks["target_visible_at_start"] > 0.0,
        }
        for k, setting in enumerate(SETTINGS):
            own = tasks["setting"] == setting
            shares = [100.0 * float(np.mean(mask[own])) if own.any() else 0.0 for mask in easy.values()]
            right.bar(np.arange(3) + (k - 1) * 0.27, shares, width=0.25, color=SETTING_COLOURS[setting])
        right.set_xticks(range(3), list(easy))
        right.tick_params(axis="x", length=0)
        right.set(ylabel="tasks, %", ylim=(0.0, None), title="(c) What makes tasks easy")
        for axes in (left, middle, right):
            axes.grid(axis="y")
    return figure


def _beyond(
    axes: Axes, tasks: pd.DataFrame, name: str, least: float, far: float, q: float = 0.99, width: float = 1.4,
    median: str = "",
) -> None:  # fmt: skip
    """Draw the share of tasks beyond each value of a column, a curve a setting."""
    for setting in SETTINGS:
        own = np.sort(tasks[name][tasks["setting"] == setting].dropna().to_numpy(np.float64))
        if not len(own):
            continue
        share = 100.0 * (1.0 - np.arange(1, len(own) + 1) / len(own))
        thin = np.unique(np.linspace(0, len(own) - 1, _STEPS).astype(int))
        label = SETTING_NAMES[setting] + median.format(np.median(own))
        axes.step(own[thin], share[thin], where="post", color=SETTING_COLOURS[setting], lw=width, label=label)
        far = max(far, float(np.quantile(own, q)))
    axes.set(xlim=(least, far), ylim=(0, 100))


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
            axes.set(ylim=(rows - 0.4, -0.6), xlim=(0, 1.16 * longest), xlabel=unit)
            axes.tick_params(axis="y", length=0)
            axes.grid(axis="x")
        figure.suptitle(f"{len(shown)} of {len(ranked)} {things}", x=0.01, ha="left", fontsize="medium")
        order = family_order(families.values())
        patches = [Patch(color=FAMILY_COLOURS.get(f, OTHER_COLOUR), label=f) for f in order]
        figure.legend(handles=patches, loc="outside upper right", ncols=max(len(patches), 1))
    return figure
