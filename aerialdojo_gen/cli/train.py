"""Train a policy on a release."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.cli.common import Data, Quiet, RendererName, Workers

app = typer.Typer()


@app.command("train")
def train(
    recipe: Annotated[
        Path, typer.Argument(metavar="RECIPE", help="Recipe file, or the name of a shipped one: imitation, blind, …")
    ],
    data: Data = "data",
    small: Annotated[
        bool,
        typer.Option("--small", help="Use the recipe's section [small], with few scenes and epochs, as a first try."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for weights and checkpoints.  (default: policies/NAME in --data)"
        ),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(
            "--cache", metavar="DIR", help="Cache for rendered images.  (default: policies/cache in --data)"
        ),
    ] = None,
    device: Annotated[str, typer.Option("--device", help="auto, cpu or cuda.")] = "auto",
    renderer: RendererName = "auto",
    restart: Annotated[bool, typer.Option("--restart", help="Delete an earlier training of this name.")] = False,
    workers: Workers = None,
    quiet: Quiet = False,
) -> None:
    """Train a policy by imitation and DAgger; after an interruption the same command continues."""
    from aerialdojo_gen.learning.recipe import load_recipe
    from aerialdojo_gen.learning.training import train as learn
    from aerialdojo_gen.pipeline.progress import Reporter

    chosen = load_recipe(recipe)
    try:
        learn(
            data, chosen.made_small() if small else chosen, out=out, cache=cache, device=device, workers=workers,
            renderer=renderer, restart=restart, reporter=Reporter(quiet=quiet),
        )  # fmt: skip
    except KeyboardInterrupt:
        print("interrupted: the same command continues from the last checkpoint", file=sys.stderr)
        raise SystemExit(130) from None
