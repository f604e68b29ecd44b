"""``add-scene`` as functions: a project folder with the user's own scenes and a pipeline file."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerialdojo_gen.annotations.format import parse_annotations
from aerialdojo_gen.base.errors import AnnotationError, AssetError, UsageError, brief, check_regular
from aerialdojo_gen.imports.cutting import Region
from aerialdojo_gen.imports.files import read_mesh
from aerialdojo_gen.imports.import_mesh import (
    LARGEST_M,
    SMALLEST_M,
    MeshOptions,
    Repairs,
    SourceMesh,
    check_axes,
    import_mesh,
    make_scene,
)
from aerialdojo_gen.imports.listing import describe_mesh
from aerialdojo_gen.imports.naming import Naming
from aerialdojo_gen.imports.project import PIPELINE, make_project
from aerialdojo_gen.scenes.glb import write_glb
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.atomic import atomic_file, atomic_write
from aerialdojo_gen.store.layout import check_scene_name


@dataclass(frozen=True)
class AddedScene:
    """The result of `add_scene`."""

    scene: Scene  # The scene
    repairs: Repairs  # Repairs of the mesh
    pipeline: Path  # The project's pipeline file, for ``--pipeline``
    annotations: Path  # Path of the scene's annotations, existing or not


def add_scene(
    name: str, mesh: Path, project: Path, options: MeshOptions, *, annotations: Path | None = None,
    force: bool = False,
) -> AddedScene:  # fmt: skip
    """Make a scene from a mesh file in a project folder."""
    check_free([name], project, force)
    text = None if annotations is None else _annotations(annotations, name)
    with _prefix_errors(mesh):
        scene, repairs = import_mesh(name, read_mesh(mesh, texture_px=options.texture_px), options)
    recipe = _recipe(_file_digest(mesh), scene, repairs, options, options.box_m)
    return _write_scene(scene, repairs, project, recipe, text)


def add_tiles(
    name: str, mesh: Path, project: Path, edge_m: float, options: MeshOptions, *, force: bool = False,
    on_added: Callable[[AddedScene], None] = lambda added: None,
) -> list[AddedScene]:  # fmt: skip
    """Make scenes of a large mesh, one per square of `edge_m` metres, in one frame; all or none are written."""
    check_scene_name(_tile_name(name, 99, 99))
    with _prefix_errors(mesh):
        source = SourceMesh.of(read_mesh(mesh, texture_px=options.texture_px), options)
        if options.region is not None:
            source = source.within(options.region)
        # Build all tiles before writing any, so that a failure leaves nothing behind.
        tiles = list(_make_tiles(name, source, edge_m, options))
        if not tiles:
            raise AssetError(f"--tiles {edge_m:g}: every tile of the mesh is nearly empty")
    check_free([scene.name for _, scene, _ in tiles], project, force)
    source_digest, out = _file_digest(mesh), []
    for region, scene, repairs in tiles:
        recipe = _recipe(source_digest, scene, repairs, options, (*region.low.tolist(), *region.high.tolist()))
        out.append(_write_scene(scene, repairs, project, recipe, None))
        on_added(out[-1])
    return out


_MAX_TILES = 400
# Tiles at the edge with less than this share of their plan are skipped.
_MIN_SHARE = 0.02


def _make_tiles(
    name: str, source: SourceMesh, edge_m: float, options: MeshOptions
) -> Iterator[tuple[Region, Scene, Repairs]]:
    """Cut a mesh into squares of `edge_m` metres, in one frame; yields those with content, from south-west on."""
    if not (math.isfinite(edge_m) and SMALLEST_M <= edge_m <= LARGEST_M):
        raise UsageError(f"--tiles {edge_m:g}: the edge of a tile is {SMALLEST_M:g} to {LARGEST_M:g} m")
    low, high = source.bounds
    columns, rows = (max(1, math.ceil(v / edge_m - 1e-9)) for v in (high - low)[:2])
    if columns * rows > _MAX_TILES:
        raise AssetError(
            f"--tiles {edge_m:g}: {columns * rows:,} tiles, the maximum is {_MAX_TILES}: use larger tiles"
        )
    origin = np.array([*(low[:2] + high[:2]) / 2, low[2]])
    boxes = np.array([[b.vertices[:, :2].min(axis=0), b.vertices[:, :2].max(axis=0)] for b in source.bodies])
    for row in range(rows):
        for column in range(columns):
            corner = low[:2] + edge_m * np.array([column, row])
            region = Region.box(*corner, *(corner + edge_m))
            near = np.asarray((boxes[:, 0] < region.high).all(axis=1) & (boxes[:, 1] > region.low).all(axis=1))
            bodies = [b for b, n in zip(source.bodies, near, strict=True) if n]
            part = replace(source, bodies=bodies)
            if not near.any() or not _has_content(part, region, edge_m):
                continue
            yield region, *make_scene(_tile_name(name, column, row), part, options, region, origin)


def _tile_name(name: str, column: int, row: int) -> str:
    """Name a tile by its column from the west and its row from the south; a partition suffix stays last."""
    stem, suffix = (name[:-2], name[-2:]) if name.endswith(("_0", "_1")) else (name, "")
    return f"{stem}-x{column}y{row}{suffix}"


def _has_content(source: SourceMesh, region: Region, edge_m: float) -> bool:
    """Whether the content of a square is wide enough to fly in."""
    try:
        part = source.within(region)
    except AssetError:
        return False
    low, high = part.bounds
    size = (high - low)[:2]
    return bool(size.max() >= SMALLEST_M and np.prod(size) >= _MIN_SHARE * edge_m**2)


def list_mesh(
    mesh: Path, *, up: str | None = None, scale: float | None = None, naming: Naming, width: int | None = None
) -> list[str]:
    """Describe the content of a mesh file, in lines for a terminal."""
    check_axes(up, scale)
    with _prefix_errors(mesh):
        return [f"{mesh.name}:", *describe_mesh(read_mesh(mesh), up, scale, naming, width)]


def check_free(names: Sequence[str], project: Path, force: bool) -> None:
    """Raise a `UsageError` if the project already has one of the scenes, unless `force`."""
    for name in names:
        check_scene_name(name)
        recipe = project / "scenes" / f"{name}.toml"
        if recipe.exists() and not force:
            raise UsageError(f"{recipe} exists: --force replaces the scene")


@contextmanager
def _prefix_errors(mesh: Path) -> Iterator[None]:
    """Prefix error messages with the mesh's path."""
    try:
        yield
    except AssetError as error:
        message = str(error)
        raise AssetError(message if message.startswith(str(mesh)) else f"{mesh}: {message}") from None


def _write_scene(scene: Scene, repairs: Repairs, project: Path, recipe: str, text: str | None) -> AddedScene:
    """Write a scene into a project: the recipe last, so that an interrupted write leaves no scene."""
    name = scene.name
    make_project(project)
    with atomic_file(project, f"scenes/{name}.glb") as path:
        write_glb(scene, path)
    atomic_write(project, f"scenes/{name}.toml", recipe)
    if text is not None:
        atomic_write(project, f"annotations/{name}.json", text)
    return AddedScene(scene, repairs, project / PIPELINE, project / "annotations" / f"{name}.json")


def _annotations(path: Path, name: str) -> str:
    try:
        check_regular(path)
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise AnnotationError(f"{path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise AnnotationError(f"{path} is not UTF-8: {error}") from None
    source = parse_annotations(text)
    if source.scene and source.scene != name:
        named = brief(repr(source.scene), 60)
        raise AnnotationError(f"{path} is of scene {named}, not of {name!r}: its key scene says so")
    if source.faults:
        raise AnnotationError(f"{path}: {source.faults[0]}")
    return text


def _file_digest(mesh: Path) -> tuple[str, str]:
    return mesh.name, hashlib.sha256(mesh.read_bytes()).hexdigest()


def _recipe(
    source: tuple[str, str], scene: Scene, repairs: Repairs, options: MeshOptions, box_m: tuple[float, ...] | None
) -> str:
    lines = [
        "# Made by add-scene; the mesh lies beside this file, repaired, in metres.",
        "[imported]",
        # TOML has all of JSON's escapes.
        f"source = {json.dumps(source[0].replace(chr(127), ''), ensure_ascii=False)}",
        f'source_sha256 = "{source[1]}"',
        f'up = "{options.up}"',
        f"scale = {options.scale}",
        *(f"{key} = {list(part)}" for key, part in (("crop_m", options.crop_m), ("box_m", box_m)) if part),
        f"origin_m = {list(repairs.origin_m)}",
        f"ceiling_m = {scene.ceiling_m}",
        'sky = "#{:02x}{:02x}{:02x}"'.format(*scene.sky),
        f"sun = {list(scene.sun)}",
    ]
    return "\n".join(lines) + "\n"
