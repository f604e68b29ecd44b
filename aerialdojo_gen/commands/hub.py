"""Commands that share a release over the Hugging Face Hub."""

from __future__ import annotations

from typing import Annotated

import typer

from aerialdojo_gen.commands.common import Data, Quiet
from aerialdojo_gen.common import advice
from aerialdojo_gen.errors import brief

app = typer.Typer()

Repo = Annotated[str, typer.Argument(metavar="USER/NAME", help="Data set on the Hub, or at HF_ENDPOINT.")]


@app.command("push-to-hub")
def push_to_hub(
    repo: Repo,
    data: Data = "data",
    private: Annotated[bool, typer.Option("--private", help="Make a new data set a private one.")] = False,
    revision: Annotated[
        str | None, typer.Option("--revision", help="Branch to write to.  (default: the main one)")
    ] = None,
    meshes: Annotated[
        bool, typer.Option("--meshes", help="Send the meshes too: who flies in the scenes wants them.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Send the release to the Hugging Face Hub, its card as README; HF_TOKEN has the token."""
    from aerialdojo_gen.exchange import hub
    from aerialdojo_gen.pipeline.progress import Reporter

    print(
        hub.push_to_hub(repo, data, private=private, revision=revision, meshes=meshes, reporter=Reporter(quiet=quiet))
    )


@app.command("pull")
def pull(
    repo: Repo,
    data: Data = "data",
    revision: Annotated[
        str | None, typer.Option("--revision", help="Branch, tag or commit.  (default: the main branch)")
    ] = None,
    meshes: Annotated[
        bool, typer.Option("--meshes/--no-meshes", help="Fetch the meshes too, where the data set has them.")
    ] = True,
    replace: Annotated[
        bool, typer.Option("--replace", help="Put it in the place of a release and of meshes, which are lost.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Fetch a release from the Hugging Face Hub and check it; the same command goes on after a failure."""
    from aerialdojo_gen.exchange import hub
    from aerialdojo_gen.pipeline.progress import Reporter

    moved = hub.pull_release(
        repo, data, revision=revision, meshes=meshes, replace=replace, reporter=Reporter(quiet=quiet)
    )
    print(moved)
    if moved.left:
        names = [brief(name, 100) for name in moved.left[:5]]
        print(f"left there: {', '.join(names)}{' …' if len(moved.left) > 5 else ''}")
    print(f"next: {advice.command('validate', no_meshes=not moved.meshes)}")
