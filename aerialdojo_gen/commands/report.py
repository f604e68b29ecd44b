"""The command that tells what an evaluation gave."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from aerialdojo_gen.commands.common import Data

app = typer.Typer()


@app.command("report")
def report(
    runs: Annotated[list[str] | None, typer.Argument(help="Runs of evaluate.  (default: all)")] = None,
    data: Data = Path("data"),
    log: Annotated[
        Path | None, typer.Option("--log", help="Where evaluate wrote to, if not to the data directory.")
    ] = None,
    profile: Annotated[
        list[str] | None,
        typer.Option("--profile", help="Rule of success, repeatable: aerialdojo, aerialdojo-5m, uav-on, aerialvln, "
                                       "openfly.  (default: the first two)"),
    ] = None,
    style: Annotated[
        Literal["terminal", "markdown", "latex", "csv"], typer.Option("--format", help="What is printed.")
    ] = "terminal",
    by_scene: Annotated[bool, typer.Option("--by-scene", help="Print the table of scenes too.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for report.html, tables, figures and metrics.csv.")
    ] = None,
    replays: Annotated[int, typer.Option("--replays", min=0, max=50, help="Tasks that report.html replays.")] = 4,
    frames: Annotated[bool, typer.Option("--frames", help="Render front pictures along the replays.")] = False,
) -> None:  # fmt: skip
    """Score runs of evaluate: SR, OSR, SPL, DTS, CR as tables, figures, a page."""
    from aerialdojo_gen.benchmark import formats, tables
    from aerialdojo_gen.benchmark.profiles import DEFAULT_PROFILES, profile_named
    from aerialdojo_gen.benchmark.runs import load_runs

    rules = [profile_named(name) for name in dict.fromkeys(profile or DEFAULT_PROFILES)]
    loaded = load_runs(log or data, runs or ())
    if style == "csv":
        print(tables.as_csv(loaded, rules), end="")
    else:
        chosen = tables.tables_of(loaded, rules) + ([tables.scene_table(loaded, rules[0])] if by_scene else [])
        print("\n\n".join(formats.FORMATS[style](table) for table in chosen))
    if out is not None:
        from aerialdojo_gen.benchmark import replay
        from aerialdojo_gen.benchmark.report import write_report

        shown = list(replay.replays(data, log or data, loaded, replay.choose_tasks(loaded, replays), frames))
        written = write_report(out, loaded, rules, shown)
        typer.echo(f"{written[0]} and {len(written) - 1} more files", err=True)
