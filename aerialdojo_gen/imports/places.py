"""``add-map`` and ``add-terrain`` as functions: real places as recipes in a project folder."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.imports.command import PIPELINE, check_free, write_pipeline
from aerialdojo_gen.imports.dem import read_dem
from aerialdojo_gen.imports.earth import Bbox, check_bbox, tile_bboxes
from aerialdojo_gen.imports.map_recipe import TownOptions, town_recipe
from aerialdojo_gen.imports.osm import read_maps
from aerialdojo_gen.imports.relief import ReliefOptions, ground_sampler, relief_recipe
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.layouts.build import build_scene
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.atomic import atomic_file, make_folder

# Margin around the box: streets continue, and building parts may lie outside.
_MARGIN_DEG = 0.0006
_MAX_SCENES = 100


@dataclass(frozen=True)
class AddedPlace:
    """A scene made of a real place."""

    name: str  # Of the scene
    scene: Scene  # As its recipe is built
    recipe: Path  # Files of the project
    pipeline: Path
    notes: tuple[str, ...]  # Lines for the user


def add_map(
    name: str, extract: Path, project: Path, bbox: Sequence[Bbox], options: TownOptions | None = None, *,
    tile_m: float | None = None, dem: Path | None = None, force: bool = False,
) -> list[AddedPlace]:  # fmt: skip
    """Make one town per bounding box (degrees, WGS 84) of an OpenStreetMap extract; each is test-built first."""
    options = options or TownOptions()
    boxes = [check_bbox(box) for box in bbox]
    if not boxes:
        raise UsageError("--bbox WEST SOUTH EAST NORTH is needed: which part of the map, degrees")
    if tile_m is not None:
        if not 20.0 <= tile_m <= 1000.0:
            raise UsageError(f"--tiles {tile_m:g}: a scene is 20 to 1,000 m wide")
        boxes = [tile for box in boxes for tile in tile_bboxes(box, tile_m)]
    if len(boxes) > _MAX_SCENES:
        raise UsageError(f"{len(boxes):,} scenes requested, the maximum is {_MAX_SCENES}: use larger tiles")
    names = [name] if len(boxes) == 1 else [f"{name}-{k}" for k in range(1, len(boxes) + 1)]
    check_free(names, project, force)
    heights = None if dem is None else ground_sampler(read_dem(dem), options.cell_m)
    wide, high = _MARGIN_DEG, _MARGIN_DEG / 2
    maps = read_maps(extract, [(w - wide, s - high, e + wide, n + high) for w, s, e, n in boxes])
    texts = []
    for one, box, found in zip(names, boxes, maps, strict=True):
        text, summary = town_recipe(found, box, extract.name, options, heights)
        texts.append((one, text, tuple(_summary_lines(dict(summary.counts)))))
    return [_write_place(one, text, project, notes) for one, text, notes in texts]


def add_terrain(
    name: str, dem: Path, project: Path, options: ReliefOptions | None = None, *, force: bool = False
) -> AddedPlace:
    """Make open country from a height model, in a project folder."""
    options = options or ReliefOptions()
    check_free([name], project, force)
    model = read_dem(dem)
    if options.bbox is not None:
        check_bbox(options.bbox)
    text, notes = relief_recipe(model, options)
    return _write_place(name, text, project, tuple(notes))


def _write_place(name: str, text: str, project: Path, notes: tuple[str, ...]) -> AddedPlace:
    """Build a recipe, and write it if that succeeds."""
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / f"{name}.toml"
        trial.write_text(text, encoding="utf-8")
        try:
            scene = build_scene(trial, load_catalogue(home() / "scene_assets"))
        except AssetError as error:
            raise AssetError(str(error).replace(f"{trial}", f"{name}.toml")) from None
    for inner in ("scenes", "annotations"):
        make_folder(project / inner)
    with atomic_file(project, f"scenes/{name}.toml") as path:
        path.write_text(text, encoding="utf-8")
    (project / "scenes" / f"{name}.glb").unlink(missing_ok=True)
    write_pipeline(project)
    return AddedPlace(name, scene, project / "scenes" / f"{name}.toml", project / PIPELINE, notes)


def _summary_lines(counts: dict[str, int]) -> list[str]:
    """Summarise the features, the sources of building heights, and omissions."""
    what = [
        f"{n:,} {key}" for key in ("buildings", "streets", "paths", "things of the map") if (n := counts.pop(key, 0))
    ]
    by = {"height": "by their height", "levels": "by their levels", "rule": "by rule, without either"}
    known = [f"{n:,} {word}" for key, word in by.items() if (n := counts.pop(key, 0))]
    lines = [", ".join(what) or "nothing that stands"]
    if known:
        lines.append(f"heights of buildings: {', '.join(known)}")
    return lines + [f"{n:,} {key}" for key, n in sorted(counts.items())]
