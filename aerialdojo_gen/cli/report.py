"""The command that reports an evaluation's results."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperCommand

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.text_table import terminal_width, wrapped
from aerialdojo_gen.cli import options
from aerialdojo_gen.store.root import open_root

app = typer.Typer()

_NUMBER = re.compile(r"\d+(\.\d+)?")


class _Command(TyperCommand):
    """Takes several numbers after one ``--radius``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat the option before every number that follows it."""
        spread: list[str] = []
        after = False
        for arg in args:
            number = _NUMBER.fullmatch(arg) is not None
            if after and number and spread[-1] != "--radius":
                spread.append("--radius")
            spread.append(arg)
            after = arg == "--radius" or (after and number)
        return super().parse_args(ctx, spread)


Runs = Annotated[list[str] | None, typer.Argument(help="Runs of evaluate.  (default: all)")]
Log = Annotated[
    str | None,
    typer.Option(
        "--log", metavar="DIR|URL", help="Where evaluate wrote its log (--out).  (default: the data directory)"
    ),
]
Profile = Annotated[
    list[str] | None,
    typer.Option(
        "--profile",
        help="Success rule, repeatable: aerialdojo, aerialdojo-5m, uav-on, aerialvln, openfly.  "
        "(default: the first two)",
    ),
]
Tables = Annotated[
    list[str] | None,
    typer.Option(
        "--table",
        help="Print these tables, repeatable: overall, results, partition, family, averages, setting, goal, "
        "modality, radius, visits, difficulty, seen, conduct, type, scene, all.",
    ),
]
Radius = Annotated[
    list[float] | None,
    typer.Option(
        "--radius",
        min=0.0,
        help="Success radii in metres for the radius table: --radius 1 3 5 10.  (default: 3 5)",
    ),
]
PaperResults = Annotated[
    Literal["paper"] | None,
    typer.Option("--beside", help="paper: add the paper's own results, from its simulator."),
]
Paired = Annotated[bool, typer.Option("--paired", help="Compare two runs on the tasks that both have done.")]
Group = Annotated[
    list[str] | None,
    typer.Option("--group", help="Group runs under a heading, repeatable: --group open=qwen,phi --group closed=gpt."),
]
Intervals = Annotated[bool, typer.Option("--intervals/--no-intervals", help="Print 95 % confidence intervals.")]
AddBaselines = Annotated[
    bool,
    typer.Option("--baselines/--no-baselines", help="Add stop, constant, random if they did the same tasks."),
]
Style = Annotated[
    Literal["terminal", "markdown", "latex", "csv", "json"], typer.Option("--format", help="Output format.")
]
ByScene = Annotated[bool, typer.Option("--by-scene", help="Print the table by scene too.")]
ReportFolder = Annotated[
    Path | None, typer.Option("--out", help="Folder for report.html, tables, figures and metrics.csv.")
]
Replays = Annotated[int, typer.Option("--replays", min=0, max=50, help="Number of tasks that report.html replays.")]
Frames = Annotated[bool, typer.Option("--frames", help="Render front views for the replays.")]


@app.command("report", cls=_Command)
def report(
    runs: Runs = None,
    data: options.Data = "data",
    log: Log = None,
    profile: Profile = None,
    table: Tables = None,
    radius: Radius = None,
    protocol: options.Protocol = None,
    paper_results: PaperResults = None,
    paired: Paired = False,
    group: Group = None,
    intervals: Intervals = True,
    add_baselines: AddBaselines = True,
    style: Style = "terminal",
    as_json: options.Json = False,
    by_scene: ByScene = False,
    out: ReportFolder = None,
    replays: Replays = 4,
    frames: Frames = False,
) -> None:
    """Score runs of evaluate: SR, SR-view, OSR, SPL, DTS and CR as tables, figures or a page."""
    from aerialdojo_gen.base.paper_figures import results
    from aerialdojo_gen.benchmark import registry, tables
    from aerialdojo_gen.benchmark.episodes import runs as runs_there
    from aerialdojo_gen.benchmark.metrics import DEFAULT_PROFILES, at_radius, profile_named
    from aerialdojo_gen.benchmark.paired import paired_tables
    from aerialdojo_gen.benchmark.runs import group_runs, load_runs, with_baselines
    from aerialdojo_gen.benchmark.tables import DEFAULT_RADII_M, ReportRequest
    from aerialdojo_gen.dataset.contents import scenes_in_release
    from aerialdojo_gen.dataset.protocol import read_sample

    if as_json:
        style = "json"
    groups = _groups(group or [])
    requested = [*(table or registry.DEFAULT), *(["scene"] if by_scene else [])]
    names = registry.check_names(requested + (["radius"] if radius and not table else []))
    rules = [profile_named(name) for name in dict.fromkeys(profile or DEFAULT_PROFILES)]
    root, written = open_root(data), open_root(log or data)
    if log is None and not runs_there(root):
        scenes_in_release(root)  # a folder without either is the wrong one
    sample = read_sample(root) if protocol else None
    named = load_runs(written, runs or (), sample)
    loaded = group_runs(with_baselines(written, named) if add_baselines else named, groups)
    request = ReportRequest(
        root, loaded, rules, tuple(radius or DEFAULT_RADII_M), intervals, results() if paper_results else (), sample
    )
    if style in ("csv", "json"):
        extra_rules = [at_radius(rules[0], r) for r in radius or () if r not in {rule.radius_m for rule in rules}]
        write = tables.as_csv if style == "csv" else tables.as_json
        print(write(replace(request, profiles=[*rules, *extra_rules])), end="")
    elif paired and table is None:
        _show(paired_tables(named, rules), style)
    else:
        chosen = registry.report_tables(request, names)
        _show([*chosen, *(paired_tables(named, rules) if paired else [])], style)
        if lacking := registry.missing_note(request, names):
            typer.echo(lacking, err=True)
        if table is None and style == "terminal":
            others = ", ".join(name for name in (*registry.NAMES, "all") if name not in names)
            print("\n".join(["", *wrapped(f"More with --table: {others}.", terminal_width())]))
    if out is not None:
        from aerialdojo_gen.benchmark import replay
        from aerialdojo_gen.benchmark.report import write_report

        shown = list(replay.replays(root, written, loaded, replay.choose_tasks(loaded, replays), frames))
        made = write_report(out, request, shown)
        typer.echo(f"{made[0]} and {len(made) - 1} more files", err=True)


def _show(tables: Any, style: str) -> None:
    from aerialdojo_gen.base import table_formats

    if style == "terminal":
        width = terminal_width()
        parts = [*(table_formats.as_text(table, width) for table in tables), table_formats.legend(tables)]
        print("\n\n".join(filter(None, parts)))
    else:
        print("\n\n".join(table_formats.FORMATS[style](table) for table in tables))


def _groups(given: list[str]) -> dict[str, list[str]]:
    groups: dict[str, list[str]] = {}
    for item in given:
        heading, equals, names = item.partition("=")
        if not equals or not heading.strip() or not names.strip():
            raise UsageError(f"--group {item!r}: write heading=run,run")
        groups.setdefault(heading.strip(), []).extend(name.strip() for name in names.split(","))
    return groups
