"""Figures of an evaluation, PNG and SVG: success against the radius, and the radar charts of the paper's Fig. 5.

A radar's axes end where the data does: for agents that solve 1 % of the tasks an axis to 100 % would show a dot. Or
they are the paper's, which are fixed; a value beyond an axis is drawn at its end.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from aerialdojo_gen.benchmark.metrics import MEASURES, PAPER_METRICS, Profile, success_curve, summarize
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


@contextmanager
def _styled(size_inches: tuple[float, float]) -> Iterator[Figure]:
    """Make a figure in the common style, to be drawn in the block; nothing of it stays behind."""
    # Not pyplot: that keeps figures for a screen that nobody looks at.
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        yield Figure(size_inches, layout="constrained")


def radius_curve(runs: Sequence[Run], profile: Profile) -> Figure:
    """Draw overall SR (solid) and OSR (dashed) against the success radius, from 0 to 25 m."""
    radii = np.linspace(0.0, 25.0, 501)
    with _styled((6.0, 3.4)) as figure:
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


_UNITS = {metric: "m" if MEASURES[metric].metres else "%" for metric in PAPER_METRICS}
_INWARDS = [metric for metric in PAPER_METRICS if MEASURES[metric].direction < 0]
_RINGS = 4
# An axis ends at one of these times a power of ten: all are divided into four without odd digits.
_ENDS = (1.0, 2.0, 4.0, 6.0, 8.0, 10.0)
_FAMILIES = tuple(FAMILIES.values())
_Curve = tuple[int, str, Any]  # Number of the run, its label, and shares of the way from the centre outwards
# Where the axes of the paper's Fig. 5 end: per cent and metres.
PAPER_ENDS = {"sr": 5.0, "osr": 15.0, "spl": 5.0, "dts_m": 40.0, "cr": 100.0}


def axis_end(largest: float, most: float = math.inf) -> float:
    """Return where an axis ends: a round number that is not below a value, and not above the most there can be."""
    if not largest > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(largest))
    return min(most, next(power * end for end in _ENDS if power * end >= largest * (1.0 - 1e-9)))


def metric_radars(runs: Sequence[Run], profile: Profile, paper_axes: bool = False) -> Figure:
    """Draw a chart a metric, an axis a family; `paper_axes` takes the paper's axes."""
    curves, ends, note = _curves(runs, profile, paper_axes)
    with _styled((7.6, 5.4)) as figure:
        panels: Any = figure.subplots(2, 3, subplot_kw={"projection": "polar"}).ravel()
        for m, (axes, metric, end) in enumerate(zip(panels, PAPER_METRICS, ends, strict=False)):
            _chart(axes, [(k, label, shares[:, m]) for k, label, shares in curves], _FAMILIES)
            axes.set_title(f"{MEASURES[metric].head}, {_UNITS[metric]}", pad=34, size=10, weight="bold")
            centre = f"{end if metric in _INWARDS else 0:g} at the centre"
            axes.text(0.5, 1.18, centre, transform=axes.transAxes, ha="center", size=7, color="#777777")
            _ring_labels(axes, metric, end, math.pi / len(_FAMILIES))
        panels[-1].set_axis_off()
        panels[-1].legend(
            *panels[0].get_legend_handles_labels(), loc="center", frameon=False, title=note, title_fontsize=8
        )
    return figure


def family_radars(runs: Sequence[Run], profile: Profile, paper_axes: bool = False) -> Figure:
    """Draw a chart a family, an axis a metric; an axis ends at the same value in all of them, or at the paper's."""
    curves, ends, note = _curves(runs, profile, paper_axes)
    tips, middle = [], []
    for metric, end in zip(PAPER_METRICS, ends, strict=True):
        label, (inner, outer) = MEASURES[metric].head[:-2], sorted((0.0, end), reverse=metric in _INWARDS)
        tips.append(f"{label}\n{outer:g} {_UNITS[metric]}")
        middle.append(f"{label} {inner:g} {_UNITS[metric]}")
    with _styled((6.8, 7.0)) as figure:
        panels: Any = figure.subplots(2, 2, subplot_kw={"projection": "polar"}).ravel()
        for f, (axes, family) in enumerate(zip(panels, _FAMILIES, strict=True)):
            _chart(axes, [(k, label, shares[f]) for k, label, shares in curves], tips)
            axes.set_title(family, pad=36, size=10, weight="bold")
        figure.legend(
            *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False, title=note,
            title_fontsize=8,
        )  # fmt: skip
        figure.suptitle(f"At the centre: {', '.join(middle)}", size=8, color="#555555")
    return figure


def _curves(runs: Sequence[Run], profile: Profile, paper_axes: bool) -> tuple[list[_Curve], list[float], str | None]:
    """Score the families of every run, (4, 5), as shares of the way outwards; where axes end; who is left out."""
    # Without the oracle, which would fix every scale.
    drawn = [(k, run) for k, run in enumerate(runs) if GROUP_OF.get(run.agent) != UPPER_BOUND] or [*enumerate(runs)]
    in_metres = np.array([MEASURES[metric].metres for metric in PAPER_METRICS])
    found = []
    for _, run in drawn:
        families = summarize(run.episodes, profile).families
        rows = [
            [math.nan if family not in families else getattr(families[family], m) for m in PAPER_METRICS]
            for family in _FAMILIES
        ]
        found.append(np.array(rows) * np.where(in_metres, 1.0, 100.0))
    if paper_axes:
        ends = [PAPER_ENDS[metric] for metric in PAPER_METRICS]
    else:
        largest, most = np.nanmax(np.stack(found), axis=(0, 1)), np.where(in_metres, math.inf, 100.0)
        ends = [*map(axis_end, largest.tolist(), most.tolist())]
    inwards = [metric in _INWARDS for metric in PAPER_METRICS]
    shares = [np.clip(np.where(inwards, 1.0 - own / ends, own / ends), 0.0, 1.0) for own in found]
    curves = [(k, run.label, own) for (k, run), own in zip(drawn, shares, strict=True)]
    return curves, ends, "without the oracle" if len(drawn) < len(runs) else None


def _chart(axes: Any, curves: Sequence[_Curve], tips: Sequence[str]) -> None:
    """Draw one radar, an axis a tip."""
    angles = np.linspace(0.0, 2.0 * math.pi, len(tips), endpoint=False)
    for k, label, share in curves:
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
