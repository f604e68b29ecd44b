"""A scene as one binary file for the browser, merged into a few draw calls with the node of every triangle.

Layout (little-endian): ``uint32`` length of the header, the header as JSON padded to 4 bytes, then the body that the
header's offsets point into; read by ``static/payload.js``. There is one group for all flat colours and one per
texture size (a texture array each). In a group, triangles are sorted by node, with the bounds in ``ranges``.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import PAGE_JPEG, TEXTURE_PNG, encode_jpeg, encode_masked, encode_png
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.rendering.lighting import light_of
from aerialdojo_gen.rendering.texels import downscale
from aerialdojo_gen.scenes.model import HORIZON, Material, Part, Scene

VERSION = 1
_FLAT = (0, 0)
_LARGEST_PX = 4096
# Larger textures, in bytes of pixels, are sent as JPEG.
_PNG_BYTES = 4 << 20
_NOTHING = np.zeros((0, 3), dtype=np.int64)
_Key = tuple[int, int, bool, bool, bool, str]


class _Body:
    """The binary part, aligned to 4 bytes so that the browser can lay typed arrays over it."""

    def __init__(self) -> None:
        self.data = bytearray()

    def add(self, raw: bytes) -> dict[str, int]:
        view = {"offset": len(self.data), "bytes": len(raw)}
        self.data += raw + b"\0" * (-len(raw) % 4)
        return view


def scene_payload(scene: Scene) -> bytes:
    """Pack a scene for ``static/scene.js``: float32 world metres, the same bytes for the same scene."""
    light = light_of(scene)
    body = _Body()
    groups: dict[_Key, list[tuple[int, Part]]] = {}
    for backdrop, instances in ((False, scene.instances), (True, scene.backdrop)):
        for k, instance in enumerate(instances):
            kind = instance.surface if backdrop else ""
            for part in instance.parts:
                groups.setdefault(_group_key(scene.materials[part.material], kind), []).append((k, part))
    boxes = [i.bounds for i in scene.instances]
    header = {
        "version": VERSION,
        "name": scene.name,
        "bounds_m": scene.bounds.tolist(),
        "n_triangles": scene.n_triangles,
        "sun": light.sun.tolist(),
        "zenith": (light.zenith / 255.0).tolist(),
        "horizon": (light.horizon / 255.0).tolist(),
        "sun_rgb": light.sun_rgb.tolist(),
        "sky_rgb": light.sky_rgb.tolist(),
        "ground_rgb": light.ground_rgb.tolist(),
        "haze_m": light.haze_m,
        "nodes": [
            {"node": i.node, "category": i.category, "variant": i.variant, "attributes": i.attributes}
            for i in scene.instances
        ],
        "boxes": body.add(np.asarray(boxes, dtype="<f4").tobytes()),
        "groups": [_group(body, key, groups[key], scene.materials) for key in sorted(groups)],
    }
    head = json.dumps(header, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    head += b" " * (-len(head) % 4)
    return struct.pack("<I", len(head)) + head + bytes(body.data)


def _group_key(material: Material, kind: str) -> _Key:
    """Return the key by which parts are merged into one draw call; `kind` is that of a backdrop."""
    texture = _texture(material)
    size = _FLAT if texture is None else (texture.shape[0], texture.shape[1])
    return (*size, material.mask is not None, material.double_sided, material.unlit, kind)


def _texture(material: Material) -> NDArray[np.uint8] | None:
    """Return the texture in a size that browsers support."""
    if material.texture is None or not material.atlas:
        return material.texture
    return downscale(material.texture, _LARGEST_PX)


def _group(body: _Body, key: _Key, parts: list[tuple[int, Part]], materials: dict[str, Material]) -> dict[str, Any]:
    """Merge parts into one draw call, in the order of the scene's instances."""
    vertices, index = soup([p for _, p in parts])
    counts = [len(p.vertices) for _, p in parts]
    size, (holes, both_sides, unlit, kind) = key[:2], key[2:]
    flags = {
        "holes": holes, "both_sides": both_sides, "unlit": unlit, "behind": kind == "dome", "beyond": kind == HORIZON
    }  # fmt: skip
    group: dict[str, Any] = {
        **{key: True for key, value in flags.items() if value},
        "size": list(size),
        "position": body.add(vertices.astype("<f4").tobytes()),
        "index": body.add(index.astype("<u4").tobytes()),
        "ranges": body.add((_NOTHING if kind else _ranges(parts)).astype("<u4").tobytes()),
    }
    if size == _FLAT:
        colours = np.full((sum(counts), 4), 255, dtype=np.uint8)
        own = [
            np.tile(np.array(materials[p.material].colour, np.uint8), (n, 1)) if p.colours is None else p.colours
            for (_, p), n in zip(parts, counts, strict=True)
        ]
        colours[:, :3] = np.concatenate(own)
        return group | {"colour": body.add(colours.tobytes())}
    names = sorted({p.material for _, p in parts})
    layer = {name: k for k, name in enumerate(names)}
    layers = np.repeat(np.array([layer[p.material] for _, p in parts], dtype="<f4"), counts)
    # The model's v points up, image rows down; textures repeat, so only the sign changes.
    uv = np.concatenate([p.uv for _, p in parts]) * np.array([1.0, -1.0], dtype=np.float32)
    return group | {
        "uv": body.add(np.column_stack([uv, layers]).astype("<f4").tobytes()),
        "layers": [_png(body, materials[name]) for name in names],
    }


def _ranges(parts: list[tuple[int, Part]]) -> NDArray[np.int64]:
    """Rows (node, first face, faces) of a group, (n, 3), one per node."""
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
    texture = _texture(material)
    assert texture is not None
    if material.mask is not None:
        mask = downscale(np.where(material.mask, 255, 0).astype(np.uint8), _LARGEST_PX) >= 128
        return body.add(encode_masked(texture, mask, TEXTURE_PNG))
    if material.atlas and texture.size > _PNG_BYTES:
        return body.add(encode_jpeg(texture, PAGE_JPEG))
    return body.add(encode_png(texture, TEXTURE_PNG))
