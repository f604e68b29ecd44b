"""The twin of ``add-scene``: a folder of a user's own scenes, which every other command takes by its pipeline."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from aerialdojo_gen.annotations.format import parse_annotations
from aerialdojo_gen.errors import AnnotationError, AssetError, UsageError, brief
from aerialdojo_gen.imports.adopt import Repairs, adopt
from aerialdojo_gen.imports.files import read_mesh
from aerialdojo_gen.imports.naming import read_names
from aerialdojo_gen.pipeline.registry import STAGES
from aerialdojo_gen.scenes.glb import write_glb
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.atomic import atomic_file, make_folder
from aerialdojo_gen.store.layout import check_scene_name

PIPELINE = "pipeline.toml"


@dataclass(frozen=True)
class Added:
    """What `add_scene` made.

    Attributes
    ----------
    scene : Scene
        The scene.
    repairs : Repairs
        What was mended in the mesh.
    pipeline : Path
        The project's pipeline file, for ``--pipeline``.
    annotations : Path
        Where the scene's annotations stand, or belong.
    """

    scene: Scene
    repairs: Repairs
    pipeline: Path
    annotations: Path


def add_scene(
    name: str,
    mesh: Path,
    project: Path,
    *,
    up: str,
    scale: float = 1.0,
    annotations: Path | None = None,
    crop_m: tuple[float, float, float] | None = None,
    ceiling_m: float | None = None,
    names: Path | None = None,
    force: bool = False,
) -> Added:
    """Make a scene of a mesh file, in a project folder.

    The folder holds ``scenes/<name>.toml`` with ``scenes/<name>.glb`` beside it, ``annotations/`` and a
    ``pipeline.toml``; scenes are added to it one by one, and nothing else in it is touched.

    Parameters
    ----------
    name : str
        Letters, digits, ``_`` and ``-``; the suffix ``_1`` puts the scene in the OOD partition.
    mesh : Path
        GLB, OBJ, STL, PLY or 3DS.
    project : Path
        The folder; made where it is missing.
    up : {"z", "y"}
        The mesh's axis that points up.
    scale : float
        Metres a unit of the mesh.
    annotations : Path, optional
        An annotation file to go with it.
    crop_m : (x, y, radius), optional
        Keep a part, metres.
    ceiling_m : float, optional
        Highest z that a drone may fly at.
    names : Path, optional
        A table of what the file's nodes are called (`aerialdojo_gen.imports.naming.read_names`).
    force : bool
        Replace a scene of this name.

    Returns
    -------
    Added

    Raises
    ------
    UsageError
        The scene exists already, or its name is no name.
    AssetError
        The mesh cannot be read, or nothing is left of it.
    AnnotationError
        The annotation file is of another scene or malformed.
    """
    check_scene_name(name)
    recipe = project / "scenes" / f"{name}.toml"
    if recipe.exists() and not force:
        raise UsageError(f"{recipe} exists: --force replaces the scene")
    naming = None if names is None else read_names(names)
    text = None if annotations is None else _annotations(annotations, name)
    try:
        scene, repairs = adopt(
            name, read_mesh(mesh), up=up, scale=scale, crop_m=crop_m, ceiling_m=ceiling_m, naming=naming
        )
    except AssetError as error:
        message = str(error)
        raise AssetError(message if message.startswith(str(mesh)) else f"{mesh}: {message}") from None
    for folder in ("scenes", "annotations"):
        make_folder(project / folder)
    with atomic_file(project, f"scenes/{name}.glb") as path:
        write_glb(scene, path)
    with atomic_file(project, f"scenes/{name}.toml") as path:
        path.write_text(_recipe(mesh, scene, up, scale, crop_m), encoding="utf-8")
    if text is not None:
        with atomic_file(project, f"annotations/{name}.json") as path:
            path.write_text(text, encoding="utf-8")
    if not (project / PIPELINE).exists():
        with atomic_file(project, PIPELINE) as path:
            path.write_text(pipeline_text(project), encoding="utf-8")
    return Added(scene, repairs, project / PIPELINE, project / "annotations" / f"{name}.json")


def _annotations(path: Path, name: str) -> str:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise AnnotationError(f"{path} cannot be read: {error}") from None
    source = parse_annotations(text)
    if source.scene and source.scene != name:
        found = brief(repr(source.scene), 60)
        raise AnnotationError(f"{path} is of scene {found}, not of {name!r}: its key scene says so")
    if source.faults:
        raise AnnotationError(f"{path}: {source.faults[0]}")
    return text


def _recipe(mesh: Path, scene: Scene, up: str, scale: float, crop_m: tuple[float, float, float] | None) -> str:
    lines = [
        "# Made by add-scene; the mesh lies beside this file, repaired, in metres.",
        "[imported]",
        f"source = {json.dumps(mesh.name)}",
        f'source_sha256 = "{hashlib.sha256(mesh.read_bytes()).hexdigest()}"',
        f'up = "{up}"',
        f"scale = {scale}",
        *([f"crop_m = {list(crop_m)}"] if crop_m else []),
        f"ceiling_m = {scene.ceiling_m}",
        'sky = "#{:02x}{:02x}{:02x}"'.format(*scene.sky),
        f"sun = {list(scene.sun)}",
    ]
    return "\n".join(lines) + "\n"


def pipeline_text(project: Path) -> str:
    """Write the pipeline file of a project of one's own scenes."""
    name = "".join(c if c.isalnum() or c in "._-" else "-" for c in project.resolve().name).strip("._-") or "scenes"
    stages = [stage.name for stage in STAGES if stage.name != "render"]
    lines = [
        "# Scenes of our own.",
        f'name = "{name}"',
        "seed = 0",
        'scenes = ["*"]',
        'recipes = "scenes"',
        'annotations = "annotations"',
        f"stages = {json.dumps(stages)}",
    ]
    return "\n".join(lines) + "\n"
