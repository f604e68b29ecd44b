"""A scene for the browser: one binary file, merged into a few draw calls, from which a triangle's node can be told.

Layout (little-endian): ``uint32`` length of the header, the header as JSON padded to 4 bytes, then the body that the
header's offsets point into. ``static/payload.js`` reads it. Triangles are merged into one group for all flat colours
and one for every size of texture (each a texture array), so that a scene is three draw calls or so; within a group
they lie node by node, and ``ranges`` says where a node begins and ends.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.common.pictures import TEXTURE_PNG, encode_png
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.rendering.lighting import light_of
from aerialdojo_gen.scenes.model import Material, Part, Scene

VERSION = 1
_FLAT = (0, 0)


class _Body:
    """The binary part, aligned to 4 bytes so that the browser can lay typed arrays over it."""

    def __init__(self) -> None:
        self.data = bytearray()

    def add(self, raw: bytes) -> dict[str, int]:
        view = {"offset": len(self.data), "bytes": len(raw)}
        self.data += raw + b"\0" * (-len(raw) % 4)
        return view


def scene_payload(scene: Scene) -> bytes:
    """Pack a scene for ``static/scene.js``.

    Parameters
    ----------
    scene : Scene
        World frame, metres; coordinates become float32, as they are in the scene's GLB.

    Returns
    -------
    bytes
        The same scene always gives the same bytes.

    Raises
    ------
    AssetError
        A texture cannot be encoded.
    """
    light = light_of(scene)
    body = _Body()
    groups: dict[tuple[int, int], list[tuple[int, Part]]] = {}
    for k, instance in enumerate(scene.instances):
        for part in instance.parts:
            groups.setdefault(_size(scene.materials[part.material]), []).append((k, part))
    boxes = [i.bounds for i in scene.instances]
    header = {
        "version": VERSION,
        "name": scene.name,
        "bounds_m": scene.bounds.tolist(),
        "n_triangles": scene.n_triangles,
        "sun": light.sun.tolist(),
        "zenith": (light.zenith / 255.0).tolist(),
        "horizon": (light.horizon / 255.0).tolist(),
        "nodes": [
            {"node": i.node, "category": i.category, "variant": i.variant, "attributes": i.attributes}
            for i in scene.instances
        ],
        "boxes": body.add(np.asarray(boxes, dtype="<f4").tobytes()),
        "groups": [_group(body, size, groups[size], scene.materials) for size in sorted(groups)],
    }
    head = json.dumps(header, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    head += b" " * (-len(head) % 4)
    return struct.pack("<I", len(head)) + head + bytes(body.data)


def _size(material: Material) -> tuple[int, int]:
    return _FLAT if material.texture is None else (material.texture.shape[0], material.texture.shape[1])


def _group(
    body: _Body, size: tuple[int, int], parts: list[tuple[int, Part]], materials: dict[str, Material]
) -> dict[str, Any]:
    """Merge parts that draw together; within the group they stay in the order of the scene's instances."""
    vertices, index = soup([p for _, p in parts])
    counts = [len(p.vertices) for _, p in parts]
    group: dict[str, Any] = {
        "size": list(size),
        "position": body.add(vertices.astype("<f4").tobytes()),
        "index": body.add(index.astype("<u4").tobytes()),
        "ranges": body.add(_ranges(parts).astype("<u4").tobytes()),
    }
    if size == _FLAT:
        colours = np.array([[*materials[p.material].colour, 255] for _, p in parts], dtype=np.uint8)
        return group | {"colour": body.add(np.repeat(colours, counts, axis=0).tobytes())}
    names = sorted({p.material for _, p in parts})
    layer = {name: k for k, name in enumerate(names)}
    layers = np.repeat(np.array([layer[p.material] for _, p in parts], dtype="<f4"), counts)
    # The model's v points up, a picture's rows down; textures repeat, so that the sign is all there is to it.
    uv = np.concatenate([p.uv for _, p in parts]) * np.array([1.0, -1.0], dtype=np.float32)
    return group | {
        "uv": body.add(np.column_stack([uv, layers]).astype("<f4").tobytes()),
        "layers": [_png(body, materials[name]) for name in names],
    }


def _ranges(parts: list[tuple[int, Part]]) -> NDArray[np.int64]:
    """Rows (node, first face, faces) of a group, (n, 3): one row for the parts of a node together."""
    rows: list[list[int]] = []
    face = 0
    for node, part in parts:
        if rows and rows[-1][0] == node:
            rows[-1][2] += len(part.faces)
        else:
            rows.append([node, face, len(part.faces)])
        face += len(part.faces)
    return np.array(rows, dtype=np.int64)


def _png(body: _Body, material: Material) -> dict[str, int]:
    assert material.texture is not None
    return body.add(encode_png(material.texture, TEXTURE_PNG))
