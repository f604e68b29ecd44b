"""What all figures share: the routes' figures, colours, type, and files that do not change from run to run."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pyarrow as pa
from matplotlib.figure import Figure
from numpy.typing import NDArray

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


@dataclass(frozen=True)
class Routes:
    """One entry a navigation task."""

    family: NDArray[np.str_]  # (n,) arrays of str
    scene_type: NDArray[np.str_]
    partition: NDArray[np.str_]
    subset: NDArray[np.str_]
    setting: NDArray[np.str_]
    length_m: NDArray[np.float64]  # (n,) float64
    detour_ratio: NDArray[np.float64]
    n_actions: NDArray[np.int32]  # (n,) int32


def read_routes(root: DataRoot, scenes: Sequence[str]) -> Routes:
    """Read what the charts show of the scenes' routes."""
    columns = ["setting", "length_m", "detour_ratio", "n_actions"]
    belongs = ("family", "scene_type", "partition")
    tables: list[pa.Table] = []
    keys: list[tuple[str, ...]] = []
    for scene in scenes:
        row = store.read_scene(root, "release/scenes", scene, belongs).to_pylist()[0]
        for subset in ("train", "test"):
            tables.append(store.read_scene(root, f"routes/{subset}", scene, columns))
            keys += [(*(row[name] for name in belongs), subset)] * tables[-1].num_rows
    table = pa.concat_tables(tables)
    family, scene_type, partition, side = np.array(keys, dtype=np.str_).reshape(-1, 4).T
    return Routes(
        family,
        scene_type,
        partition,
        side,
        np.array(table.column("setting").to_pylist(), dtype=np.str_),
        *(table.column(name).to_numpy() for name in columns[1:]),
    )


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
            paths.append(folder / (name + suffix))
    return paths
