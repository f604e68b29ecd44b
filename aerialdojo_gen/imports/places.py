"""``add-map`` and ``add-terrain`` as functions: real places as plans in a project folder."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.imports.command import check_free
from aerialdojo_gen.imports.dem import read_dem
from aerialdojo_gen.imports.earth import Bbox, check_bbox, tile_bboxes
from aerialdojo_gen.imports.map_plan import TownOptions, town_plan
from aerialdojo_gen.imports.osm import read_maps
from aerialdojo_gen.imports.placing import Placer
from aerialdojo_gen.imports.project import PIPELINE, make_project
from aerialdojo_gen.imports.relief import PlacePlan, ReliefOptions, relief_plan, town_ground
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.plans import HEIGHTS_SUFFIX
from aerialdojo_gen.scenes.plans.build import build_plan, build_site
from aerialdojo_gen.scenes.plans.text import plan_text
from aerialdojo_gen.scenes.site import MAX_NODES
from aerialdojo_gen.store.atomic import atomic_write

# Margin around the box: streets continue, and building parts may lie outside.
_MARGIN_DEG = 0.0006
_MAX_SCENES = 100
# Things are settled on uneven ground by so large a circle.
_SETTLE_M = 0.5


@dataclass(frozen=True)
class AddedPlace:
    """A scene made of a real place."""

    name: str  # Of the scene
    scene: Scene  # As its plan is built
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
    heights = None if dem is None else partial(town_ground, read_dem(dem), options.cell_m)
    wide, high = _MARGIN_DEG, _MARGIN_DEG / 2
    maps = read_maps(extract, [(w - wide, s - high, e + wide, n + high) for w, s, e, n in boxes])
    towns = []
    for one, box, mapped in zip(names, boxes, maps, strict=True):
        town, summary = town_plan(mapped, box, extract.name, options, heights)
        towns.append((one, town, tuple(_summary_lines(dict(summary)))))
    return [_write_place(one, town, project, notes) for one, town, notes in towns]


def add_terrain(
    name: str, dem: Path, project: Path, options: ReliefOptions | None = None, *, force: bool = False
) -> AddedPlace:
    """Make open country from a height model, in a project folder."""
    options = options or ReliefOptions()
    check_free([name], project, force)
    model = read_dem(dem)
    if options.bbox is not None:
        check_bbox(options.bbox)
    relief, notes = relief_plan(model, options)
    return _write_place(name, relief, project, tuple(notes))


def _write_place(name: str, place: PlacePlan, project: Path, notes: tuple[str, ...]) -> AddedPlace:
    """Build a plan, place things where that leaves room, build it whole, and write it if that succeeds."""
    catalogue = load_catalogue(home() / "scene_assets")
    plan, sections, table = dict(place.plan), dict(place.sections), place.heights
    # File names may contain any character, newlines too.
    comments = "\n".join("".join(c if c.isprintable() else "?" for c in line) for line in place.comments)
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / f"{name}.toml"
        if table is not None:
            (Path(folder) / f"{name}{HEIGHTS_SUFFIX}").write_text(table.text(), encoding="ascii")
        try:
            site, _ = build_site(name, plan, catalogue, f"{name}.toml", Path(folder))
            placer = Placer(site, None if table is None else _SETTLE_M)
            place.place_things(placer)
            things, more = placer.entries()
            sections |= {len(plan["site"]) + k: text for k, text in more.items()}
            plan["site"] = [*plan["site"], *things]
            text = plan_text(plan, comments, sections)
            trial.write_text(text, encoding="utf-8")
            scene = build_plan(trial, catalogue)
        except AssetError as error:
            raise AssetError(str(error).replace(f"{trial}", f"{name}.toml")) from None
    if placer.left_out:
        notes += (f"{placer.left_out:,} things left out: a scene has {MAX_NODES:,} instances at most",)
    make_project(project)
    heights = f"scenes/{name}{HEIGHTS_SUFFIX}"
    files = {} if table is None else {heights: table.text()}
    for file, content in (files | {f"scenes/{name}.toml": text}).items():
        atomic_write(project, file, content)
    for left in {f"scenes/{name}.glb", heights} - files.keys():
        (project / left).unlink(missing_ok=True)
    return AddedPlace(name, scene, project / "scenes" / f"{name}.toml", project / PIPELINE, notes)


def _summary_lines(counts: dict[str, int]) -> list[str]:
    """Summarise the features, the sources of building heights, and omissions."""
    what = [
        f"{n:,} {key}" for key in ("buildings", "streets", "paths", "things of the map") if (n := counts.pop(key, 0))
    ]
    by = {"height": "by their height", "levels": "by their levels", "rule": "by rule, without either"}
    sources = [f"{n:,} {word}" for key, word in by.items() if (n := counts.pop(key, 0))]
    lines = [", ".join(what) or "nothing that stands"]
    lines += [f"heights of buildings: {', '.join(sources)}"] if sources else []
    return lines + [f"{n:,} {key}" for key, n in sorted(counts.items())]
