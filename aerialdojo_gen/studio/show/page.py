"""A task as a self-contained HTML page without scripts."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from aerialdojo_gen.base.pictures import PAGE_JPEG, data_url, encode_jpeg, encode_png
from aerialdojo_gen.base.terminal import shown_in_page
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.studio.show.drawing import CLEARANCE_COLOURS, CLEARANCE_SCALE, draw_map, draw_profile, draw_side
from aerialdojo_gen.studio.show.pictured import PicturedTask

_STOPS_M = (0.25, 0.5, 1.0, 2.0, 5.0)


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
        map=_to_data_url(lambda axes: draw_map(axes, task, 1.6), 9.6, 6.0),
        side=_to_data_url(lambda axes: draw_side(axes, task, 4.0), 9.6, 2.4, left=0.055),
        profile=_to_data_url(lambda axes: draw_profile(axes, task), 9.6, 2.2, left=0.055, bottom=0.2),
        reference=None if task.reference is None else data_url(encode_png(task.reference)),
        frames=[(frame, data_url(encode_jpeg(frame.rgb, PAGE_JPEG))) for frame in task.frames],
        poses=[
            (k, schemas.ACTION_NAMES[action], *pose)
            for k, (action, pose) in enumerate(zip(route["action"], task.poses.tolist(), strict=True))
        ],
        clearances=[(m, to_hex(CLEARANCE_COLOURS(float(CLEARANCE_SCALE(m))))) for m in _STOPS_M],
    )


def _to_data_url(
    draw: Callable[[Axes], None], width: float, height: float, left: float = 0.0, bottom: float = 0.0
) -> str:
    figure = Figure(figsize=(width, height), dpi=120)
    FigureCanvasAgg(figure)
    draw(figure.add_axes((left, bottom, 1.0 - left, 1.0 - bottom - (0.03 if bottom else 0.0))))
    buffer = io.BytesIO()
    figure.savefig(buffer, format="jpeg", pil_kwargs={"quality": 86})
    return data_url(buffer.getvalue())


def write_page(task: PicturedTask, path: Path) -> Path:
    """Write the page of a task atomically."""
    with atomic_file(path.parent, path.name) as temporary:
        temporary.write_text(render_page(task), encoding="utf-8")
    return path
