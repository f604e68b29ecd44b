"""What all figures share: colours, type, and files that do not change from run to run."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.store.schemas import FAMILIES, SETTINGS

# Settings are ordered, so they are shades of one colour; families are not (Paul Tol's muted scheme).
SETTING_COLOURS = dict(zip(SETTINGS, ("#9ecae1", "#4292c6", "#08417c"), strict=True))
SETTING_NAMES = dict(zip(SETTINGS, ("Base", "Standard", "Long-horizon"), strict=True))
FAMILY_COLOURS = dict(zip(FAMILIES.values(), ("#cc6677", "#117733", "#b58900", "#882255"), strict=True))
OTHER_COLOUR = "#555555"
WIDTH_IN = 7.2
_DPI = 200

_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.titlesize": 8.5,
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


def family_order(there: Iterable[str]) -> list[str]:
    """Order families as the paper has them, others behind them by name."""
    names = set(there)
    return [*(f for f in FAMILY_COLOURS if f in names), *sorted(names - {*FAMILY_COLOURS})]


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
