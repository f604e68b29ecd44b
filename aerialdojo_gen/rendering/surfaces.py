"""A scene's triangles merged by material: what a renderer draws as one body.

The segmentation mask then tells the shader the material of every pixel.

A software rasteriser visits every pixel of a triangle's bounding box, seen or not. So triangles that no camera
can see from the front are left out, and long ones are cut up: a ground of slivers would cost a picture each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.model import Material, Part, Scene
from aerialdojo_gen.scenes.sampling import texel

# Edges longer than this are halved, metres.
_LONGEST_EDGE_M = 10.0
# Cameras stand within so much of the flight volume at its sides and above it, and so much over its floor, metres.
_AROUND_M, _FLOOR_M = 300.0, 0.1
# How often triangles with holes are cut into four, and how many that may make.
_HALVINGS, _MOST_HOLED = 4, 200_000


@dataclass(frozen=True, eq=False)
class Surface:
    """All triangles of one material."""

    material: str  # Name of the material
    vertices: NDArray[np.float64]  # (n, 3) float64; metres, world frame
    uv: NDArray[np.float64]  # (n, 2) float64; texture coordinates in tiles
    faces: NDArray[np.int64]  # (m, 3) int64; indices into `vertices`
    palette: NDArray[np.uint8] | None = None  # (h, w, 3) uint8 or None


def surfaces(scene: Scene) -> list[Surface]:
    """Merge a scene's triangles by material."""
    by_material: dict[str, list[Part]] = {}
    for instance in scene.instances:
        for part in instance.parts:
            by_material.setdefault(part.material, []).append(part)
    low, high = scene.bounds[0], scene.bounds[1]
    room = np.stack([low + np.array([-_AROUND_M, -_AROUND_M, _FLOOR_M]), high + _AROUND_M])
    merged = (_foreign(_merge(name, by_material[name]), scene.materials[name]) for name in sorted(by_material))
    cut = (_cut(_visible(surface, room)) for surface in merged)
    return [surface for surface in cut if len(surface.faces)]


def _merge(material: str, parts: list[Part]) -> Surface:
    if any(p.colours is not None for p in parts):
        return _painted(material, parts)
    vertices, faces = soup(parts)
    uv = np.concatenate([p.uv for p in parts]).astype(np.float64)
    return Surface(material, vertices, uv, faces.astype(np.int64))


def _painted(material: str, parts: list[Part]) -> Surface:
    """Merge parts with vertex colours: TinyRenderer mixes none, so that each face has the mean of its own."""
    vertices, faces = soup(parts)
    own = np.concatenate([np.zeros((0, 3, 3)), *(p.colours[p.faces] for p in parts if p.colours is not None)])
    side = max(1, int(np.ceil(np.sqrt(len(own)))))
    palette = np.zeros((side * side, 3), dtype=np.uint8)
    palette[: len(own)] = np.rint(own.mean(axis=1))
    k = np.arange(len(own))
    uv = np.stack([(k % side + 0.5) / side, 1.0 - (k // side + 0.5) / side], axis=1)
    corners = vertices[faces].reshape(-1, 3)
    index = np.arange(len(corners)).reshape(-1, 3)
    return Surface(material, corners, np.repeat(uv, 3, axis=0), index, palette.reshape(side, side, 3))


def _foreign(surface: Surface, material: Material) -> Surface:
    """Give a surface its holes and its back: TinyRenderer knows neither."""
    if material.mask is not None:
        surface = _holed(surface, material.mask)
    if material.double_sided:
        surface = replace(surface, faces=np.concatenate([surface.faces, surface.faces[:, ::-1]]))
    return surface


def _holed(surface: Surface, mask: NDArray[np.bool_]) -> Surface:
    """Leave out what of a surface is a hole, in pieces of its triangles."""
    vertices, uv, faces = surface.vertices, surface.uv, surface.faces
    for _ in range(_HALVINGS):
        if 4 * len(faces) > _MOST_HOLED:
            break
        n, middles = len(vertices), [(faces[:, k], faces[:, (k + 1) % 3]) for k in range(3)]
        vertices = np.concatenate([vertices, *((vertices[a] + vertices[b]) / 2.0 for a, b in middles)])
        uv = np.concatenate([uv, *((uv[a] + uv[b]) / 2.0 for a, b in middles)])
        ab, bc, ca = (n + k * len(faces) + np.arange(len(faces)) for k in range(3))
        a, b, c = faces.T
        faces = np.concatenate([np.stack(f, axis=1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    there = mask[texel(uv[faces].mean(axis=1), mask.shape[0], mask.shape[1])]
    return Surface(surface.material, vertices, uv, faces[there])


def _visible(surface: Surface, room: NDArray[np.float64]) -> Surface:
    """Drop the triangles that turn their backs on every point of a box, and those without an area."""
    corners = surface.vertices[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # The box's corner farthest along the normal is the one that would see the front.
    farthest = np.where(normal > 0.0, room[1], room[0])
    front = np.einsum("ij,ij->i", normal, farthest - corners[:, 0]) > 0.0
    return replace(surface, faces=surface.faces[front])


def _cut(surface: Surface) -> Surface:
    """Halve the longest edge of every triangle until none is too long.

    Every edge that is too long is halved in both of its triangles at the same point, so that no gap opens.
    """
    vertices, uv, faces = surface.vertices, surface.uv, surface.faces
    done = []
    while len(faces):
        edges = vertices[np.roll(faces, -1, axis=1)] - vertices[faces]
        length = np.linalg.norm(edges, axis=2)
        long = length.max(axis=1) > _LONGEST_EDGE_M
        done.append(faces[~long])
        faces, longest = faces[long], length[long].argmax(axis=1)
        rows = np.arange(len(faces))
        a, b, c = (faces[rows, (longest + k) % 3] for k in range(3))
        # Both triangles of an edge must round its middle alike: sum the ends in the same order.
        first, second = np.minimum(a, b), np.maximum(a, b)
        middle = len(vertices) + rows
        vertices = np.concatenate([vertices, (vertices[first] + vertices[second]) / 2.0])
        uv = np.concatenate([uv, (uv[first] + uv[second]) / 2.0])
        faces = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return replace(surface, vertices=vertices, uv=uv, faces=np.concatenate([*done, faces]))
