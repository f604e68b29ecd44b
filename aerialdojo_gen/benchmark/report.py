"""The report of an evaluation: one HTML file with tables, figures and a few episodes, that loads nothing."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from importlib import resources
from itertools import accumulate
from pathlib import Path
from typing import Any

import jinja2
import markupsafe

from aerialdojo_gen.base.table_formats import as_latex, as_markdown
from aerialdojo_gen.base.terminal import shown_in_page
from aerialdojo_gen.base.text_table import TextTable
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.benchmark.figures import encode_figure, family_radars, metric_radars, radius_curve
from aerialdojo_gen.benchmark.registry import in_setting, named_tables
from aerialdojo_gen.benchmark.replay import Replay
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import ReportRequest, as_csv, as_json
from aerialdojo_gen.store.atomic import atomic_write

# Long tables, folded away on the page.
_FOLDED = ("type", "scene")
_PAPER_AXES = "the axes of the paper's Fig. 5; what is beyond one is drawn at its end"


def write_report(out: Path, request: ReportRequest, replays: Sequence[Replay]) -> list[Path]:
    """Write everything that there is to say of some runs."""
    named = named_tables(request, ["all"])
    tables = [table for made in named.values() for table in made]
    drawn_runs, _ = _of_the_radar(request.runs)
    paper_axes = request.sample is not None
    drawn = {
        "families": metric_radars(drawn_runs, request.profiles[0], paper_axes),
        "radar": family_radars(drawn_runs, request.profiles[0], paper_axes),
        "radius": radius_curve(request.runs, request.profiles[0]),
    }
    figures = {(name, kind): encode_figure(f, kind) for name, f in drawn.items() for kind in ("png", "svg")}
    files = {
        "report.html": html(request, replays, {name: figures[name, "svg"] for name in drawn}, named).encode(),
        "metrics.csv": as_csv(request).encode(),
        "metrics.json": as_json(request).encode(),
        "tables.md": ("\n\n".join(map(as_markdown, tables)) + "\n").encode(),
        "tables.tex": ("\n\n".join(map(as_latex, tables)) + "\n").encode(),
        **{f"{name}.{kind}": data for (name, kind), data in figures.items()},
    }
    for name, data in files.items():
        atomic_write(out, name, data)
    return [out / name for name in files]


def _of_the_radar(runs: Sequence[Run]) -> tuple[Sequence[Run], str]:
    """Return what the radars show: the Base tasks, as the paper's do, where every run has flown some."""
    base = in_setting(runs, "base")
    return (base, "Base tasks") if len(base) == len(runs) else (runs, "all tasks")


def html(
    request: ReportRequest, replays: Sequence[Replay], figures: dict[str, bytes], tables: dict[str, list[TextTable]]
) -> str:
    """Write the page."""
    environment = page_environment()
    environment.filters["json_in_html"] = _json_in_html
    environment.globals |= {
        "points": _points, "cross": _cross, "arrow": _arrow, "starts": _starts, "heights": _heights, "span": _span_m
    }  # fmt: skip
    first = request.profiles[0]
    _, tasks = _of_the_radar(request.runs)
    axes = "axes end where the data does" if request.sample is None else _PAPER_AXES
    captions = {
        "families": f"{tasks} at {first.radius_m:g} m, a chart a metric: {axes}",
        "radar": f"{tasks} at {first.radius_m:g} m, a chart a family; outwards is better",
        "radius": "SR (solid) and OSR (dashed) against the radius that counts as success",
    }
    return environment.get_template("report.html.j2").render(
        version=__version__,
        runs=request.runs,
        profiles=request.profiles,
        tables=[table for name, made in tables.items() if name not in _FOLDED for table in made],
        folded=[table for name in _FOLDED for table in tables.get(name, [])],
        # Images and not inline: the page's policy has no room for the styles that matplotlib writes.
        figures=[
            {"url": f"data:image/svg+xml;base64,{base64.b64encode(figures[name]).decode()}", "caption": caption}
            for name, caption in captions.items()
        ],
        replays=replays,
        missing_note=request.breakdowns.missing_note,
        **page_parts(["report.css"], "report.js"),
    )


def page_environment() -> jinja2.Environment:
    """Return what renders the benchmark's pages: everything is escaped, and no name may be missing."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader("aerialdojo_gen.benchmark"), autoescape=True, finalize=shown_in_page,
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip


def page_parts(styles: Sequence[str], script: str) -> dict[str, str]:
    """Read a page's style and script, with their hashes for its content security policy."""
    folder = resources.files("aerialdojo_gen.benchmark").joinpath("templates")
    style = "".join(folder.joinpath(name).read_text("utf-8") for name in styles)
    code = folder.joinpath(script).read_text("utf-8")
    hashes = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (style, code)]
    return {"style": style, "script": code, "style_hash": hashes[0], "script_hash": hashes[1]}


def _json_in_html(text: str) -> markupsafe.Markup:
    """Mark JSON as safe within a script element, where ``</script>`` and ``<!--`` would end or bend it."""
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return markupsafe.Markup(text)  # noqa: S704  (no sign that HTML knows is left in it)


def _points(x_m: Sequence[float], y_m: Sequence[float]) -> str:
    # SVG's y points down.
    return " ".join(f"{x:.2f},{-y:.2f}" for x, y in zip(x_m, y_m, strict=True))


def _cross(x: float, y: float, r: float) -> str:
    return f"M {x - r} {y} h {2 * r} M {x} {y - r} v {2 * r}"


def _arrow(r: float) -> str:
    return f"M {r} 0 L {-0.7 * r} {0.6 * r} L {-0.35 * r} 0 L {-0.7 * r} {-0.6 * r} Z"


def _starts(table: TextTable) -> set[int]:
    """Return the columns that begin a group."""
    return {0, *accumulate(len(names) for _, names in table.groups)}


def _span_m(replay: Replay) -> tuple[float, float]:
    """Return the heights that the chart ends at; a gorge lies below 0."""
    z_m = [*replay.reference["z_m"], *(z for f in replay.flights for z in f.z_m)]
    margin = max(1.0, 0.08 * (max(z_m) - min(z_m)))
    return min(z_m) - margin, max(z_m) + margin


def _heights(replay: Replay) -> list[dict[str, str]]:
    """Return the lines of the chart of heights, 400 by 90: the reference, then the flights."""
    low, high = _span_m(replay)
    most = max(1, max(len(f.said) for f in replay.flights) - 1)

    def line(css: str, z_m: Sequence[float]) -> dict[str, str]:
        points = (f"{400 * k / most:.1f},{90 * (high - z) / (high - low):.1f}" for k, z in enumerate(z_m))
        return {"css": css, "points": " ".join(points)}

    # The reference's poses are its actions', so that it shares the axis; where it is longer, the axis ends first.
    reference: Any = replay.reference["z_m"][: most + 1]
    return [line("reference", reference), *(line(f"c{k % 8}", f.z_m) for k, f in enumerate(replay.flights))]
