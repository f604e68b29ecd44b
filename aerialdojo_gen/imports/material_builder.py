"""Convert the appearance of a foreign mesh's faces to parts and materials of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.imports.cutting import unique_rows
from aerialdojo_gen.imports.raw import RawNode, RawSurface
from aerialdojo_gen.scenes.catalogue import single
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Material, Part

# Lighting of textures: automatic, by the scene's sun, or none because it is baked in.
LIGHTS = ("auto", "sun", "baked")

# Bodies with more plain colours use vertex colours instead of one part per colour.
_MAX_PLAIN = 64
# More vertex colours than this suggest a photograph.
_MAX_PAINTED = 256
# Textures repeated more often are patterns, not photographs of the place (a box has six sides).
_REPEATED = 8.0
_MIXED = "vertex colours"


@dataclass
class MaterialBuilder:
    """Makes parts and their materials."""

    baked: bool = False  # Whether textures and vertex colours include lighting
    materials: dict[str, Material] = field(default_factory=dict)  # Materials in use, by name
    _scales: dict[str, float] = field(default_factory=dict)

    def parts(self, body: RawNode, double_sided: bool) -> tuple[Part, ...]:
        """Make a body's parts, one per material, sorted by material name."""
        made: list[tuple[Material, Part]] = []
        kind = _face_kinds(body)
        plain = kind == _PLAIN
        for rgb in np.unique(body.colours[plain], axis=0):
            rows = plain & (body.colours == rgb).all(axis=1)
            red, green, blue = (int(c) for c in rgb)
            name = f"#{red:02x}{green:02x}{blue:02x}"
            made += self._build_parts(body, rows, Material(name, (red, green, blue), double_sided=double_sided))
        painted = kind == _PAINTED
        if painted.any():
            # White: vertex colours replace it, or are multiplied by it without effect.
            paint = Material(_MIXED, (255, 255, 255), atlas=True, double_sided=double_sided, unlit=self.baked)
            made += self._build_parts(body, painted, paint)
        for k in np.unique(kind[kind >= 0]):
            made += self._build_parts(body, kind == k, self._textured(body.surfaces[k], double_sided))
        return tuple(part for _, part in sorted(made, key=lambda pair: pair[0].name))

    def measure_texture_scales(self, nodes: Sequence[RawNode]) -> None:
        """Measure the metres that each texture's width covers, over all nodes that show it; vertices in metres."""
        shown = _shown_areas(nodes).items()
        self._scales = {key: float(np.sqrt(world / flat)) if flat > 0 else 1.0 for key, (world, flat) in shown}

    def _textured(self, surface: RawSurface, double_sided: bool) -> Material:
        both = double_sided or (surface.mask is not None and surface.double_sided)
        return Material(
            f"texture {surface.digest[:12]}", surface.colour, surface.texture,
            min(max(self._scales.get(surface.digest, 1.0), 1e-3), 1e6), surface.mask, atlas=True, double_sided=both,
            unlit=self.baked or surface.unlit, jpeg=surface.jpeg,
        )  # fmt: skip

    def _build_parts(self, body: RawNode, rows: NDArray[np.bool_], material: Material) -> list[tuple[Material, Part]]:
        sides, light = ", both sides" if material.double_sided else "", ", unlit" if material.unlit else ""
        material = replace(material, name=material.name.split(",")[0] + sides + light)
        material = self.materials.get(material.name, material)
        corners = None
        if material.texture is not None and body.corners is not None:
            corners = body.corners[rows][..., :2]
        elif material.atlas:
            corners = _painted(body, rows)
        vertices, faces, carried = _split(single(body.vertices), body.faces[rows], corners)
        solid = areas(vertices, faces) > 0.0
        if not solid.any():
            return []
        used, index = np.unique(faces[solid], return_inverse=True)
        uv, colours = np.zeros((len(used), 2), dtype=np.float32), None
        if carried is not None and material.texture is not None:
            uv = carried[used].astype(np.float32)
        elif carried is not None:
            colours = carried[used].astype(np.uint8)
        self.materials.setdefault(material.name, material)
        part = Part(vertices[used], index.reshape(-1, 3).astype(np.int32), uv, material.name, colours)
        return [(material, part)]


_PLAIN, _PAINTED = -1, -2


def _face_kinds(body: RawNode) -> NDArray[np.int32]:
    """Classify faces: the index of the texture, `_PLAIN` or `_PAINTED`."""
    n = len(body.faces)
    kind = np.full(n, _PLAIN, dtype=np.int32)
    if body.corners is not None:
        own = np.isfinite(body.corners[..., 2:]).all(axis=(1, 2))
        # A face of uniform colour is plain, however the file stores it.
        even = own & (np.ptp(np.nan_to_num(body.corners[..., 2:]), axis=1) < 1.0).all(axis=1)
        kind[own & ~even] = _PAINTED
        if (kind == _PAINTED).any():
            kind[even] = _PAINTED
        if body.surface is not None:
            shows = np.array([s.texture is not None for s in body.surfaces] + [False])
            shown = shows[body.surface]
            kind[shown] = body.surface[shown].astype(np.int32)
    plain = kind == _PLAIN
    if plain.any() and len(np.unique(body.colours[plain], axis=0)) > _MAX_PLAIN:
        kind[plain] = _PAINTED
    return kind


def _painted(body: RawNode, rows: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Corner colours of faces, (m, 3, 3), by default the face's colour."""
    face = np.repeat(body.colours[rows][:, None, :].astype(np.float32), 3, axis=1)
    if body.corners is None:
        return face
    own = body.corners[rows][..., 2:]
    return np.where(np.isfinite(own), np.clip(own, 0.0, 255.0), face)


def _shown_areas(nodes: Sequence[RawNode]) -> dict[str, tuple[float, float]]:
    """Areas over all nodes that show a texture, and of it in its coordinates, by the texture's digest."""
    shown: dict[str, tuple[float, float]] = {}
    for node in nodes:
        kind = _face_kinds(node)
        for k in np.unique(kind[kind >= 0]):
            rows, key = kind == k, node.surfaces[k].digest
            assert node.corners is not None
            uv = node.corners[rows][..., :2].astype(np.float64)
            a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
            own = float(areas(node.vertices, node.faces[rows].astype(np.int32)).sum())
            world, flat = shown.get(key, (0.0, 0.0))
            shown[key] = world + own, flat + float((np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2.0).sum())
    return shown


def _split(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], corners: NDArray[np.float32] | None
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float32] | None]:
    """Split vertices at discontinuities of corner attributes."""
    used, flat = np.unique(faces, return_inverse=True)
    flat = flat.reshape(-1)
    if corners is None:
        return vertices[used], flat.reshape(-1, 3).astype(np.int32), None
    carried = corners.reshape(len(flat), -1) + np.float32(0.0)  # no negative zero
    first, index, _ = unique_rows(flat, *carried.T)
    return vertices[used[flat[first]]], index.reshape(-1, 3).astype(np.int32), carried[first]


def is_photographic(nodes: Sequence[RawNode]) -> bool:
    """Guess whether most of a mesh shows photographs with baked lighting rather than patterns."""
    whole = painted = 0.0
    colours: list[NDArray[np.uint8]] = []
    for node in nodes:
        area, rows = areas(node.vertices, node.faces.astype(np.int32)), _face_kinds(node) == _PAINTED
        whole += float(area.sum())
        painted += float(area[rows].sum())
        colours.append(np.unique(node.colours[rows], axis=0))
    many = len(np.unique(np.concatenate([*colours, np.zeros((0, 3), np.uint8)]), axis=0)) > _MAX_PAINTED
    once = sum(area for area, flat in _shown_areas(nodes).values() if flat <= _REPEATED)
    return once + (painted if many else 0.0) > 0.5 * whole
