"""Texture lookup at points of a scene's surface, for ray casts: texture coordinates, colours and alpha masks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.arrays import Bytes, Flags, Floats, Int32s
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.rendering.casters import triangle_caster
from aerialdojo_gen.rendering.lighting import Lighting
from aerialdojo_gen.rendering.shading import lit_in_haze
from aerialdojo_gen.scenes.colours import texel
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import HORIZON, Material, Part, Scene

_Table = Callable[[Material], NDArray[Any] | None]

# How many holes a ray passes through, and how far behind each it restarts, metres.
_MAX_HOLES, _ON_M = 12, 1e-3


class SurfaceTexels:
    """Looks up points on the triangles of parts."""

    def __init__(self, parts: Sequence[Part], materials: Mapping[str, Material]) -> None:
        names = sorted({part.material for part in parts})
        counts = [len(part.faces) for part in parts]
        self.materials = [materials[name] for name in names]
        self.material = np.repeat(np.array([names.index(p.material) for p in parts], dtype=np.int64), counts)
        self.vertices, self.faces = soup(parts)
        self.uv = np.concatenate([part.uv for part in parts]).astype(np.float64)
        self.has_vertex_colours = any(part.colours is not None for part in parts)
        if self.has_vertex_colours:
            means = (np.tile(np.array(materials[p.material].colour, np.uint8), (len(p.vertices), 1)) for p in parts)
            self._colours = np.concatenate(
                [mean if p.colours is None else p.colours for p, mean in zip(parts, means, strict=True)]
            )
            self._is_coloured = np.repeat([part.colours is not None for part in parts], counts)

    def barycentric(self, face: Int32s, points: Floats) -> Floats:
        """Weights (n, 3) of a face's corners at points (n, 3) on it."""
        index = self.faces[face]
        a, b, c = (self.vertices[index[:, k]] for k in range(3))
        ab, ac, ap = b - a, c - a, points - a
        d00, d01, d11 = (np.einsum("ij,ij->i", x, y) for x, y in ((ab, ab), (ab, ac), (ac, ac)))
        d20, d21 = np.einsum("ij,ij->i", ap, ab), np.einsum("ij,ij->i", ap, ac)
        area = np.maximum(d00 * d11 - d01 * d01, 1e-30)
        v, w = (d11 * d20 - d01 * d21) / area, (d00 * d21 - d01 * d20) / area
        return np.stack([1.0 - v - w, v, w], axis=1)

    def is_hole(self, face: Int32s, points: Floats) -> Flags:
        """Whether points (n, 3) on faces (n,) are masked out."""
        out = np.zeros(len(face), dtype=bool)
        self._sample(out, face, points, lambda material: None if material.mask is None else ~material.mask)
        return out

    def colours(self, face: Int32s, points: Floats, texture: _Table = lambda material: material.texture) -> Bytes:
        """Colours (n, 3) of points (n, 3) on faces (n,), by the nearest texel of each material's texture."""
        out = self.mean_colours(face)
        self._sample(out, face, points, texture)
        return self.with_vertex_colours(face, points, out)

    def mean_colours(self, face: Int32s) -> Bytes:
        """Mean colours (n, 3) of the materials of faces (n,)."""
        return np.array([m.colour for m in self.materials], dtype=np.uint8)[self.material[face]]

    def _sample(self, out: NDArray[Any], face: Int32s, points: Floats, table: _Table) -> None:
        """Write the texels of materials' tables at points on faces, where they have one."""
        material = self.material[face]
        for k in np.unique(material):
            texels = table(self.materials[k])
            if texels is not None:
                rows = np.flatnonzero(material == k)
                out[rows] = texels[texel(self.uv_at(face[rows], points[rows]), *texels.shape[:2])]

    def normals(self, face: Int32s) -> Floats:
        """Unit normals (n, 3) of faces (n,)."""
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30))

    def with_vertex_colours(self, face: Int32s, points: Floats, colours: NDArray[Any]) -> NDArray[Any]:
        """Replace colours (n, 3) by interpolated vertex colours where a part has them."""
        if not self.has_vertex_colours:
            return colours
        rows = np.flatnonzero(self._is_coloured[face])
        corners = self._colours[self.faces[face[rows]]].astype(float)
        mixed = np.einsum("nk,nkc->nc", self.barycentric(face[rows], points[rows]), corners)
        out = colours.copy()
        out[rows] = np.clip(np.rint(mixed), 0, 255)
        return out

    def uv_at(self, face: Int32s, points: Floats) -> Floats:
        """Texture coordinates (n, 2) of points (n, 3) on faces (n,)."""
        share, uv = self.barycentric(face, points), self.uv[self.faces[face]]
        return np.asarray(share[:, :1] * uv[:, 0] + share[:, 1:2] * uv[:, 1] + share[:, 2:] * uv[:, 2])


class MaskedRayCaster:
    """Casts rays through the masked-out parts of textures."""

    def __init__(self, caster: TriangleRayCaster, texels: SurfaceTexels) -> None:
        self._caster = caster
        self._texels = texels
        holed = np.array([m.mask is not None for m in texels.materials])
        self._holed = holed[texels.material]

    def first_hit(self, origins: Floats, directions: Floats) -> tuple[Floats, Int32s]:
        """Find the first opaque hits; see `aerialdojo_gen.geometry.rays.TriangleRayCaster.first_hit`."""
        distance, face = self._caster.first_hit(origins, directions)
        length = np.linalg.norm(directions, axis=1)
        origins = np.broadcast_to(origins, directions.shape)
        rows = np.flatnonzero(face >= 0)
        for _ in range(_MAX_HOLES):
            rows = rows[self._holed[face[rows]]]
            points = origins[rows] + (distance[rows] / length[rows])[:, None] * directions[rows]
            through = self._texels.is_hole(face[rows], points)
            rows, points = rows[through], points[through]
            if not len(rows):
                break
            on = points + _ON_M * directions[rows] / length[rows, None]
            further, face[rows] = self._caster.first_hit(on, directions[rows])
            distance[rows] += further + _ON_M
            rows = rows[face[rows] >= 0]
        return distance, face


def scene_texels(scene: Scene) -> SurfaceTexels:
    """Return the texture lookup of a scene's instances, in their order."""
    parts = [part for instance in scene.instances for part in instance.parts]
    return context_of(scene).part("texels", lambda: SurfaceTexels(parts, scene.materials))


def masked_caster(scene: Scene) -> TriangleRayCaster | MaskedRayCaster:
    """Return the scene's ray caster that respects alpha masks; the plain one if the scene has none."""
    whole = triangle_caster(scene)
    if all(material.mask is None for material in scene.materials.values()):
        return whole
    return MaskedRayCaster(whole, scene_texels(scene))


class Backdrop:
    """Paints what is behind a scene: sky domes as they are, and with a light the horizon too, lit."""

    def __init__(self, scene: Scene, light: Lighting | None = None) -> None:
        shown = [i for i in scene.backdrop if light is not None or i.surface != HORIZON]
        parts = [part for instance in shown for part in instance.parts]
        self._texels = SurfaceTexels(parts, scene.materials) if parts else None
        self._caster = TriangleRayCaster(*soup(parts)) if parts else None
        self._lit = np.repeat([i.surface == HORIZON for i in shown for _ in i.parts], [len(p.faces) for p in parts])
        self.light = light

    def paint(self, rgb: Bytes, missing: Flags, camera: Camera, world_from_camera: Floats) -> None:
        """Paint the backdrop into the `missing` pixels of a picture, in place."""
        if self._caster is None or self._texels is None or not missing.any():
            return
        rows, columns = np.nonzero(missing)
        directions = camera.rays().reshape(camera.height, camera.width, 3)[rows, columns]
        directions = directions @ world_from_camera[:3, :3].T
        eye = world_from_camera[:3, 3]
        distance, face = self._caster.first_hit(eye, directions)
        hit = np.flatnonzero(face >= 0)
        rows, columns, face, distance = rows[hit], columns[hit], face[hit], distance[hit]
        unit = directions[hit] / np.linalg.norm(directions[hit], axis=1)[:, None]
        colours = self._texels.colours(face, eye + distance[:, None] * unit).astype(np.float64)
        if self.light is not None:
            # Its textures are finer than a pixel almost everywhere: their mean stands for them.
            lit = self._lit[face]
            base, normal = self._texels.mean_colours(face[lit]).astype(np.float64), self._texels.normals(face[lit])
            colours[lit] = lit_in_haze(base, normal, unit[lit], distance[lit], self.light)
        rgb[rows, columns] = np.clip(colours + 0.5, 0.0, 255.0).astype(np.uint8)


def downscale(texture: Bytes, longest: int) -> Bytes:
    """Shrink a texture to at most `longest` pixels on its longer side."""
    height, width = texture.shape[:2]
    if max(height, width) <= longest:
        return texture
    scale = longest / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(texture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
