"""Commands for your own scenes: importing, drafting annotations, annotating, the gallery."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import choose_scenes, closest
from aerialdojo_gen.base.text_table import terminal_width
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import key_values, merge_scenes, print_next, print_scene
from aerialdojo_gen.dataset.build import open_pipeline, pipeline_file
from aerialdojo_gen.store.atomic import make_folder
from aerialdojo_gen.store.root import open_root

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.pipeline import Pipeline
    from aerialdojo_gen.imports.command import AddedScene
    from aerialdojo_gen.pipeline.stage import ProjectPaths

app = typer.Typer()


def _number_or_auto(value: str | None) -> str | None:
    """Take a number from 2 on, or ``auto``."""
    if value is None or value == "auto" or (value.isascii() and value.isdigit() and 2 <= int(value[:9]) < 10**6):
        return value
    raise typer.BadParameter(f"{value[:40]!r} is neither auto nor a number from 2 on")


@app.command("add-scene")
def add_scene(
    name: Annotated[str, typer.Argument(help="Name of the scene; with the suffix _1 it is out-of-distribution.")],
    mesh: Annotated[Path, typer.Argument(help="GLB, glTF, OBJ, STL, PLY, 3DS, DAE or FBX file.")],
    up: Annotated[str | None, typer.Option(help="The mesh's axis that points up: z or y.")] = None,
    scale: Annotated[
        float | None, typer.Option(help="Metres per unit of the mesh: 0.01 for centimetres.  (default: 1)")
    ] = None,
    annotations: Annotated[Path | None, typer.Option(help="Annotation file of the scene.")] = None,
    project: Annotated[Path, typer.Option(help="Folder for your scenes and their pipeline.")] = Path("my-scenes"),
    crop: Annotated[
        tuple[float, float, float] | None, typer.Option(help="Keep a circle: x y radius, metres.")
    ] = None,
    box: Annotated[
        tuple[float, float, float, float] | None, typer.Option(help="Keep a rectangle: x0 y0 x1 y1, metres.")
    ] = None,
    tiles: Annotated[
        float | None, typer.Option(help="Cut the mesh into squares of this edge length in metres, one scene each.")
    ] = None,
    ceiling: Annotated[
        float | None, typer.Option(help="Maximum flying height z, metres.  (default: 6 m above the highest point)")
    ] = None,
    names: Annotated[Path | None, typer.Option(help="CSV or TOML that names nodes and materials.")] = None,
    light: Annotated[
        str, typer.Option(help="Lighting of textures: sun (lit by the scene), baked (already in them) or auto.")
    ] = "auto",
    texture_px: Annotated[
        int, typer.Option(min=16, max=8192, help="Maximum texture side, pixels; larger textures are reduced.")
    ] = 8192,
    force: Annotated[bool, typer.Option("--force", help="Replace a scene of this name.")] = False,
    show: Annotated[
        bool, typer.Option("--list", help="List what the file contains, and guess its axis and scale; write nothing.")
    ] = False,
) -> None:
    """Make a scene from your own mesh file."""
    from aerialdojo_gen.imports import command
    from aerialdojo_gen.imports.import_mesh import MeshOptions
    from aerialdojo_gen.imports.naming import Naming, read_names

    naming = Naming() if names is None else read_names(names)
    if show:
        print("\n".join(command.list_mesh(mesh, up=up, scale=scale, naming=naming, width=terminal_width())))
        return
    if up is None:
        raise UsageError(
            f"--up is missing: z or y; {cli_context.command('add-scene', name, mesh, '--list')} guesses it"
        )
    if tiles is not None and annotations is not None:
        raise UsageError("--annotations are of one scene, --tiles make several: leave one of them out")
    scale = 1.0 if scale is None else scale
    options = MeshOptions(up, scale, crop, box, ceiling, light, naming, texture_px)
    if tiles is not None:
        made = command.add_tiles(name, mesh, project, tiles, options, force=force, on_added=_describe)
        print(f"{len(made):,} scenes in one frame")
    else:
        made = [command.add_scene(name, mesh, project, options, annotations=annotations, force=force)]
        _describe(made[0])
    first = next((added.scene.name for added in made if not added.annotations.exists()), None)
    print_next(first, made[0].pipeline, project)


def _describe(added: AddedScene) -> None:
    print_scene(added.scene, added.repairs.lines)


@app.command("annotate-draft")
def annotate_draft(
    name: options.OneScene = None,
    scene: options.SceneOption = None,
    landmarks: Annotated[
        int | None, typer.Option(min=1, help="Number of landmarks.  (default: the paper's, else 1 or 2)")
    ] = None,
    objects: Annotated[
        str | None,
        typer.Option(
            metavar="N|auto",
            callback=_number_or_auto,
            help="Number of objects; auto takes up to 20.  (default: the paper's, else auto)",
        ),
    ] = None,
    centre: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Centre of the core area, x y in metres.  (default: the landmarks' centre)"),
    ] = None,
    within: Annotated[float | None, typer.Option(min=1, help="Radius of the core area, metres.")] = None,
    core_share: Annotated[
        float, typer.Option(min=0, max=1, help="Fraction of the objects that lie in the core area.")
    ] = 1.0,
    min_share_elevated: Annotated[
        float, typer.Option(min=0, max=1, help="Minimum fraction of objects in the core 3 m or more above ground.")
    ] = 0.0,
    max_plants: Annotated[int, typer.Option(min=0, help="Maximum number of objects per category of plants.")] = 3,
    max_per_category: Annotated[
        int | None,
        typer.Option(
            min=1, help="Maximum number of objects per other category.  (default: 5; more if a scene has few)"
        ),
    ] = None,
    landmark: Annotated[list[str] | None, typer.Option(help="Node to use as a landmark; repeatable.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed; the same seed gives the same draft.")] = 0,
    pipeline: options.PipelineFile = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    rewrite: Annotated[
        str | None,
        typer.Option(
            metavar="openai|anthropic",
            help="Let a language model write the descriptions; those that cannot be verified are dropped.",
        ),
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option(help="Option of --rewrite, repeatable: --option model=…, --option base_url=…")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Send the requests of --rewrite, whatever they cost.")] = False,
    max_tokens: Annotated[
        int | None, typer.Option(min=0, help="Ask --rewrite no more after this number of tokens.")
    ] = None,
    max_cost: Annotated[
        float | None, typer.Option(min=0, help="Ask --rewrite no more after this cost, US dollars.")
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Draft a scene's annotations, for you to check and commit."""
    from aerialdojo_gen.annotations.draft import DraftOptions
    from aerialdojo_gen.imports.drafting import draft_scene
    from aerialdojo_gen.pipeline.progress import Reporter

    config, roots = open_pipeline(pipeline_file(pipeline), Path("data"))
    scene = _one_scene(name, scene, config, roots)
    options = DraftOptions(
        landmarks=tuple(landmark or ()),
        n_landmarks=landmarks,
        n_objects=int(objects) if objects and objects != "auto" else objects,
        seed=seed,
        centre_m=centre,
        core_radius_m=within,
        core_share=core_share,
        elevated_share=min_share_elevated,
        max_vegetation=max_plants,
        max_per_category=max_per_category,
    )
    reporter = Reporter(quiet=quiet)
    fresh = rewrite is None or force or not (roots.annotations / f"{scene}.json").exists()
    agent = None
    if rewrite is not None:
        from aerialdojo_gen.studio.annotate.rewrite import make_agent, rewrite_scene

        agent = make_agent(rewrite, key_values(option or []))
        if max_cost is not None and not agent.priced:
            prices = "--option input_usd_per_million=… --option output_usd_per_million=…"
            raise UsageError(f"--max-cost needs prices: {prices}")
    if fresh:
        print(draft_scene(scene, config, roots, options, force=force, reporter=reporter))
    if agent is not None:
        from aerialdojo_gen.benchmark.evaluation import Limits

        limits = Limits(max_cost, max_tokens) if yes or (max_tokens, max_cost) != (None, None) else None
        rewrite_scene(scene, roots, agent, limits, again=fresh, say=print)
        if limits is None:
            print("nothing was sent: --yes sends it; --max-tokens or --max-cost sends it up to a limit")


@app.command("gallery")
def gallery(
    scenes: options.Scenes = None,
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("docs/gallery"),
    scene: options.Scene = None, pipeline: options.PipelineFile = None,
    props: Annotated[bool, typer.Option("--props/--no-props", help="Draw the sheets of props too.")] = True,
    small: Annotated[bool, typer.Option("--small", help="Write JPEGs 1280 pixels wide, for web pages.")] = False,
    kit: Annotated[bool, typer.Option("--kit", help="Draw the builders that plans call instead.")] = False,
    designs: Annotated[list[str] | None, typer.Option(
        metavar="CATEGORY", help="Draw the designs that a category comes in instead; repeatable.")] = None,
    references: Annotated[bool, typer.Option(
        "--references", help="Draw the objects' reference images with their descriptions instead.")] = False,
    data: options.Data = "data",
) -> None:  # fmt: skip
    """Draw every prop and every scene as contact sheets."""
    scene = merge_scenes(scenes, scene)
    if references:
        _reference_sheets(out, scene, data, "jpg" if small else "png")
        return
    from aerialdojo_gen.pipeline import runner
    from aerialdojo_gen.rendering.gallery import designs_sheet, props_sheet, scene_sheet, write_picture
    from aerialdojo_gen.scenes.build import build_scene
    from aerialdojo_gen.scenes.catalogue import load_catalogue

    config, roots = open_pipeline(pipeline, out)
    chosen = runner.chosen_scenes(config, roots, scene)
    make_folder(out)  # before anything is drawn
    catalogue = load_catalogue(roots.scene_assets)
    suffix, width = ("jpg", 1280) if small else ("png", None)
    if designs:
        print(write_picture(designs_sheet(catalogue, designs, 140), out, f"designs.{suffix}", width))
        return
    if kit:
        from aerialdojo_gen.rendering.gallery import kit_sheets

        for name, sheet in kit_sheets(catalogue, [roots.recipes / f"{name}.toml" for name in chosen]):
            print(write_picture(sheet, out, f"{name}.{suffix}", width))
        return
    for name in chosen:
        sheet = scene_sheet(build_scene(roots.recipes / f"{name}.toml", catalogue))
        print(write_picture(sheet, out, f"{name}.{suffix}", width))
    if props:
        landmarks = [name for name, kind in catalogue.kinds.items() if kind == "landmark"]
        for title, names in (("props", catalogue.targets), ("landmarks", landmarks)):
            size = 120 if small else 200
            print(write_picture(props_sheet(catalogue, names, size), out, f"{title}.{suffix}"))


def _reference_sheets(out: Path, scene: list[str] | None, data: str, suffix: str) -> None:
    from aerialdojo_gen.dataset.lookup import pictured_objects, scenes_with_pictures
    from aerialdojo_gen.rendering.gallery import reference_sheets, write_picture

    root = open_root(data)
    scenes = scenes_with_pictures(root, scene)
    make_folder(out)
    for name in scenes:
        for k, sheet in enumerate(reference_sheets(pictured_objects(root, name))):
            print(write_picture(sheet, out, f"references-{name}-{k + 1}.{suffix}"))


def named_scene(position: str | None, option: str | None) -> str | None:
    """Return the scene that is named by position or by ``--scene``."""
    if position and option and position != option:
        raise UsageError(f"two scenes, {position} and --scene {option}: name one")
    return position or option


def _one_scene(position: str | None, option: str | None, config: Pipeline, roots: ProjectPaths) -> str:
    """Return the scene that is named, by any recipe's name, else one of the pipeline's that is picked."""
    from aerialdojo_gen.pipeline.runner import chosen_scenes, known_scenes

    given = named_scene(position, option)
    return pick_scene(given, known_scenes(roots.recipes) if given else chosen_scenes(config, roots))


def pick_scene(
    given: str | None, known: Sequence[str], stdin: TextIO | None = None, stderr: TextIO | None = None
) -> str:
    """Choose one of the scenes there are."""
    stdin, stderr = stdin or sys.stdin, stderr or sys.stderr
    fitting = choose_scenes([given] if given else None, known)
    if len(fitting) == 1:
        return fitting[0]
    if not (stdin.isatty() and stderr.isatty()):
        shown = ", ".join(fitting[:5]) + (" …" if len(fitting) > 5 else "")
        raise UsageError(f"{len(fitting)} scenes fit{f' {given!r}' if given else ''}: name one: {shown}")
    print("\n".join(_listed(fitting)), file=stderr)
    while True:
        print(f"scene (1 to {len(fitting)}, or a name): ", end="", file=stderr, flush=True)
        answer = stdin.readline()
        if not answer:
            raise UsageError("no scene was picked")
        word = answer.strip()
        if word.isascii() and word.isdigit() and 1 <= int(word[:6]) <= len(fitting):
            return fitting[int(word) - 1]
        if near := [name for name in fitting if name == word] or closest(word, fitting):
            return near[0]


def _listed(names: Sequence[str], columns: int = 3) -> list[str]:
    """Number names in columns that are read downwards."""
    rows = -(-len(names) // columns)
    width = max(map(len, names)) + 1
    cells = [f"{k + 1:3} {name:{width}}" for k, name in enumerate(names)]
    return ["".join(cells[row::rows]).rstrip() for row in range(rows)]


@app.command("annotate")
def annotate(
    name: options.OneScene = None,
    data: options.Data = "data",
    scene: options.SceneOption = None,
    pipeline: options.PipelineFile = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on.  (default: a free one)")] = 0,
    host: Annotated[
        str, typer.Option(help="IPv4 address to listen on; except on loopback, visitors need a token.")
    ] = "127.0.0.1",
    browser: options.Browser = True,
    coco: Annotated[
        Path | None, typer.Option(help="Write boxes and pictures to this COCO archive (ZIP) and exit.")
    ] = None,
) -> None:
    """Annotate a scene in the browser: landmarks, objects and their anchors."""
    from aerialdojo_gen.studio.web.serving import require_web

    if coco is None:
        require_web()
    from aerialdojo_gen.studio.annotate.session import open_session

    config, roots = open_pipeline(pipeline, data)
    scene = _one_scene(name, scene, config, roots)
    session = open_session(scene, config, roots)
    if coco is not None:
        from aerialdojo_gen.studio.annotate.coco import write_coco

        print(write_coco(session, coco))
    else:
        from aerialdojo_gen.studio.annotate.server import serve_session

        serve_session(session, port=port, host=host, browser=browser, say=lambda line: print(line, flush=True))
