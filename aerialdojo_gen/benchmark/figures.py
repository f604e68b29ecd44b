"""Figures of an evaluation, PNG and SVG: success against the radius, and the radar charts of the paper's Fig. 5.

A radar's axes end where the data does: for agents that solve 1 % of the tasks an axis to 100 % would show a dot. Or
they are the paper's, which are fixed; a value beyond an axis is drawn at its end.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from aerialdojo_gen.benchmark.metrics import PAPER_METRICS, Profile, success_curve, summarize
from aerialdojo_gen.benchmark.runs import GROUP_OF, UPPER_BOUND, Run
from aerialdojo_gen.store.schemas import FAMILIES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# Okabe and Ito's colours, which colour-blind readers can distinguish; line styles carry what is left.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans", "font.size": 9, "axes.linewidth": 0.8, "axes.edgecolor": "#444444",
    "grid.color": "#dddddd", "grid.linewidth": 0.6, "svg.hashsalt": "aerialdojo", "svg.fonttype": "path",
}  # fmt: skip


def radius_curve(runs: Sequence[Run], profile: Profile) -> Figure:
    """Draw overall SR (solid) and OSR (dashed) against the success radius, from 0 to 25 m."""
    radii = np.linspace(0.0, 25.0, 501)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, run in enumerate(runs):
            sr, osr = success_curve(run.episodes, profile, radii)
            colour = COLOURS[k % len(COLOURS)]
            axes.plot(radii, 100.0 * sr, "-", color=colour, lw=1.8, label=run.label, zorder=3)
            axes.plot(radii, 100.0 * osr, "--", color=colour, lw=1.2, zorder=2)
        for radius in sorted({profile.radius_m, 5.0} if profile.name == "aerialdojo" else {profile.radius_m}):
            axes.axvline(radius, color="#888888", lw=0.8, ls=":", zorder=1)
            axes.annotate(
                f"{radius:g} m", (radius, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
                textcoords="offset points", ha="center", size=8, color="#555555",
            )  # fmt: skip
        axes.plot([], [], "-", color="#555555", lw=1.8, label="SR")
        axes.plot([], [], "--", color="#555555", lw=1.2, label="OSR")
        axes.set(xlabel="radius, m", ylabel="episodes, %", xlim=(0.0, 25.0), ylim=(-2.0, 102.0))
        axes.grid(True)
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside right upper", frameon=False)

    return draw_figure(draw, (6.0, 3.4))


def draw_figure(draw: Callable[[Figure], None], size_inches: tuple[float, float]) -> Figure:
    """Draw a figure in the common style; nothing of it stays behind."""
    # Not pyplot: that keeps figures for a screen that nobody looks at.
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        figure = Figure(size_inches, layout="constrained")
        draw(figure)
    return figure


def encode_figure(figure: Figure, kind: str) -> bytes:
    """Encode a figure; the same figure gives the same bytes."""
    import matplotlib

    out = io.BytesIO()
    # Without these the file says when, and by which version, it was made.
    metadata: dict[str, Any] = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
    with matplotlib.rc_context(_STYLE):
        figure.savefig(out, format=kind, dpi=200, metadata=metadata)
    return out.getvalue()


_LABELS = {"sr": "SR", "osr": "OSR", "spl": "SPL", "dts_m": "DTS", "cr": "CR"}
_UNITS = {metric: "m" if metric == "dts_m" else "%" for metric in PAPER_METRICS}
_INWARDS = ("dts_m", "cr")
_RINGS = 4
# An axis ends at one of these times a power of ten: all are divided into four without odd digits.
_ENDS = (1.0, 2.0, 4.0, 6.0, 8.0, 10.0)
_FAMILIES = tuple(FAMILIES.values())
# Where the axes of the paper's Fig. 5 end: per cent and metres.
PAPER_ENDS = {"sr": 5.0, "osr": 15.0, "spl": 5.0, "dts_m": 40.0, "cr": 100.0}


def contenders(runs: Sequence[Run]) -> list[tuple[int, Run]]:
    """Return the runs that are drawn, with their place among all: without the oracle, which would fix every scale."""
    drawn = [(k, run) for k, run in enumerate(runs) if GROUP_OF.get(run.agent) != UPPER_BOUND]
    return drawn or list(enumerate(runs))


def axis_end(largest: float, most: float = math.inf) -> float:
    """Return where an axis ends: a round number that is not below a value, and not above the most there can be."""
    if not largest > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(largest))
    return min(most, next(power * end for end in _ENDS if power * end >= largest * (1.0 - 1e-9)))


def metric_radars(runs: Sequence[Run], profile: Profile, paper_axes: bool = False) -> Figure:
    """Draw a chart a metric, an axis a family; `paper` takes the paper's axes."""
    values, ends = _values(runs, profile, paper_axes)
    angles = np.linspace(0.0, 2.0 * math.pi, len(_FAMILIES), endpoint=False)

    def draw(figure: Figure) -> None:
        panels: Any = figure.subplots(2, 3, subplot_kw={"projection": "polar"}).ravel()
        for m, (axes, metric) in enumerate(zip(panels, PAPER_METRICS, strict=False)):
            curves = [(k, run.label, values[n][:, m]) for n, (k, run) in enumerate(contenders(runs))]
            _chart(axes, angles, curves, [(metric, ends[m])] * len(angles), _FAMILIES)
            arrow = "↓" if metric in _INWARDS else "↑"
            axes.set_title(f"{_LABELS[metric]} {arrow}, {_UNITS[metric]}", pad=34, size=10, weight="bold")
            centre = f"{ends[m] if metric in _INWARDS else 0:g} at the centre"
            axes.text(0.5, 1.18, centre, transform=axes.transAxes, ha="center", size=7, color="#777777")
            _ring_labels(axes, metric, ends[m], math.pi / len(angles))
        panels[-1].set_axis_off()
        panels[-1].legend(
            *panels[0].get_legend_handles_labels(), loc="center", frameon=False, title=_note(runs), title_fontsize=8
        )

    return draw_figure(draw, (7.6, 5.4))


def family_radars(runs: Sequence[Run], profile: Profile, paper_axes: bool = False) -> Figure:
    """Draw a chart a family, an axis a metric; an axis ends at the same value in all of them, or at the paper's."""
    values, ends = _values(runs, profile, paper_axes)
    angles = np.linspace(0.0, 2.0 * math.pi, len(PAPER_METRICS), endpoint=False)
    tips = [
        f"{_LABELS[m]}\n{'0' if m in _INWARDS else f'{end:g}'} {_UNITS[m]}"
        for m, end in zip(PAPER_METRICS, ends, strict=True)
    ]
    middle = ", ".join(
        f"{_LABELS[m]} {end if m in _INWARDS else 0:g} {_UNITS[m]}"
        for m, end in zip(PAPER_METRICS, ends, strict=True)
    )

    def draw(figure: Figure) -> None:
        panels: Any = figure.subplots(2, 2, subplot_kw={"projection": "polar"}).ravel()
        for f, (axes, family) in enumerate(zip(panels, _FAMILIES, strict=True)):
            curves = [(k, run.label, values[n][f]) for n, (k, run) in enumerate(contenders(runs))]
            _chart(axes, angles, curves, list(zip(PAPER_METRICS, ends, strict=True)), tips)
            axes.set_title(family, pad=36, size=10, weight="bold")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside lower center", ncols=4, frameon=False, title=_note(runs), title_fontsize=8
        )
        figure.suptitle(f"At the centre: {middle}", size=8, color="#555555")

    return draw_figure(draw, (6.8, 7.0))


def _note(runs: Sequence[Run]) -> str | None:
    return "without the oracle" if len(contenders(runs)) < len(runs) else None


def _values(runs: Sequence[Run], profile: Profile, paper_axes: bool) -> tuple[list[Any], list[float]]:
    """Score the families: for every run (4, 5) float64, per cent and metres; and where the axes end."""
    found = []
    for _, run in contenders(runs):
        families = summarize(run.episodes, profile).families
        rows = [
            [math.nan if family not in families else getattr(families[family], m) for m in PAPER_METRICS]
            for family in _FAMILIES
        ]
        found.append(np.array(rows) * [1.0 if m == "dts_m" else 100.0 for m in PAPER_METRICS])
    if paper_axes:
        return found, [PAPER_ENDS[metric] for metric in PAPER_METRICS]
    largest = np.nanmax(np.stack(found), axis=(0, 1))
    most = [math.inf if metric == "dts_m" else 100.0 for metric in PAPER_METRICS]
    return found, [axis_end(float(value), limit) for value, limit in zip(largest, most, strict=True)]


def _chart(
    axes: Any, angles: Any, curves: Sequence[tuple[int, str, Any]], scales: Sequence[tuple[str, float]],
    tips: Sequence[str],
) -> None:  # fmt: skip
    """Draw one radar: every value as its share of the way from the centre outwards."""
    inwards = np.array([metric in _INWARDS for metric, _ in scales])
    ends = np.array([end for _, end in scales])
    for k, label, values in curves:
        share = np.clip(np.where(inwards, 1.0 - values / ends, values / ends), 0.0, 1.0)
        colour = COLOURS[k % len(COLOURS)]
        # Where curves coincide, the later ones are smaller marks on the earlier.
        axes.plot(
            [*angles, angles[0]], [*share, share[0]], "o-", color=colour, lw=1.6, ms=max(3.0, 6.0 - k), label=label,
            clip_on=False, zorder=3,
        )  # fmt: skip
        axes.fill(angles, share, color=colour, alpha=0.08)
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_xticks(angles, [""] * len(angles))
    for angle, tip in zip(angles, tips, strict=True):
        right = math.sin(angle)
        side = "center" if abs(right) < 0.1 else "left" if right > 0 else "right"
        level = "center" if abs(right) > 0.9 else "bottom" if math.cos(angle) > 0 else "top"
        axes.text(angle, 1.08, tip, ha=side, va=level, size=8)
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks([n / _RINGS for n in range(1, _RINGS + 1)], [""] * _RINGS)
    axes.spines["polar"].set_color("#bbbbbb")


def _ring_labels(axes: Any, metric: str, end: float, angle: float) -> None:
    for n in range(1, _RINGS + 1):
        value = end * (1.0 - n / _RINGS if metric in _INWARDS else n / _RINGS)
        axes.text(
            angle, n / _RINGS, f"{value:g}", size=6.5, color="#555555", ha="center", va="center", zorder=4,
            bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.75},
        )  # fmt: skip
