"""Nodes cut out of an imported mesh by boxes, where the file has no node for an object."""

from __future__ import annotations

import operator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.colours import colour_words, shown_colours
from aerialdojo_gen.scenes.model import Instance, Part, Scene
from aerialdojo_gen.scenes.recipe import Cut


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
                boxed = _in_box(part, cut)
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


def _in_box(part: Part, cut: Cut) -> NDArray[np.bool_]:
    middle = part.vertices[part.faces].mean(axis=1)
    return np.asarray(((middle >= cut.low_m) & (middle <= cut.high_m)).all(axis=1))


def _subset(part: Part, faces: NDArray[np.bool_]) -> Part:
    used, index = np.unique(part.faces[faces], return_inverse=True)
    colours = None if part.colours is None else part.colours[used]
    return Part(part.vertices[used], index.reshape(-1, 3).astype(np.int32), part.uv[used], part.material, colours)
