"""Commands that share a release over the Hugging Face Hub."""

from __future__ import annotations

from typing import Annotated

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.errors import brief
from aerialdojo_gen.cli.common import Data, Quiet

app = typer.Typer()

Repo = Annotated[str, typer.Argument(metavar="USER/NAME", help="Dataset on the Hub, or at HF_ENDPOINT.")]


@app.command("push-to-hub")
def push_to_hub(
    repo: Repo,
    data: Data = "data",
    private: Annotated[bool, typer.Option("--private", help="If the dataset is new, make it private.")] = False,
    revision: Annotated[str | None, typer.Option("--revision", help="Branch to write to.  (default: main)")] = None,
    meshes: Annotated[bool, typer.Option("--meshes", help="Upload scene meshes too; evaluate needs them.")] = False,
    quiet: Quiet = False,
) -> None:
    """Upload the release to the Hugging Face Hub, with its card as README; the token is HF_TOKEN."""
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
        str | None, typer.Option("--revision", help="Branch, tag or commit.  (default: main)")
    ] = None,
    meshes: Annotated[
        bool, typer.Option("--meshes/--no-meshes", help="Download the meshes too, if the dataset has them.")
    ] = True,
    replace: Annotated[
        bool, typer.Option("--replace", help="Overwrite the release and meshes in --data; they are deleted.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Download a release from the Hugging Face Hub and check it; after a failure the same command continues."""
    from aerialdojo_gen.exchange import hub
    from aerialdojo_gen.pipeline.progress import Reporter

    moved = hub.pull_release(
        repo, data, revision=revision, meshes=meshes, replace=replace, reporter=Reporter(quiet=quiet)
    )
    print(moved)
    if moved.left:
        names = [brief(name, 100) for name in moved.left[:5]]
        print(f"left there: {', '.join(names)}{' …' if len(moved.left) > 5 else ''}")
    print(f"next: {cli_context.command('validate', no_meshes=not moved.meshes)}")
