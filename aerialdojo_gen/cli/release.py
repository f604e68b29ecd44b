"""Commands that inspect a release: statistics, one task, one scene in the browser."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.text_table import facts, terminal_width
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import json_text, merge_scenes, print_json
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.store.atomic import atomic_write
from aerialdojo_gen.store.root import DataRoot, open_root

if TYPE_CHECKING:
    from aerialdojo_gen.dataset.stats.comparison import Comparison, Listing

app = typer.Typer()


@app.command("stats")
def stats(
    scenes: options.Scenes = None, data: options.Data = "data", scene: options.Scene = None,
    pipeline: options.PipelineFile = None,
    pool: Annotated[bool, typer.Option("--pool", help="Show the candidates that filter kept instead of the "
        "release.")] = False,
    markdown: Annotated[Path | None, typer.Option("--markdown", help="Write the tables to this Markdown "
        "file.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write the tables to this CSV file, one figure "
        "per line.")] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", help="Write figures to this folder, as PNG and SVG.")
    ] = None,
    as_json: options.Json = False,
) -> None:  # fmt: skip
    """Compare the release with the paper's tables; without a release, show what filter kept."""
    from aerialdojo_gen.dataset.contents import existing_files, existing_scenes, no_release, scenes_in_release
    from aerialdojo_gen.dataset.provenance import RECORD
    from aerialdojo_gen.store.cache import memo, memo_key

    root, scene = open_root(data), merge_scenes(scenes, scene)
    released = existing_scenes(root)
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
    print(memo(memo_key(root, [*existing_files(root), RECORD], "stats", names, as_json or width), show))
    if markdown or csv:
        from aerialdojo_gen.dataset.stats.comparison import as_csv, as_markdown

        compared = _compared(root, names)
        for path, text in ((markdown, as_markdown(compared)), (csv, as_csv(compared))):
            if path:
                atomic_write(path.parent, path.name, text)
    if figures:
        from aerialdojo_gen.dataset.provenance import made_of_scenes
        from aerialdojo_gen.dataset.stats.figures import draw_figures

        stream = sys.stderr if as_json else sys.stdout
        print(file=stream)
        for path in draw_figures(root, [m.scene for m in made_of_scenes(root, names or released)], figures):
            print(path, file=stream)


def _compared(root: DataRoot, scenes: list[str] | None) -> list[Comparison | Listing]:
    """Read a release, or some scenes of it, and set it beside the paper."""
    from aerialdojo_gen.dataset.contents import check_release
    from aerialdojo_gen.dataset.provenance import made_of_scenes
    from aerialdojo_gen.dataset.stats.measures import difficulty_tables, goal_tables, read_goals, read_tasks
    from aerialdojo_gen.dataset.stats.tables import benchmark_table, tables

    made = made_of_scenes(root, check_release(root, scenes))
    names = [m.scene for m in made]
    tasks = read_tasks(root, names)
    measured = [*goal_tables(read_goals(root, names), tasks), *difficulty_tables(tasks)]
    return [*tables(made), *measured, benchmark_table(made)]


@app.command("show")
def show(
    task_id: Annotated[str, typer.Argument(metavar="TASK_ID", help="A task_id or a nav_id of the release.")],
    data: options.Data = "data",
    out: Annotated[Path | None, typer.Option(help="PNG to write.  (default: TASK_ID.png)")] = None,
    html: Annotated[Path | None, typer.Option(help="HTML page to write, in one file.")] = None,
    frames: Annotated[int, typer.Option(min=0, max=12, help="Number of front views along the route.")] = 5,
    as_json: options.Json = False,
) -> None:
    """Draw one task: goal, route in its scene, clearance, reference image, views along the route."""
    from aerialdojo_gen.dataset.lookup import find_task
    from aerialdojo_gen.studio.show.figure import write_page, write_png
    from aerialdojo_gen.studio.show.pictured import picture_task

    record = find_task(data, task_id)
    if as_json:
        # The rows as they stand: nothing is drawn unless a file is asked for.
        print_json(record.as_json())
        if out is None and html is None:
            return
    pictured = picture_task(record, "image" if task_id.endswith("-i") else "semantic", frames)
    stream = sys.stderr if as_json else sys.stdout
    if not as_json:
        print("\n".join([pictured.title, pictured.terminal_goal, *facts(pictured.facts, terminal_width())]))
    if out is not None or html is None:
        print(write_png(pictured, out or Path(f"{task_id}.png")), file=stream)
    if html is not None:
        print(write_page(pictured, html), file=stream)


@app.command("view")
def view(
    scenes: options.Scenes = None,
    data: options.Data = "data",
    scene: options.Scene = None,
    port: options.Port = 0,
    browser: options.Browser = True,
) -> None:
    """Browse the release in the browser: its scenes and tasks, each scene in 3D with objects and routes."""
    from aerialdojo_gen.studio.web.serving import open_socket, require_web, serve, url_of

    require_web()
    from aerialdojo_gen.dataset.contents import scenes_in_release
    from aerialdojo_gen.studio.view.server import view_app

    names = scenes_in_release(data, merge_scenes(scenes, scene))
    page = view_app(data, names)
    listener = open_socket(port)
    # One scene is shown at once; of several the start page lets one choose.
    path = f"scenes/{names[0]}/" if len(names) == 1 else ""
    called = names[0] if path else f"{len(names)} scenes"
    print(f"{called}: {url_of(listener)}{path}  (Ctrl-C ends it)", flush=True)
    serve(page, listener, browser, path)
