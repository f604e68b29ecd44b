"""How hard a release's tasks are: detours round obstacles, and what start and straight line give away."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import DETOUR
from aerialdojo_gen.dataset.stats.difficulty import Tasks
from aerialdojo_gen.dataset.stats.figures.style import SETTING_COLOURS, SETTING_NAMES, WIDTH_IN, styled
from aerialdojo_gen.store.schemas import SETTINGS

# A curve of tens of thousands of steps is cut down to what a printed page can show.
_STEPS = 2000


def difficulty(tasks: Tasks) -> Figure:
    """Draw the shares of tasks with a greater detour, with a greater climb, and with what makes a task easy."""
    with styled():
        figure = Figure(figsize=(WIDTH_IN, 2.5), layout="constrained")
        left, middle, right = figure.subplots(1, 3, width_ratios=(1.1, 1.0, 1.1))
        _beyond(left, tasks, tasks.plan_detour, 1.0)
        left.axvline(DETOUR, color="#888888", lw=0.8, ls=(0, (3, 2)))
        left.set_xlabel("length / shortest without obstacles")
        left.set_ylabel("tasks beyond, %")
        left.legend(loc="upper right")
        left.set_title("(a) Detour", loc="left")
        _beyond(middle, tasks, tasks.climb_m, 0.0)
        middle.set_xlabel("metres flown upwards")
        middle.set_title("(b) Climb", loc="left")
        easy = {
            f"detour\nbelow {DETOUR}": tasks.plan_detour < DETOUR,
            "straight\nline free": tasks.straight_line_free == 1.0,
            "target\nin view": tasks.target_visible_at_start > 0.0,
        }
        for k, setting in enumerate(SETTINGS):
            own = tasks.setting == setting
            shares = [100.0 * float(np.mean(mask[own])) if own.any() else 0.0 for mask in easy.values()]
            right.bar(np.arange(3) + (k - 1) * 0.27, shares, width=0.25, color=SETTING_COLOURS[setting])
        right.set_xticks(range(3), list(easy))
        right.tick_params(axis="x", length=0)
        right.set_ylabel("tasks, %")
        right.set_ylim(bottom=0.0)
        right.set_title("(c) What makes tasks easy", loc="left")
        for axes in (left, middle, right):
            axes.grid(axis="y")
    return figure


def _beyond(axes: Axes, tasks: Tasks, values: NDArray[np.float64], least: float) -> None:
    far = least + 0.1
    for setting in SETTINGS:
        own = np.sort(values[(tasks.setting == setting) & np.isfinite(values)])
        if not len(own):
            continue
        share = 100.0 * (1.0 - np.arange(1, len(own) + 1) / len(own))
        thin = np.unique(np.linspace(0, len(own) - 1, _STEPS).astype(int))
        colour, name = SETTING_COLOURS[setting], SETTING_NAMES[setting]
        axes.step(own[thin], share[thin], where="post", color=colour, lw=1.4, label=name)
        far = max(far, float(np.quantile(own, 0.99)))
    axes.set_xlim(least, far)
    axes.set_ylim(0, 100)
