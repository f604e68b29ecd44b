"""A task as one PNG, and as a self-contained HTML page without scripts."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Callable
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.pictures import PAGE_JPEG, Picture, encode_jpeg, encode_png
from aerialdojo_gen.base.terminal import shown_in_page
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store.atomic import atomic_file, atomic_write
from aerialdojo_gen.studio.show import charts
from aerialdojo_gen.studio.show.pictured import PicturedTask


def render_page(task: PicturedTask) -> str:
    """Render the page of a task."""
    template = Environment(
        loader=PackageLoader("aerialdojo_gen.studio.show", "."),
        autoescape=True,
        finalize=shown_in_page,
        undefined=StrictUndefined,
    ).get_template("page.html.jinja")
    route = task.task.route
    return template.render(
        task=task,
        route=route,
        map=_to_data_url(lambda axes: charts.draw_map(axes, task, 1.6), 9.6, 6.0),
        side=_to_data_url(lambda axes: charts.draw_side(axes, task, 4.0), 9.6, 2.4, left=0.055),
        profile=_to_data_url(lambda axes: charts.draw_profile(axes, task), 9.6, 2.2, left=0.055, bottom=0.2),
        reference=None if task.reference is None else Picture(encode_png(task.reference)).data_url,
        frames=[(frame, Picture(encode_jpeg(frame.rgb, PAGE_JPEG)).data_url) for frame in task.frames],
        poses=[
            (k, schemas.ACTION_NAMES[action], *pose)
            for k, (action, pose) in enumerate(zip(route["action"], task.poses.tolist(), strict=True))
        ],
        clearances=[(m, to_hex(charts.CLEARANCE_COLOURS(float(charts.CLEARANCE_SCALE(m))))) for m in charts.STOPS],
    )


def _to_data_url(
    draw: Callable[[Axes], None], width: float, height: float, left: float = 0.0, bottom: float = 0.0
) -> str:
    figure = Figure(figsize=(width, height), dpi=120)
    FigureCanvasAgg(figure)
    draw(figure.add_axes((left, bottom, 1.0 - left, 1.0 - bottom - (0.03 if bottom else 0.0))))
    buffer = io.BytesIO()
    figure.savefig(buffer, format="jpeg", pil_kwargs={"quality": 86})
    return Picture(buffer.getvalue()).data_url


def write_page(task: PicturedTask, path: Path) -> Path:
    """Write the page of a task atomically."""
    atomic_write(path.parent, path.name, render_page(task))
    return path


_WIDTH_IN, _DPI = 14.0, 120
_FRAMES_IN = 2.95


def task_figure(task: PicturedTask) -> Figure:
    """Draw a task, 1680 pixels wide."""
    strip = _FRAMES_IN if task.frames else 0.0
    sheet = _Sheet(_WIDTH_IN, 8.7 + strip)
    figure, top = sheet.figure, sheet.height
    size = min(19.0, 1700 / len(task.title))
    figure.text(0.45 / _WIDTH_IN, 1 - 0.42 / top, charts.plain(task.title), fontsize=size, weight="bold", va="center")
    figure.text(0.45 / _WIDTH_IN, 1 - 0.80 / top, charts.plain(task.place), fontsize=11, color="#475569", va="center")

    charts.draw_map(sheet.axes(0.45, top - 6.25, 8.3, 5.2), task, 8.3 / 5.2)
    side = sheet.axes(0.85, strip + 0.3, 7.9, 1.95)
    charts.draw_side(side, task, 7.9 / 1.95)

    if task.reference is not None:
        image = sheet.axes(9.05, top - 3.35, 2.3, 2.3)
        image.imshow(task.reference)
        image.axis("off")
        figure.text(9.05 / _WIDTH_IN, 1 - 0.96 / top, "reference image", fontsize=9, color="#475569")
    y = top - 1.2
    for name, value in task.facts:
        figure.text(11.6 / _WIDTH_IN, y / top, name, fontsize=9, color="#475569")
        y -= 0.17
        for line in textwrap.wrap(charts.plain(value), 27)[:3]:
            figure.text(11.6 / _WIDTH_IN, y / top, line, fontsize=10.5)
            y -= 0.17
    words = "\n".join(line for part in charts.plain(task.goal).splitlines() for line in textwrap.wrap(part, 68))
    figure.text(
        9.05 / _WIDTH_IN, (top - 3.85) / top, words, fontsize=9.5, va="top", linespacing=1.35,
        bbox={"facecolor": "#e8eefc", "edgecolor": "none", "boxstyle": "square,pad=0.5"},
    )  # fmt: skip
    under_words = top - 4.25 - 0.19 * (words.count("\n") + 1)
    charts.draw_profile(sheet.axes(9.5, strip + 1.2, 4.2, min(2.9, under_words - strip - 1.2)), task)
    bar = figure.colorbar(
        ScalarMappable(charts.CLEARANCE_SCALE, charts.CLEARANCE_COLOURS),
        cax=sheet.axes(9.5, strip + 0.5, 4.2, 0.1),
        orientation="horizontal", ticks=list(charts.STOPS), format="%g",
    )  # fmt: skip
    bar.ax.minorticks_off()
    bar.ax.tick_params(labelsize=7)
    bar.set_label("clearance, m", fontsize=8, labelpad=1)
    _frames(sheet, task)
    return figure


class _Sheet:
    """A figure whose axes are placed in inches from the lower left corner."""

    def __init__(self, width_in: float, height_in: float) -> None:
        self.width, self.height = width_in, height_in
        self.figure = Figure(figsize=(width_in, height_in), dpi=_DPI, facecolor="white")
        FigureCanvasAgg(self.figure)

    def axes(self, x: float, y: float, width: float, height: float) -> Axes:
        return self.figure.add_axes((x / self.width, y / self.height, width / self.width, height / self.height))


def _frames(sheet: _Sheet, task: PicturedTask) -> None:
    if not task.frames:
        return
    count, gap = len(task.frames), 0.12
    edge = min(2.45, (sheet.width - 0.9 - (count - 1) * gap) / count)
    spare = min(0.25, (sheet.width - 0.9 - count * edge) / max(1, count - 1))
    for k, frame in enumerate(task.frames):
        axes = sheet.axes(0.45 + k * (edge + spare), 0.2, edge, edge)
        axes.imshow(frame.rgb)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(f"pose {frame.step}: {frame.action}", fontsize=min(9.0, 4.2 * edge), pad=3)


def write_png(task: PicturedTask, path: Path) -> Path:
    """Write the figure of a task atomically."""
    if path.suffix.lower() != ".png":
        raise UsageError(f"{path}: the output must be a PNG file, for example {path.with_suffix('.png').name}")
    with atomic_file(path.parent, path.name) as temporary:
        task_figure(task).savefig(temporary, format="png", metadata={"Software": None})
    return path
