"""Commands that score submissions and show them side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import interruptible, open_pipeline, selection

app = typer.Typer()

_FOLDER = Path("scored")


@app.command("score")
def score(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Submission, as evaluate --submission writes it.")],
    data: options.Data = "data",
    into: Annotated[Path, typer.Option("--into", metavar="DIR", help="Folder of scored runs.")] = _FOLDER,
    name: Annotated[
        str | None, typer.Option("--name", help="Name of the scored run.  (default: that of the submission)")
    ] = None,
    split: Annotated[
        list[str] | None,
        typer.Option(
            "--split", help="Splits that must have been flown, as for evaluate; repeatable.  (default: test)"
        ),
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
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of scored runs (score --into).")] = _FOLDER,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="The page.  (default: leaderboard.html in FOLDER)")
    ] = None,
) -> None:
    """Write the scored runs of a folder as one page: sortable, with intervals, the paper's results beside them."""
    from aerialdojo_gen.benchmark.leaderboard import write_leaderboard

    page = out or folder / "leaderboard.html"
    count = write_leaderboard(folder, page)
    typer.echo(f"{page}: {count} scored run{'s' * (count != 1)}", err=True)
