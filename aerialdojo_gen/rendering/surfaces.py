"""A scene's triangles merged by material, for TinyRenderer: its segmentation mask then holds every pixel's material.

A software rasteriser visits every pixel of a triangle's bounding box, visible or not. So triangles that no camera can
see from the front are dropped, and long ones are cut: a long sliver would cost as much as a whole picture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerialdojo_gen.geometry.arrays import Bytes, Flags, Floats, Ints
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.colours import texel
from aerialdojo_gen.scenes.model import Material, Part, Scene

# Edges longer than this are halved, metres.
_LONGEST_EDGE_M = 10.0
# Margins of the cameras' box around the flight volume and above its floor, metres.
_AROUND_M, _FLOOR_M = 300.0, 0.1
# Subdivisions of masked triangles into four, and the maximum number of triangles.
_HALVINGS, _MAX_CUT = 4, 200_000


@dataclass(frozen=True, eq=False)
class Surface:
    """All triangles of one material."""

    material: str  # Name of the material
    vertices: Floats  # (n, 3) float64; metres, world frame
    uv: Floats  # (n, 2) float64; texture coordinates in tiles
    faces: Ints  # (m, 3) int64; indices into `vertices`
    palette: Bytes | None = None  # (h, w, 3) uint8 or None


def surfaces(scene: Scene) -> list[Surface]:
    """Merge a scene's triangles by material."""
    by_material: dict[str, list[Part]] = {}
    for instance in scene.instances:
        for part in instance.parts:
            by_material.setdefault(part.material, []).append(part)
    low, high = scene.bounds[0], scene.bounds[1]
    camera_box = np.stack([low + np.array([-_AROUND_M, -_AROUND_M, _FLOOR_M]), high + _AROUND_M])
    merged = (_apply_material(_merge(name, by_material[name]), scene.materials[name]) for name in sorted(by_material))
    cut = (_cut(_drop_back_faces(surface, camera_box)) for surface in merged)
    return [surface for surface in cut if len(surface.faces)]


def _merge(material: str, parts: list[Part]) -> Surface:
    if any(p.colours is not None for p in parts):
        return _merge_coloured(material, parts)
    vertices, faces = soup(parts)
    uv = np.concatenate([p.uv for p in parts]).astype(np.float64)
    return Surface(material, vertices, uv, faces.astype(np.int64))


def _merge_coloured(material: str, parts: list[Part]) -> Surface:
    """Merge parts with vertex colours: TinyRenderer interpolates none, so every face gets its mean colour."""
    vertices, faces = soup(parts)
    corner_colours = np.concatenate([p.colours[p.faces] for p in parts if p.colours is not None])
    side = max(1, int(np.ceil(np.sqrt(len(corner_colours)))))
    palette = np.zeros((side * side, 3), dtype=np.uint8)
    palette[: len(corner_colours)] = np.rint(corner_colours.mean(axis=1))
    k = np.arange(len(corner_colours))
    uv = np.stack([(k % side + 0.5) / side, 1.0 - (k // side + 0.5) / side], axis=1)
    corners = vertices[faces].reshape(-1, 3)
    index = np.arange(len(corners)).reshape(-1, 3)
    return Surface(material, corners, np.repeat(uv, 3, axis=0), index, palette.reshape(side, side, 3))


def _apply_material(surface: Surface, material: Material) -> Surface:
    """Apply alpha mask and back faces as geometry: TinyRenderer supports neither."""
    if material.mask is not None:
        surface = _cut_holes(surface, material.mask)
    if material.double_sided:
        surface = replace(surface, faces=np.concatenate([surface.faces, surface.faces[:, ::-1]]))
    return surface


def _cut_holes(surface: Surface, mask: Flags) -> Surface:
    """Drop the masked-out pieces of subdivided triangles."""
    vertices, uv, faces = surface.vertices, surface.uv, surface.faces
    for _ in range(_HALVINGS):
        if 4 * len(faces) > _MAX_CUT:
            break
        n, middles = len(vertices), [(faces[:, k], faces[:, (k + 1) % 3]) for k in range(3)]
        vertices = np.concatenate([vertices, *((vertices[a] + vertices[b]) / 2.0 for a, b in middles)])
        uv = np.concatenate([uv, *((uv[a] + uv[b]) / 2.0 for a, b in middles)])
        ab, bc, ca = (n + k * len(faces) + np.arange(len(faces)) for k in range(3))
        a, b, c = faces.T
        faces = np.concatenate([np.stack(f, axis=1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    opaque = mask[texel(uv[faces].mean(axis=1), mask.shape[0], mask.shape[1])]
    return Surface(surface.material, vertices, uv, faces[opaque])


def _drop_back_faces(surface: Surface, camera_box: Floats) -> Surface:
    """Drop the triangles that face away from every point of a box, and those without an area."""
    corners = surface.vertices[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # The box's corner farthest along the normal is the one that would see the front.
    farthest = np.where(normal > 0.0, camera_box[1], camera_box[0])
    front = np.einsum("ij,ij->i", normal, farthest - corners[:, 0]) > 0.0
    return replace(surface, faces=surface.faces[front])


def _cut(surface: Surface) -> Surface:
    """Halve the longest edge of every triangle until none is too long, at the same point in both of its triangles."""
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
