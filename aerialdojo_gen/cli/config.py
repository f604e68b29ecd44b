"""``config``: what a pipeline file may say, and one to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.text_table import terminal_width
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import pipeline_file, print_json

app = typer.Typer(help="Show the keys of a pipeline file, or write one to start from.")


@app.command("show")
def show(
    stage: Annotated[
        str | None, typer.Argument(metavar="STAGE", help="Show the section of one stage, e.g. plan.  (default: all)")
    ] = None,
    pipeline: options.PipelineFile = None,
    as_json: options.Json = False,
) -> None:
    """Show every key of a pipeline: value, default, unit, bounds, meaning."""
    from aerialdojo_gen.base.config.keys import config_keys
    from aerialdojo_gen.pipeline.template import key_lines

    keys = config_keys(pipeline_file(pipeline), stage)
    if as_json:
        print_json([key.as_json() for key in keys])
        return
    print("\n".join(key_lines(keys, terminal_width())))


@app.command("init")
def init(
    path: Annotated[Path, typer.Argument(metavar="NAME.toml", help="File to write.")],
    pipeline: Annotated[
        Path | None,
        typer.Option(
            "--from", metavar="PIPELINE", help="Start from this pipeline's values.  (default: the defaults)"
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Write a commented pipeline file with every key, unit and default."""
    from aerialdojo_gen.pipeline.template import init_config

    print(init_config(path, pipeline and pipeline_file(pipeline), force=force))
    print(f"next: {cli_context.command('run', path, data=f'data-{path.stem}')}")
