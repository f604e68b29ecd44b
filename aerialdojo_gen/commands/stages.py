"""One command a stage, and ``run``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.commands.common import (
    Address,
    Data,
    ExecutorName,
    Force,
    PipelineFile,
    Quiet,
    Replace,
    Scene,
    Workers,
    open_pipeline,
    run_stages,
    run_until,
)

app = typer.Typer()

# The stages whose command has no option of its own; their texts are those of `aerialdojo_gen.pipeline.registry`,
# which is not imported here because it brings pyarrow.
PLAIN_STAGES = {
    "build-scenes": "Build the scenes' meshes from their recipes.",
    "annotate-import": "Check the annotations against the scenes and import them.",
    "anchor-sample": "Find viewpoints 1 m from each object that see it.",
    "reference-images": "Render each object's picture from its selected anchor.",
    "pair-objects": "Pair start anchors with targets: the candidate tasks.",
    "plan": "Plan a collision-free reference trajectory for every candidate.",
    "filter": "Keep the candidates that make tasks, with a reason for every rejection.",
}
SPLIT = "Write the release: tasks, routes, objects, train and test."


def _stage_command(name: str) -> Callable[..., None]:
    def command(
        data: Data = Path("data"), scene: Scene = None, pipeline: PipelineFile = None,
        workers: Workers = None, force: Force = False, quiet: Quiet = False, executor: ExecutorName = "local",
        address: Address = None,
    ) -> None:  # fmt: skip
        run_until(
            name, data=data, scene=scene, pipeline=pipeline, workers=workers, force=force, quiet=quiet,
            executor=executor, address=address,
        )  # fmt: skip

    return command


for _name, _help in PLAIN_STAGES.items():
    app.command(_name, help=_help)(_stage_command(_name))


@app.command("split", help=SPLIT)
def split(
    data: Data = Path("data"), scene: Scene = None, pipeline: PipelineFile = None,
    workers: Workers = None, force: Force = False, quiet: Quiet = False, replace: Replace = False,
    executor: ExecutorName = "local", address: Address = None,
) -> None:  # fmt: skip
    """Write the release, with what it needs upstream."""
    run_until(
        "split", data=data, scene=scene, pipeline=pipeline, workers=workers, force=force, quiet=quiet,
        replace=replace, executor=executor, address=address,
    )  # fmt: skip


@app.command("run")
def run(
    pipeline: Annotated[Path, typer.Argument(help="Pipeline file, e.g. pipelines/smoke.toml.")],
    data: Data = Path("data"), scene: Scene = None,
    workers: Workers = None, force: Force = False, quiet: Quiet = False, replace: Replace = False,
    executor: ExecutorName = "local", address: Address = None,
) -> None:  # fmt: skip
    """Run a pipeline's stages, from recipes and annotations to the release."""
    from aerialdojo_gen.pipeline.runner import stages_named

    config, roots = open_pipeline(pipeline, data)
    stages = stages_named(config.stages)
    forced = [stage.name for stage in stages] if force else []
    run_stages(
        stages, config, roots, scene, workers, forced, quiet, replace=replace, executor=executor, address=address
    )
