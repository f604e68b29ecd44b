"""The parts of a task's figure, each on its own axes: map, side view, height profile."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.patches import Polygon, Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from aerialdojo_gen.rendering.orthographic import Plane
from aerialdojo_gen.studio.show.pictured import PicturedTask

Floats = NDArray[np.float64]

# Clearance from tight (red) to open (blue), as in `view`; safe for colour-blind readers.
STOPS = {0.25: "#a50026", 0.5: "#f46d43", 1.0: "#fee090", 2.0: "#74add1", 5.0: "#313695"}
CLEARANCE_SCALE = LogNorm(min(STOPS), max(STOPS), clip=True)
CLEARANCE_COLOURS = LinearSegmentedColormap.from_list(
    "clearance", [(math.log(m / 0.25) / math.log(5.0 / 0.25), colour) for m, colour in STOPS.items()]
)

_START, _GOAL, _TARGET = "#0284c7", "#16a34a", "#facc15"
_HALO = (withStroke(linewidth=3, foreground="black"),)
_HALO_OF_BAR = (withStroke(linewidth=5, foreground="black"),)
_MARGIN_M, _MIN_M, _ABOVE_M = 7.0, 26.0, 3.0
# Label width at a route's ends, as a share of the figure's width.
_LABEL_SHARE = 0.09


def draw_map(axes: Axes, task: PicturedTask, aspect: float) -> None:
    """Draw the route from above, north up."""
    way, landmark = task.way, _centre(task.landmark)
    corners = np.array([way.min(axis=0), way.max(axis=0), *_box(task.target)])[:, :2]
    with_landmark = np.vstack([corners, landmark[:2]])
    # A far landmark would make the route small: use an arrow at the edge instead.
    near = np.ptp(with_landmark, axis=0).max() <= max(1.7 * np.ptp(corners, axis=0).max(), 45.0)
    extent = _frame(with_landmark if near else corners, aspect)
    height = max(way[:, 2].max(), _box(task.target)[1][2]) + _ABOVE_M
    plane = Plane.above(height, extent)
    _picture(axes, task, plane)
    _route(axes, task, plane)
    low, high = _box(task.target)
    axes.add_patch(
        Rectangle((low[0], low[1]), high[0] - low[0], high[1] - low[1], fill=False, ec=_TARGET, lw=1.8, zorder=5)
    )
    for (x, y, _, yaw), colour in ((task.poses[0], _START), (task.poses[-1], _GOAL)):
        reach = 0.045 * (extent[1] - extent[0])
        axes.annotate(
            "", (x + reach * math.cos(yaw), y + reach * math.sin(yaw)), (x, y), zorder=7,
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.4, "path_effects": list(_HALO)},
        )  # fmt: skip
    _endpoints(axes, task, plane)
    _landmark(axes, task, extent)
    _compass(axes)
    _scale_bar(axes, extent)


def draw_side(axes: Axes, task: PicturedTask, aspect: float) -> None:
    """Draw the route from the side, start on the left, goal on the right; what is in front of it is cut away."""
    first, last = task.way[0], task.way[-1]
    along = np.array([last[0] - first[0], last[1] - first[1], 0.0])
    if np.linalg.norm(along) < 1.0:
        spread = np.ptp(task.way, axis=0)
        along = np.array([1.0, 0.0, 0.0]) if spread[0] >= spread[1] else np.array([0.0, 1.0, 0.0])
    right, up = along / np.linalg.norm(along), np.array([0.0, 0.0, 1.0])
    forward = np.cross(up, right)
    points = np.vstack([task.way, _box(task.target)])
    origin = forward * (float((points @ forward).min()) - 1.0)
    flat = Plane(origin, right, up, (0.0, 1.0, 0.0, 1.0)).project(points)
    ground = np.nanmin(np.append(task.below_m, points[:, 2].min()))
    extent = _frame(np.vstack([flat, [flat[0, 0], ground]]), aspect, around_m=3.0, least_m=4.0)
    # Spare room goes above: below there is only earth.
    height = extent[3] - extent[2]
    bottom = min(extent[2] + 0.4 * height, min(ground, float(flat[:, 1].min())) - 0.12 * height)
    extent = (extent[0], extent[1], bottom, bottom + height)
    plane = Plane(origin, right, up, extent)
    _picture(axes, task, plane)
    _route(axes, task, plane)
    _endpoints(axes, task, plane)
    axes.set_ylabel("height z, m", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.set_xticks([])
    _scale_bar(axes, extent, 0.42)
    toward = math.degrees(math.atan2(forward[0], forward[1])) % 360.0
    axes.text(
        0.99, 0.96, f"looking {toward:.0f}° from north", transform=axes.transAxes, ha="right", va="top", fontsize=8,
        color="white", path_effects=_HALO,
    )  # fmt: skip


def draw_profile(axes: Axes, task: PicturedTask) -> None:
    """Draw height over distance flown, and the surface below."""
    s, z = task.along_m, task.way[:, 2]
    floor = np.nanmin(np.append(task.below_m, z.min())) - 0.06 * max(2.0, float(np.ptp(z)))
    below = np.where(np.isnan(task.below_m), floor, task.below_m)
    axes.fill_between(s, floor, below, color="#94a3b8", lw=0, label="surface below")
    axes.add_collection(_clearance_line(np.column_stack([s, z]), task.clearance_m, 3.4))
    axes.set_xlim(0.0, max(float(s[-1]), 1.0))
    axes.set_ylim(floor, max(float(z.max()), float(below.max())) + 0.12 * max(2.0, float(np.ptp(z))))
    axes.set_xlabel("distance flown, m", fontsize=8)
    axes.set_ylabel("z, m", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3, lw=0.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def plain(text: str) -> str:
    """Escape dollar signs, which matplotlib would read as mathematics."""
    return text.replace("$", r"\$")


def _centre(row: dict[str, float]) -> Floats:
    return np.array([row["x_m"], row["y_m"], row["z_m"]])


def _box(row: dict[str, float]) -> Floats:
    """Lower and upper corner of an object's box, (2, 3)."""
    half = np.array([row["size_x_m"], row["size_y_m"], row["size_z_m"]]) / 2.0
    return np.stack([_centre(row) - half, _centre(row) + half])


def _frame(
    points: Floats, aspect: float, around_m: float = _MARGIN_M, least_m: float = _MIN_M
) -> tuple[float, float, float, float]:
    """Return an extent of the given aspect around points (n, 2), with a margin."""
    low, high = points.min(axis=0) - around_m, points.max(axis=0) + around_m
    middle = (low + high) / 2.0
    width = max(high[0] - low[0], aspect * (high[1] - low[1]), least_m)
    half = np.array([width, width / aspect]) / 2.0
    return (
        float(middle[0] - half[0]), float(middle[0] + half[0]), float(middle[1] - half[1]), float(middle[1] + half[1])
    )  # fmt: skip


def _picture(axes: Axes, task: PicturedTask, plane: Plane) -> None:
    extent = plane.extent_m
    box = axes.get_window_extent()
    picture = task.pictures.take(plane, (extent[1] - extent[0]) / max(1.0, box.width))
    axes.imshow(picture, extent=extent, interpolation="antialiased", zorder=0)
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.set_xticks([])
    if plane.up[2] == 0.0:
        axes.set_yticks([])


def _clearance_line(points: Floats, clearance_m: Floats, width: float) -> LineCollection:
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    return LineCollection(
        list(pieces), array=np.minimum(clearance_m[:-1], clearance_m[1:]), cmap=CLEARANCE_COLOURS,
        norm=CLEARANCE_SCALE, linewidths=width, capstyle="round", zorder=4,
    )  # fmt: skip


def _route(axes: Axes, task: PicturedTask, plane: Plane) -> None:
    flat = plane.project(task.way)
    axes.plot(flat[:, 0], flat[:, 1], color="black", lw=5.4, solid_capstyle="round", zorder=3)
    axes.add_collection(_clearance_line(flat, task.clearance_m, 3.6))


def _endpoints(axes: Axes, task: PicturedTask, plane: Plane) -> None:
    ends = plane.project(task.way[[0, -1]])
    low, high = sorted(axes.get_xlim())
    for (a, b), other, text, colour in zip(ends, ends[::-1], ("start", "goal"), (_START, _GOAL), strict=True):
        axes.plot([a], [b], "o", ms=10, mfc=colour, mec="white", mew=1.6, zorder=8)
        # Away from the other end, unless the figure ends there.
        side = -1 if a < other[0] else 1
        has_room = (a - low if side < 0 else high - a) > _LABEL_SHARE * (high - low)
        axes.annotate(
            text, (a, b), (10 * side, 0) if has_room else (0, 8), textcoords="offset points",
            ha=("right" if side < 0 else "left") if has_room else "center", va="center" if has_room else "bottom",
            fontsize=10, weight="bold", color="white", path_effects=_HALO, zorder=9, clip_on=True,
        )  # fmt: skip


def _landmark(axes: Axes, task: PicturedTask, extent: tuple[float, float, float, float]) -> None:
    """Mark the landmark and the direction to the target, or an arrow towards it."""
    mark, target = _centre(task.landmark)[:2], _centre(task.target)[:2]
    distance = float(np.linalg.norm(target - mark))
    inside = extent[0] < mark[0] < extent[1] and extent[2] < mark[1] < extent[3]
    name = task.landmark["name"]
    words = f"{name}: target {distance:.0f} m to its {task.target['direction']}"
    start = mark
    if not inside:
        low, high = np.array([extent[0], extent[2]]), np.array([extent[1], extent[3]])
        way = mark - target
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(way > 0, (high - target) / way, np.where(way < 0, (low - target) / way, np.inf))
        start = target + way * float(reach.min()) * 0.985
    axes.annotate(
        "", tuple(target), tuple(start), zorder=6,
        arrowprops={"arrowstyle": "-|>", "color": "white", "lw": 1.4, "ls": (0, (4, 3)), "path_effects": list(_HALO)},
    )  # fmt: skip
    centre = (extent[0] + extent[1]) / 2.0
    side = "left" if start[0] < centre else "right"
    offset = (8 if side == "left" else -8, 9 if start[1] < (extent[2] + extent[3]) / 2.0 else -13)
    if inside:
        axes.plot(*mark, "*", ms=17, mfc="white", mec="black", mew=1.2, zorder=8)
    axes.annotate(
        plain(words), tuple(start), offset, textcoords="offset points", ha=side, weight="bold", fontsize=9,
        color="white", path_effects=_HALO, zorder=9, clip_on=True,
    )  # fmt: skip


def _compass(axes: Axes) -> None:
    box = axes.inset_axes((0.925, 0.86, 0.065, 0.13))
    box.set_xlim(-1, 1)
    box.set_ylim(-1, 1.7)
    box.axis("off")
    box.set_aspect("equal")
    box.add_patch(Polygon([(0, 1), (0.42, -0.8), (0, -0.45)], fc="#dc2626", ec="white", lw=1))
    box.add_patch(Polygon([(0, 1), (-0.42, -0.8), (0, -0.45)], fc="#7f1d1d", ec="white", lw=1))
    box.text(0, 1.32, "N", ha="center", va="center", fontsize=11, weight="bold", color="white", path_effects=_HALO)


def _scale_bar(axes: Axes, extent: tuple[float, float, float, float], share: float = 0.02) -> None:
    """Draw a scale bar of a round length, bottom left."""
    wish = (extent[1] - extent[0]) / 6.0
    power = 10.0 ** math.floor(math.log10(wish))
    length = max(step * power for step in (1, 2, 5) if step * power <= wish)
    x, y = extent[0] + share * (extent[1] - extent[0]), extent[2] + 0.05 * (extent[3] - extent[2])
    axes.plot([x, x + length], [y, y], color="white", lw=3, path_effects=_HALO_OF_BAR)
    axes.annotate(
        f"{length:g} m", (x + length / 2, y), (0, 5), textcoords="offset points", ha="center", fontsize=9,
        color="white", path_effects=_HALO,
    )  # fmt: skip
