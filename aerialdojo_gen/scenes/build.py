"""From a scene's file to a scene; nodes are cut out of an imported mesh by boxes, where it has none for an object."""

from __future__ import annotations

import operator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.portable import unit
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.colours import colour_words, shown_colours
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.materials import parse_colour, read_toml
from aerialdojo_gen.scenes.model import Instance, Part, Scene
from aerialdojo_gen.scenes.plans.build import build_tables
from aerialdojo_gen.scenes.recipe import Cut, Imported, imported_of

# Files of versions before 0.2.0, by what they gave as their layout, and the commands that make plans instead.
_NOW_PLANS = {"town": "add-map", "relief": "add-terrain"}


def build_scene(path: Path, catalogue: Catalogue) -> Scene:
    """Build the scene of a file, whose stem names it: of a plan, or of a mesh that ``add-scene`` imported.

    It is exact in float32, and the same for the same files on every run. An `AssetError` says what is wrong with the
    file, what it names that the catalogue or the kit lacks, or of which category it has fewer than `inventory` asks.
    """
    body = read_toml(path)
    imported = imported_of(path, body)
    if imported is not None:
        return _imported(path, imported)
    layout = body.get("layout")
    if layout is not None:
        rebuild = _NOW_PLANS.get(layout) if isinstance(layout, str) else None
        advice = f"run {rebuild} again, with --force" if rebuild else "docs/plans.md has the format"
        raise AssetError(f"{path}: scenes are plans since version 0.2.0, without 'layout': {advice}")
    return build_tables(path.stem, body, catalogue, where=str(path), folder=path.parent)


def _imported(path: Path, imported: Imported) -> Scene:
    """Read the mesh that ``add-scene`` put beside the file; ceiling, sky, sun and boxes are the file's."""
    scene = read_glb(path.with_suffix(".glb"))
    bounds = scene.bounds.copy()
    bounds[1, 2] = imported.ceiling_m
    x, y, z = unit(np.array(imported.sun)).tolist()
    whole = Scene(
        path.stem, scene.instances, scene.materials, bounds, parse_colour(imported.sky), (x, y, z), imported=True,
        backdrop=scene.backdrop,
    )  # fmt: skip
    return cut_out(whole, imported.cuts) if imported.cuts else whole


def cut_out(scene: Scene, cuts: tuple[Cut, ...]) -> Scene:
    """Make nodes of the triangles in boxes."""
    instances = list(scene.instances)
    for cut in cuts:
        if any(instance.node == cut.node for instance in instances):
            raise AssetError(
                f"scene {scene.name}: the box {cut.node!r} has the name of an existing node: "
                "remove or rename it in the recipe's [[imported.cuts]]"
            )
        kept: list[Instance] = []
        inside: list[Part] = []
        surfaces: set[str] = set()
        for instance in instances:
            rest = []
            for part in instance.parts:
                middle = part.vertices[part.faces].mean(axis=1)
                boxed = ((middle >= cut.low_m) & (middle <= cut.high_m)).all(axis=1)
                inside += [_subset(part, boxed)] if boxed.any() else []
                surfaces |= {instance.surface} if boxed.any() else set()
                rest += [part if not boxed.any() else _subset(part, ~boxed)] if not boxed.all() else []
            if rest:
                # An instance that lost faces no longer matches its catalogue entry.
                whole = len(rest) == len(instance.parts) and all(map(operator.is_, rest, instance.parts))
                kept.append(instance if whole else replace(instance, parts=tuple(rest), anatomy=None))
        if not inside:
            raise AssetError(f"scene {scene.name}: the box {cut.node!r} holds no triangle's middle: make it larger")
        attributes = {"colour": colour_words(*shown_colours(inside, scene.materials))}
        # A piece of the ground stays ground: no body flies below it.
        surface = "ground" if "ground" in surfaces else "sheet" if surfaces - {""} else ""
        instances = [*kept, Instance(cut.node, cut.category, "", attributes, tuple(inside), surface=surface)]
    return replace(scene, instances=tuple(instances))


def _subset(part: Part, faces: NDArray[np.bool_]) -> Part:
    used, index = np.unique(part.faces[faces], return_inverse=True)
    colours = None if part.colours is None else part.colours[used]
    return Part(part.vertices[used], index.reshape(-1, 3).astype(np.int32), part.uv[used], part.material, colours)
