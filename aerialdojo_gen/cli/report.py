"""Commands that report an evaluation's results, score submissions, and show scored runs side by side."""

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
from aerialdojo_gen.cli.common import interruptible, selection
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.store.root import open_root

app = typer.Typer()

_SCORED = Path("scored")
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


@app.command("report", cls=_Command)
def report(
    runs: Annotated[list[str] | None, typer.Argument(help="Runs of evaluate.  (default: all)")] = None,
    data: options.Data = "data",
    log: Annotated[
        str | None,
        typer.Option(metavar="DIR|URL", help="Where evaluate wrote its log (--out).  (default: the data directory)"),
    ] = None,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            help="Success rule, repeatable: aerialdojo, aerialdojo-5m, uav-on, aerialvln, openfly.  "
            "(default: the first two)"
        ),
    ] = None,
    table: Annotated[
        list[str] | None,
        typer.Option(
            help="Print these tables, repeatable: overall, results, partition, family, averages, setting, goal, "
            "modality, radius, visits, difficulty, seen, conduct, type, scene, all."
        ),
    ] = None,
    radius: Annotated[
        list[float] | None,
        typer.Option(
            min=0.0, help="Success radii in metres for the radius table: --radius 1 3 5 10.  (default: 3 5)"
        ),
    ] = None,
    protocol: options.Protocol = None,
    paper_results: Annotated[
        Literal["paper"] | None,
        typer.Option("--beside", help="paper: add the paper's own results, from its simulator."),
    ] = None,
    paired: Annotated[
        bool, typer.Option("--paired", help="Compare two runs on the tasks that both have done.")
    ] = False,
    group: Annotated[
        list[str] | None,
        typer.Option(help="Group runs under a heading, repeatable: --group open=qwen,phi --group closed=gpt."),
    ] = None,
    intervals: Annotated[
        bool, typer.Option("--intervals/--no-intervals", help="Print 95 % confidence intervals.")
    ] = True,
    add_baselines: Annotated[
        bool,
        typer.Option("--baselines/--no-baselines", help="Add stop, constant, random if they did the same tasks."),
    ] = True,
    style: Annotated[
        Literal["terminal", "markdown", "latex", "csv", "json"], typer.Option("--format", help="Output format.")
    ] = "terminal",
    as_json: options.Json = False,
    by_scene: Annotated[bool, typer.Option("--by-scene", help="Print the table by scene too.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for report.html, tables, figures and metrics.csv.")] = None,
    replays: Annotated[int, typer.Option(min=0, max=50, help="Number of tasks that report.html replays.")] = 4,
    frames: Annotated[bool, typer.Option("--frames", help="Render front views for the replays.")] = False,
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


@app.command("score")
def score(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Submission, as evaluate --submission writes it.")],
    data: options.Data = "data",
    into: Annotated[Path, typer.Option(metavar="DIR", help="Folder of scored runs.")] = _SCORED,
    name: Annotated[
        str | None, typer.Option(help="Name of the scored run.  (default: that of the submission)")
    ] = None,
    split: Annotated[
        list[str] | None,
        typer.Option(help="Splits that must have been flown, as for evaluate; repeatable.  (default: test)"),
    ] = None,
    setting: options.Setting = None,
    modality: options.Modality = None,
    protocol: options.Protocol = None,
    scene: options.Scene = None,
    limit: options.TaskLimit = None,
    seed: options.SelectionSeed = 0,
    adapted: Annotated[
        bool,
        typer.Option("--adapted", help="The agent was trained on tasks of OOD scenes: list its OOD scores apart."),
    ] = False,
    replace: Annotated[bool, typer.Option("--replace", help="Overwrite a scored run of this name.")] = False,
    workers: options.Workers = None,
    pipeline: options.PipelineFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Replay a submission against the release, and add its scores to a folder; refuse it where it does not replay."""
    from aerialdojo_gen.benchmark import scoring
    from aerialdojo_gen.benchmark.metrics import MEASURES
    from aerialdojo_gen.benchmark.tables import text
    from aerialdojo_gen.pipeline.progress import Reporter

    config, _ = open_pipeline(pipeline, data, reads=True)
    chosen = selection(scene, split or ["test"], setting, modality, protocol, limit, seed)
    reporter = Reporter(quiet=quiet)
    with interruptible(f"{into} is as it was"):
        card = scoring.score(
            data, file, into, selection=chosen, embodiment=config.embodiment, name=name, adapted=adapted,
            replace=replace, workers=workers, reporter=reporter,
        )  # fmt: skip
    whole = card.rows[0]
    known = ((MEASURES[m].head[:-2], text(m, value)) for m, value in whole.mean.items() if value is not None)
    scores = ", ".join(f"{head} {value}" for head, value in known)
    reporter.line(f"score {card.name}: {whole.episodes:,} episodes replay; {scores}; added to {into}")


@app.command("leaderboard")
def leaderboard(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of scored runs (score --into).")] = _SCORED,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The page.  (default: leaderboard.html in FOLDER)")
    ] = None,
) -> None:
    """Write the scored runs of a folder as one page: sortable, with intervals, the paper's results beside them."""
    from aerialdojo_gen.benchmark.leaderboard import write_leaderboard

    page = out or folder / "leaderboard.html"
    count = write_leaderboard(folder, page)
    typer.echo(f"{page}: {count} scored run{'s' * (count != 1)}", err=True)
