"""3DS files: a tree of chunks with id, length and body (Autodesk 3D Studio File Format, release 3).

No maintained Python package reads them without a system library. This reads the named triangle objects, in world
coordinates, and the diffuse colours of their materials; animation is ignored.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.imports.raw import GREY, RawNode, default_colours

_MAIN, _EDITOR, _OBJECT, _MESH = 0x4D4D, 0x3D3D, 0x4000, 0x4100
_VERTICES, _FACES, _FACE_MATERIAL = 0x4110, 0x4120, 0x4130
_MATERIAL, _MATERIAL_NAME, _DIFFUSE, _RGB_FLOAT, _RGB_BYTE = 0xAFFF, 0xA000, 0xA020, 0x0010, 0x0011
_HEAD = struct.Struct("<HI")


def read_3ds(data: bytes) -> list[RawNode]:
    """Read a 3DS file."""
    try:
        chunks = list(_chunks(data, 0, len(data)))
        if not chunks or chunks[0][0] != _MAIN:
            raise AssetError("is not a 3DS file")
        editor = [c for c in _chunks(data, *chunks[0][1:]) if c[0] == _EDITOR]
        colours: dict[str, tuple[int, int, int]] = {}
        nodes = []
        for _, start, end in editor:
            for kind, first, last in _chunks(data, start, end):
                if kind == _MATERIAL:
                    name, colour = _material(data, first, last)
                    colours[name] = colour
                elif kind == _OBJECT:
                    name, body = _text(data, first, last)
                    nodes += [_mesh(data, name, a, b, colours) for k, a, b in _chunks(data, body, last) if k == _MESH]
    except (struct.error, ValueError, IndexError) as error:
        raise AssetError("is a damaged 3DS file") from error
    return nodes


def _chunks(data: bytes, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Yield (id, start of the body, end) of the chunks between two offsets."""
    while start + _HEAD.size <= end:
        kind, length = _HEAD.unpack_from(data, start)
        if length < _HEAD.size or start + length > end:
            raise ValueError("a chunk reaches beyond its parent")
        yield kind, start + _HEAD.size, start + length
        start += length


def _text(data: bytes, start: int, end: int) -> tuple[str, int]:
    stop = data.index(b"\0", start, end)
    return data[start:stop].decode("latin-1"), stop + 1


def _material(data: bytes, start: int, end: int) -> tuple[str, tuple[int, int, int]]:
    name, colour = "", GREY
    for kind, a, b in _chunks(data, start, end):
        if kind == _MATERIAL_NAME:
            name = _text(data, a, b)[0]
        elif kind == _DIFFUSE:
            for inner, first, _ in _chunks(data, a, b):
                if inner == _RGB_BYTE:
                    colour = struct.unpack_from("<3B", data, first)
                elif inner == _RGB_FLOAT:
                    light = struct.unpack_from("<3f", data, first)
                    red, green, blue = (round(255 * min(max(c, 0.0), 1.0)) for c in light)
                    colour = red, green, blue
    return name, colour


def _mesh(data: bytes, name: str, start: int, end: int, colours: dict[str, tuple[int, int, int]]) -> RawNode:
    vertices: NDArray[np.float64] = np.zeros((0, 3))
    faces: NDArray[np.int64] = np.zeros((0, 3), dtype=np.int64)
    painted = default_colours(0)
    for kind, a, b in _chunks(data, start, end):
        if kind == _VERTICES:
            vertices = _records(data, a, b, "<f4", 3).astype(np.float64)
        elif kind == _FACES:
            records = _records(data, a, b, "<u2", 4)
            faces, painted = records[:, :3].astype(np.int64), default_colours(len(records))
            for inner, first, last in _chunks(data, a + 2 + 8 * len(records), b):
                if inner == _FACE_MATERIAL:
                    material, body = _text(data, first, last)
                    painted[_records(data, body, last, "<u2", 1)[:, 0]] = colours.get(material, GREY)
    if len(faces) and int(faces.max()) >= len(vertices):
        raise ValueError("a face beyond the vertices")
    return RawNode(name, vertices, faces, painted)


def _records(data: bytes, start: int, end: int, dtype: str, width: int) -> NDArray[Any]:
    (count,) = struct.unpack_from("<H", data, start)
    size = count * width * np.dtype(dtype).itemsize
    if start + 2 + size > end:
        raise ValueError("an array reaches beyond its chunk")
    return np.frombuffer(data, dtype=dtype, count=count * width, offset=start + 2).reshape(-1, width)
