"""Commands about what was made: statistics, checks, views, other formats."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from aerialdojo_gen.commands.common import (
    Data,
    Json,
    PipelineFile,
    Scene,
    Scenes,
    open_pipeline,
    print_json,
    together,
)
from aerialdojo_gen.common.text_table import terminal_width
from aerialdojo_gen.errors import UsageError

app = typer.Typer()


@app.command("stats")
def stats(
    scenes: Scenes = None, data: Data = "data", scene: Scene = None, pipeline: PipelineFile = None,
    pool: Annotated[bool, typer.Option("--pool", help="What filter kept, not the release.")] = False,
    markdown: Annotated[Path | None, typer.Option("--markdown", help="Write the tables as Markdown.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write the tables as CSV, a line a figure.")] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", help="Draw the figures into this folder, as PNG and SVG.")
    ] = None,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Set the release beside the paper's tables; before there is one, what filter kept."""
    from aerialdojo_gen.pipeline import runner
    from aerialdojo_gen.release.contents import check_release, no_release, scenes_in_release, scenes_there
    from aerialdojo_gen.store.root import open_root

    root, scene = open_root(data), together(scenes, scene)
    released = scenes_there(root)
    if pool and (markdown or csv or figures):
        raise UsageError("--pool is printed only: leave --markdown, --csv and --figures out")
    if pool or not released:
        from aerialdojo_gen.release.pool import pool_lines, pool_of

        if markdown or csv or figures or not root.list("verdicts"):
            raise no_release(root)
        config, roots = open_pipeline(pipeline, data)
        pools = [pool_of(root, name) for name in runner.chosen_scenes(config, roots, scene)]
        if as_json:
            print_json([asdict(pool) for pool in pools])
        else:
            print("\n".join(pool_lines(pools, terminal_width())))
        return

    from aerialdojo_gen.release.provenance import made_of_scenes
    from aerialdojo_gen.stats.comparison import Comparison, Listing, as_csv, as_markdown
    from aerialdojo_gen.stats.difficulty import difficulty_tables, read_tasks
    from aerialdojo_gen.stats.tables import benchmark_table, tables
    from aerialdojo_gen.stats.worth import worth_tables
    from aerialdojo_gen.store.atomic import atomic_file

    names = check_release(root, scenes_in_release(root, scene) if scene else None)
    made = made_of_scenes(root, names)
    names_made = [m.scene for m in made]
    tasks = read_tasks(root, names_made)
    compared: list[Comparison | Listing] = [*tables(made), *worth_tables(root, names_made), *difficulty_tables(tasks)]
    compared.append(benchmark_table(made))
    for path, text in ((markdown, as_markdown(compared)), (csv, as_csv(compared))):
        if path:
            with atomic_file(path.parent, path.name) as temporary:
                temporary.write_text(text, encoding="utf-8")
    if as_json:
        print_json([table.as_json() for table in compared])
    else:
        print("\n\n".join("\n".join(table.terminal(terminal_width())) for table in compared))
    if figures:
        from aerialdojo_gen.stats.figures import draw_figures

        told = sys.stderr if as_json else sys.stdout
        print(file=told)
        for path in draw_figures(root, [m.scene for m in made], figures):
            print(path, file=told)
