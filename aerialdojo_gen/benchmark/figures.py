"""Figures of an evaluation, PNG and SVG, for print: success against the radius, and what all of them share."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.scores import success_curve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which colour-blind readers tell apart too; line styles carry what is left.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans", "font.size": 9, "axes.linewidth": 0.8, "axes.edgecolor": "#444444",
    "grid.color": "#dddddd", "grid.linewidth": 0.6, "svg.hashsalt": "aerialdojo", "svg.fonttype": "path",
}  # fmt: skip


def radius_curve(runs: Sequence[Run], profile: Profile, largest_m: float = 25.0) -> Figure:
    """Draw overall SR (solid) and OSR (dashed) against the success radius, from 0 to `largest_m` metres."""
    radii = np.linspace(0.0, largest_m, 501)

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
        axes.set(xlabel="radius, m", ylabel="episodes, %", xlim=(0.0, largest_m), ylim=(-2.0, 102.0))
        axes.grid(True)
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside right upper", frameon=False)

    return figure_of(draw, (6.0, 3.4))


def figure_of(draw: Callable[[Figure], None], size_inches: tuple[float, float]) -> Figure:
    """Draw a figure in the common style; nothing of it stays behind."""
    # Not pyplot: that keeps figures for a screen that nobody looks at.
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        figure = Figure(size_inches, layout="constrained")
        draw(figure)
    return figure


def encoded(figure: Figure, kind: str) -> bytes:
    """Encode a figure; the same figure gives the same bytes."""
    import matplotlib

    out = io.BytesIO()
    # Without these the file says when, and by which version, it was made.
    metadata: dict[str, Any] = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
    with matplotlib.rc_context(_STYLE):
        figure.savefig(out, format=kind, dpi=200, metadata=metadata)
    return out.getvalue()
