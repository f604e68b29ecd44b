"""Imported meshes packed for OpenGL: large textures, alpha masks, double-sided materials, vertex colours."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import cv2
import numpy as np

from aerialdojo_gen.geometry.arrays import Bytes
from aerialdojo_gen.rendering.gl_geometry import Kind, cut, is_foreign, packed
from aerialdojo_gen.rendering.shading import MUTE
from aerialdojo_gen.scenes.model import HORIZON, Instance, Material, Part, Scene

# Fourth byte of the vertex colour of an unlit material.
_UNLIT = 255
_Key = tuple[int, int, bool, bool]


def foreign_kinds(scene: Scene) -> list[Kind]:
    """Pack the triangles that `aerialdojo_gen.rendering.gl_geometry.own_kinds` leaves out."""
    return _kinds(scene.instances, scene.materials, True, ("FOREIGN",))


def backdrop_kinds(scene: Scene) -> list[Kind]:
    """Pack sky domes: all materials, both sides."""
    domes = [instance for instance in scene.backdrop if instance.surface != HORIZON]
    # No light falls on a dome: its colours stay as vivid as they are.
    unlit = {name: replace(material, unlit=True) for name, material in scene.materials.items()}
    return _kinds(domes, unlit, False, ("FOREIGN", "BACKDROP"))


def _kinds(
    instances: Iterable[Instance], materials: dict[str, Material], foreign_only: bool, tags: tuple[str, ...]
) -> list[Kind]:
    drawn: dict[_Key, list[tuple[Part, Material, int]]] = {}
    for k, instance in enumerate(instances):
        for part in instance.parts:
            material = materials[part.material]
            if not foreign_only or is_foreign(part, material):
                double_sided = material.double_sided or not foreign_only
                key = (*_size(material), material.mask is not None, double_sided)
                drawn.setdefault(key, []).append((part, material, k))
    kinds = (_kind(key, drawn[key], tags) for key in sorted(drawn))
    return [kind for kind in kinds if kind is not None]


def _kind(key: _Key, drawn: list[tuple[Part, Material, int]], tags: tuple[str, ...]) -> Kind | None:
    rows, part_of = packed(drawn)
    if not len(rows):
        return None
    layer = {material.name: material for _, material, _ in drawn if material.texture is not None}
    number = {name: k for k, name in enumerate(layer)}
    unlit = np.array([_UNLIT if material.unlit else 0 for _, material, _ in drawn])
    rows["colour"][..., 3] = unlit[part_of, None]
    rows["layer"] = np.array([number.get(material.name, 0) for _, material, _ in drawn])[part_of, None]
    return Kind(
        cut(rows, double_sided=key[3]),
        (*tags, *(("ATLAS",) if key[0] else ()), *(("MASK",) if key[2] else ())),
        _layers(list(layer.values()), key) if key[0] else None,
        smooth=True,
        double_sided=key[3],
    )


def _size(material: Material) -> tuple[int, int]:
    """Height and width of the layer that a texture gets: powers of two, so that few sizes serve all."""
    if material.texture is None:
        return 0, 0
    height, width = material.texture.shape[:2]
    return 1 << (height - 1).bit_length(), 1 << (width - 1).bit_length()


def _layers(materials: list[Material], key: _Key) -> Bytes:
    layers = np.empty((len(materials), key[0], key[1], 4 if key[2] else 3), dtype=np.uint8)
    for k, material in enumerate(materials):
        assert material.texture is not None
        texture = material.texture if material.unlit else cv2.transform(material.texture, MUTE)
        if material.mask is not None:
            alpha = np.where(material.mask, 255, 0).astype(np.uint8)
            # Fill holes with the mean colour, or filtering would give leaves dark edges.
            filled = np.where(material.mask[..., None], texture, np.array(material.colour, dtype=np.uint8))
            texture = np.dstack([filled, alpha])
        if texture.shape[:2] != key[:2]:
            texture = cv2.resize(texture, (key[1], key[0]), interpolation=cv2.INTER_LINEAR)
        layers[k] = texture[::-1]
    return layers
