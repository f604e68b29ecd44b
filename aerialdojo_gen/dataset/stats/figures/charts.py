"""Charts of a release's tasks: what they are made of, how long they are, how far from straight."""

from __future__ import annotations

import re

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from numpy.typing import NDArray

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

_THOUSANDS = FuncFormatter(lambda value, _: f"{value:,.0f}")


def _families(routes: Routes) -> list[str]:
    there = set(routes.family.tolist())
    return [*(f for f in FAMILY_COLOURS if f in there), *sorted(there - {*FAMILY_COLOURS})]


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
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlim(0, max(1.0, float(left.max())) * 1.16)
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.xaxis.set_major_formatter(_THOUSANDS)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x")
    axes.set_xlabel("task instances")


def _counts(routes: Routes, keys: NDArray[np.str_], names: list[str]) -> NDArray[np.int64]:
    """Task instances (two a navigation task) by name and setting."""
    return np.array(
        [[2 * np.count_nonzero((keys == name) & (routes.setting == s)) for s in SETTINGS] for name in names]
    )


def composition(routes: Routes) -> Figure:
    """Draw task instances by family and by scene type, in shades of their length setting."""
    families = _families(routes)
    family_of = dict(zip(routes.scene_type.tolist(), routes.family.tolist(), strict=True))
    types = [
        kind
        for family in families
        for kind in sorted(
            (k for k, f in family_of.items() if f == family), key=lambda k: (-(routes.scene_type == k).sum(), k)
        )
    ]
    with styled():
        figure = Figure(figsize=(WIDTH_IN, max(2.2, 0.9 + 0.165 * len(types))), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.25))
        _bars(left, families, _counts(routes, routes.family, families))
        left.set_title("By scene family", loc="left")
        spaced = [re.sub(r"(?<=[a-z])(?=[A-Z])", " ", kind) for kind in types]
        _bars(right, spaced, _counts(routes, routes.scene_type, types))
        right.set_title("By scene type", loc="left")
        for axes, owners in ((left, families), (right, [family_of[kind] for kind in types])):
            for label, owner in zip(axes.get_yticklabels(), owners, strict=True):
                label.set_color(FAMILY_COLOURS.get(owner, OTHER_COLOUR))
        handles, names = left.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper right", ncols=3, title=None)
    return figure


def _histogram(axes: Axes, routes: Routes, values: NDArray[np.float64], edges: NDArray[np.float64]) -> None:
    parts = [values[routes.setting == s] for s in SETTINGS]
    axes.hist(
        parts,
        bins=edges.tolist(),
        stacked=True,
        color=[SETTING_COLOURS[s] for s in SETTINGS],
        label=[SETTING_NAMES[s] for s in SETTINGS],
    )
    axes.yaxis.set_major_formatter(_THOUSANDS)
    axes.grid(axis="y")
    axes.set_xlim(0, float(edges[-1]))


def lengths(routes: Routes) -> Figure:
    """Draw how long the reference trajectories are, in metres and in actions."""
    with styled():
        figure = Figure(figsize=(WIDTH_IN, 2.5), layout="constrained")
        left, right = figure.subplots(1, 2)
        _histogram(left, routes, routes.length_m, np.arange(0.0, 101.0, 2.0))
        left.set_xlabel("length of the reference trajectory, m")
        left.set_ylabel("navigation tasks per 2 m")
        left.legend(loc="upper right")
        most = int(routes.n_actions.max(initial=0))
        step = max(1, round(most / 50))
        _histogram(right, routes, routes.n_actions.astype(np.float64), np.arange(0.5, most + 2.0 * step, step))
        right.set_xlabel("actions, Stop included")
        right.set_ylabel("navigation tasks per action" if step == 1 else f"navigation tasks per {step} actions")
    return figure


def detours(routes: Routes) -> Figure:
    """Draw how much longer than the straight line the reference trajectories are."""
    with styled():
        figure = Figure(figsize=(WIDTH_IN * 0.62, 2.6), layout="constrained")
        axes = figure.subplots()
        far = 1.5
        for setting in SETTINGS:
            values = np.sort(routes.detour_ratio[routes.setting == setting])
            if not len(values):
                continue
            share = 100.0 * (1.0 - np.arange(1, len(values) + 1) / len(values))
            label = f"{SETTING_NAMES[setting]} (median {np.median(values):.2f})"
            # Curves of tens of thousands of steps are cut down to what a printed page can show.
            thin = np.unique(np.linspace(0, len(values) - 1, 2000).astype(int))
            axes.step(values[thin], share[thin], where="post", color=SETTING_COLOURS[setting], lw=1.6, label=label)
            far = max(far, float(np.quantile(values, 0.995)))
        axes.set_xlim(1.0, far)
        axes.set_ylim(0, 100)
        axes.set_xlabel("detour ratio κ = length / straight distance")
        axes.set_ylabel("tasks with a larger ratio, %")
        axes.axvline(1.05, color="#888888", lw=0.8, ls=(0, (3, 2)))
        axes.annotate(
            "kept from 1.05", (1.05, 50), (-2, 0), textcoords="offset points", fontsize=6.5, color="#666666",
            rotation=90, ha="right", va="center",
        )  # fmt: skip
        axes.grid()
        axes.legend(loc="upper right")
    return figure
