"""Imported meshes packed for OpenGL: large textures, alpha masks, double-sided materials, vertex colours."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.rendering.gl_geometry import Kind, cut, is_foreign, packed
from aerialdojo_gen.rendering.shading import MUTE
from aerialdojo_gen.scenes.model import HORIZON, Instance, Material, Scene

# Fourth byte of the vertex colour of an unlit material.
_UNLIT = 255
_Key = tuple[int, int, bool, bool]


def foreign_kinds(scene: Scene) -> list[Kind]:
    """Pack the triangles that `aerialdojo_gen.rendering.gl_geometry.chunks` leaves out."""
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
    rows: dict[_Key, list[NDArray[np.void]]] = {}
    names: dict[_Key, dict[str, int]] = {}
    for k, instance in enumerate(instances):
        for part in instance.parts:
            material = materials[part.material]
            if foreign_only and not is_foreign(part, material):
                continue
            double_sided = material.double_sided or not foreign_only
            key = (*_size(material), material.mask is not None, double_sided)
            vertices = packed(part, material, k)
            vertices["colour"][..., 3] = _UNLIT if material.unlit else 0
            if material.texture is not None:
                layer = names.setdefault(key, {})
                vertices["layer"] = layer.setdefault(material.name, len(layer))
            rows.setdefault(key, []).append(vertices)
    return [
        Kind(
            cut(rows[key], double_sided=key[3]),
            (*tags, *(("ATLAS",) if key[0] else ()), *(("MASK",) if key[2] else ())),
            _layers([materials[name] for name in names[key]], key) if key[0] else None,
            smooth=True,
            double_sided=key[3],
        )
        for key in sorted(rows)
    ]


def _size(material: Material) -> tuple[int, int]:
    """Height and width of the layer that a texture gets: powers of two, so that few sizes serve all."""
    if material.texture is None:
        return 0, 0
    height, width = material.texture.shape[:2]
    return 1 << (height - 1).bit_length(), 1 << (width - 1).bit_length()


def _layers(materials: list[Material], key: _Key) -> NDArray[np.uint8]:
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
