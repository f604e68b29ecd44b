"""Commands about what was made: statistics, checks, views, other formats."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.text_table import terminal_width
from aerialdojo_gen.cli.common import (
    Data,
    Json,
    PipelineFile,
    Scene,
    Scenes,
    json_text,
    open_pipeline,
    print_json,
    together,
)

if TYPE_CHECKING:
    from aerialdojo_gen.dataset.stats.comparison import Comparison, Listing
    from aerialdojo_gen.store.root import DataRoot

app = typer.Typer()


@app.command("stats")
def stats(
    scenes: Scenes = None, data: Data = "data", scene: Scene = None, pipeline: PipelineFile = None,
    pool: Annotated[bool, typer.Option("--pool", help="Show the candidates that filter kept instead of the "
        "release.")] = False,
    markdown: Annotated[Path | None, typer.Option("--markdown", help="Write the tables to this Markdown "
        "file.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write the tables to this CSV file, one figure "
        "per line.")] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", help="Write figures to this folder, as PNG and SVG.")
    ] = None,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Compare the release with the paper's tables; without a release, show what filter kept."""
    from aerialdojo_gen.dataset.contents import files_there, no_release, scenes_in_release, scenes_there
    from aerialdojo_gen.dataset.provenance import RECORD
    from aerialdojo_gen.store.memo import key_of, memo
    from aerialdojo_gen.store.root import open_root

    root, scene = open_root(data), together(scenes, scene)
    released = scenes_there(root)
    if pool and (markdown or csv or figures):
        raise UsageError("--pool is printed only: leave --markdown, --csv and --figures out")
    if pool or not released:
        from aerialdojo_gen.pipeline import runner
        from aerialdojo_gen.pipeline.stages.work.candidate_pool import pool_lines, pool_of

        if markdown or csv or figures or not root.list("verdicts"):
            raise no_release(root)
        config, roots = open_pipeline(pipeline, data, reads=True)
        pools = [pool_of(root, name) for name in runner.chosen_scenes(config, roots, scene)]
        if as_json:
            print_json([asdict(pool) for pool in pools])
        else:
            print("\n".join(pool_lines(pools, terminal_width())))
        return

    names = scenes_in_release(root, scene) if scene else None
    width = terminal_width()

    def show() -> str:
        compared = _compared(root, names)
        if as_json:
            return json_text([table.as_json() for table in compared])
        return "\n\n".join("\n".join(table.terminal(width)) for table in compared)

    # The same release gives the same tables, and make dataset prints them each time.
    print(memo(key_of(root, [*files_there(root), RECORD], "stats", names, as_json or width), show))
    if markdown or csv:
        from aerialdojo_gen.dataset.stats.comparison import as_csv, as_markdown
        from aerialdojo_gen.store.atomic import atomic_file

        compared = _compared(root, names)
        for path, text in ((markdown, as_markdown(compared)), (csv, as_csv(compared))):
            if path:
                with atomic_file(path.parent, path.name) as temporary:
                    temporary.write_text(text, encoding="utf-8")
    if figures:
        from aerialdojo_gen.dataset.provenance import made_of_scenes
        from aerialdojo_gen.dataset.stats.figures import draw_figures

        told = sys.stderr if as_json else sys.stdout
        print(file=told)
        for path in draw_figures(root, [m.scene for m in made_of_scenes(root, names or released)], figures):
            print(path, file=told)


def _compared(root: DataRoot, scenes: list[str] | None) -> list[Comparison | Listing]:
    """Read a release, or some scenes of it, and set it beside the paper."""
    from aerialdojo_gen.dataset.contents import check_release
    from aerialdojo_gen.dataset.provenance import made_of_scenes
    from aerialdojo_gen.dataset.stats.difficulty import difficulty_tables, read_tasks
    from aerialdojo_gen.dataset.stats.quality import worth_tables
    from aerialdojo_gen.dataset.stats.tables import benchmark_table, tables

    made = made_of_scenes(root, check_release(root, scenes))
    names = [m.scene for m in made]
    return [
        *tables(made), *worth_tables(root, names), *difficulty_tables(read_tasks(root, names)), benchmark_table(made)
    ]  # fmt: skip
