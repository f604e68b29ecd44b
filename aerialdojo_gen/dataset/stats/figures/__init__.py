"""Figures of a release, as PNG and SVG: what it is made of, lengths, detours, difficulty, categories, names, maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from aerialdojo_gen.dataset.stats.figures import charts
from aerialdojo_gen.dataset.stats.figures.charts import WIDTH_IN, styled
from aerialdojo_gen.dataset.stats.measures import has_difficulty, read_tasks
from aerialdojo_gen.rendering.orthographic import OrthographicPictures
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.stored import mesh_copy
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, Where, open_root

_COLUMNS = 6
_GAP_IN, _TITLE_IN, _LEGEND_IN = 0.07, 0.14, 0.3
_CELL_IN = (WIDTH_IN - _GAP_IN) / _COLUMNS - _GAP_IN
_PIXELS = 220
_OPACITY = 0.75
_MARKS: dict[str, dict[str, Any]] = {
    "anchor": {"marker": "o", "ms": 0.9, "mfc": "#1f4fd8", "mec": "none"},
    "object": {"marker": "o", "ms": 2.3, "mfc": "#ffd21f", "mec": "#222222", "mew": 0.35},
    "landmark": {"marker": "*", "ms": 6.0, "mfc": "#e3242b", "mec": "white", "mew": 0.45},
}


def draw_figures(data: Where, scenes: Sequence[str], folder: Path) -> list[Path]:
    """Draw all figures."""
    root = open_root(data)
    tasks = read_tasks(root, scenes)
    figures = {
        "composition": charts.composition(tasks),
        "shares": charts.shares(tasks),
        "lengths": charts.lengths(tasks),
        "detours": charts.detours(tasks),
        **({"difficulty": charts.difficulty(tasks)} if has_difficulty(tasks) else {}),
        "categories": charts.categories(root, scenes),
        "names": charts.names(root, scenes),
        "maps": _maps(root, scenes),
    }
    return [path for name, figure in figures.items() for path in charts.save(figure, folder, name)]


def _maps(root: DataRoot, scenes: Sequence[str]) -> Figure:
    """Draw a small map of every scene, north up, each with a scale of its own."""
    rows = [store.read_scene(root, "release/scenes", scene).to_pylist()[0] for scene in scenes]
    lines = [rows[k : k + _COLUMNS] for k in range(0, len(rows), _COLUMNS)]
    sizes = [[_size_in(row) for row in line] for line in lines]
    heights = [max(height for _, height in line) + _TITLE_IN + _GAP_IN for line in sizes]
    width, height = max(len(lines[0]), 3) * (_CELL_IN + _GAP_IN) + _GAP_IN, _LEGEND_IN + sum(heights)
    with styled():
        figure = Figure(figsize=(width, height))
        top = _LEGEND_IN
        for line, line_sizes, line_height in zip(lines, sizes, heights, strict=True):
            for k, (row, (w, h)) in enumerate(zip(line, line_sizes, strict=True)):
                left = _GAP_IN + k * (_CELL_IN + _GAP_IN) + (_CELL_IN - w) / 2
                low = height - top - _TITLE_IN - h
                axes = figure.add_axes((left / width, low / height, w / width, h / height))
                _map(axes, root, row)
            top += line_height
        handles = [
            Line2D([], [], ls="none", label=name, **style)
            for name, style in zip(("start anchor", "target object", "landmark"), _MARKS.values(), strict=True)
        ]
        figure.legend(
            handles=handles, loc="upper center", ncols=3, borderaxespad=0.3, handletextpad=0.2, markerscale=1.6
        )
    return figure


def _size_in(row: dict[str, Any]) -> tuple[float, float]:
    """Width and height of a scene's map, inches: as large as its cell allows."""
    east_west, north_south = row["max_x_m"] - row["min_x_m"], row["max_y_m"] - row["min_y_m"]
    scale = _CELL_IN / max(east_west, north_south)
    return scale * east_west, scale * north_south


def _map(axes: Axes, root: DataRoot, row: dict[str, Any]) -> None:
    scene = row["scene"]
    west, south, east, north = (row[f"{e}_{a}_m"] for e in ("min", "max") for a in "xy")
    try:
        mesh = mesh_copy(root, row["mesh_path"])
    except FileNotFoundError:
        mesh = None
    axes.set_facecolor("white" if mesh else "#f2f2f2")
    if mesh:
        pixel_m = max(east - west, north - south) / _PIXELS
        picture = OrthographicPictures(read_glb(mesh, row["mesh_sha256"])).from_above(
            (west, east, south, north), pixel_m
        )
        # A little paled, so that marks stand out.
        axes.imshow(picture, extent=(west, east, south, north), interpolation="none", alpha=_OPACITY)
    for table, kind in (("anchors", "anchor"), ("objects", "object"), ("landmarks", "landmark")):
        places = store.read_scene(root, f"release/{table}", scene, ["x_m", "y_m"])
        axes.plot(places["x_m"].to_numpy(), places["y_m"].to_numpy(), ls="none", **_MARKS[kind])
    axes.set(xlim=(west, east), ylim=(south, north), xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set(visible=True, linewidth=0.4, color="#888888")
    axes.set_title(scene, loc="center", fontsize=5.5, pad=1.5)
    reach = _round_length((east - west) / 3)
    x, y = west + 0.05 * (east - west), south + 0.06 * (north - south)
    axes.plot([x, x + reach], [y, y], color="white", lw=2.2, solid_capstyle="butt")
    axes.plot([x, x + reach], [y, y], color="black", lw=1.0, solid_capstyle="butt")
    axes.annotate(
        f"{reach:g} m", (x + reach / 2, y), (0, 2), textcoords="offset points", ha="center", fontsize=4.5,
        bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.7},
    )  # fmt: skip


def _round_length(most_m: float) -> float:
    """Return the greatest of 1, 2 and 5 times a power of ten that is not above a length."""
    power = 10.0 ** math.floor(math.log10(most_m))
    return max(n * power for n in (1, 2, 5) if n * power <= most_m)
