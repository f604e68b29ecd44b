"""A scene's triangles packed for OpenGL, and culled for every view.

A software rasteriser takes a third of a microsecond for a triangle, visible or not; culling a hundredth of that. So
a view draws only the triangles that face the camera, lie in its picture and cover a pixel's centre, nearest first,
so that hidden ones fail the depth test early.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Bytes, Floats, Ints, Singles
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.geometry.triangles import morton_codes
from aerialdojo_gen.rendering.gl_culling import CHUNK_TRIANGLES, visible_triangles
from aerialdojo_gen.rendering.lighting import is_fine, is_shiny, texel_m
from aerialdojo_gen.rendering.shading import MUTE, muted
from aerialdojo_gen.scenes.model import HORIZON, Instance, Material, Part, Scene
from aerialdojo_gen.scenes.noise import fractal, texture_rng
from aerialdojo_gen.scenes.textures_natural import NATURAL

_LARGEST_TEXTURE = 512
_FINE = "FINE"  # Tag of what has a texture larger than most
_MORTON_BITS = 16
# Cosine of the angle between two faces beyond which the edge between them is sharp: of land, of things, by material.
_LAND, _THINGS = 0.45, 0.7
_CREASES = dict.fromkeys(NATURAL, _LAND) | dict.fromkeys(("foliage", "needles", "hedge"), 1e-6)
# Materials whose pattern has no scale: they are drawn with grain at every distance.
_GRAINED = frozenset({*NATURAL, "asphalt", "hedge"})
_GRAIN_SPREAD, _GRAIN_MOST = 0.7, 11.0  # of the pattern's own, and of 255: from afar joints and stones are one tone
# What is drawn first hides most.
_ORDER: tuple[tuple[str, ...], ...] = (
    ("TEXTURED", _FINE), ("TEXTURED",), (), ("TEXTURED", _FINE, "SHINY"), ("TEXTURED", "SHINY"), ("SHINY",),
    ("TEXTURED", "NATURAL"), ("TEXTURED", "NATURAL", "SHINY"),
)  # fmt: skip

# Three vertices a triangle, none shared: normal, colour and instance are those of the face.
VERTEX = np.dtype([
    ("position", "<f4", 3), ("uv", "<f4", 2), ("normal", "<f4", 3), ("colour", "u1", 4), ("texel_m", "<f4"),
    ("layer", "<f4"), ("instance", "<f4"),
])  # fmt: skip


@dataclass(frozen=True, eq=False)
class Chunks:
    """Triangles of one kind of surface (with a texture, or without), cut into chunks."""

    vertices: NDArray[np.void]  # (3 n,) structured array of `VERTEX`; n triangles, chunk after chunk
    starts: Ints  # (k + 1,) int64; first triangle of every chunk; the last is n
    low: Floats  # (k, 3) float64; a chunk's box, metres, world frame
    high: Floats
    planes: Floats  # (k, 4 * 96) float64; a triangle faces the eye where ``normal . eye + d`` is positive
    corners: Singles  # (k, 9 * 96) float32

    def visible_indices(self, clips: Floats, eye: Floats, nearness: Singles, hides: bool) -> list[NDArray[np.uint32]]:
        """Vertex indices of every view of one eye, nearest first; what hides raises `nearness` (views, H, W)."""
        out = np.empty((len(clips), len(self.vertices)), np.uint32)
        counts = visible_triangles(
            self.starts, self.low, self.high, self.planes, self.corners, hides, clips, eye, nearness, out
        )
        return [row[:n] for row, n in zip(out, counts.tolist(), strict=True)]


@dataclass(frozen=True, eq=False)
class Kind:
    """Surfaces that one program draws, from one texture array."""

    chunks: Chunks
    tags: tuple[str, ...]  # Variant of the program (`aerialdojo_gen.rendering.gl_shaders.specialise`)
    layers: Bytes | None  # The layers of its texture array, first row at v = 0; None where it has none
    smooth: bool = False
    double_sided: bool = False  # Whether both sides are drawn

    @property
    def hides(self) -> bool:
        """Whether its triangles are occluders."""
        return "MASK" not in self.tags


def own_kinds(scene: Scene) -> list[Kind]:
    """Pack a scene's catalogue materials and its horizon by what draws them; two texture arrays by size serve all."""
    named = [(name, m) for name, m in sorted(scene.materials.items()) if m.texture is not None and not m.atlas]
    sizes: dict[bool, list[str]] = {fine: [name for name, m in named if is_fine(m) == fine] for fine in (False, True)}
    # What has grain has a layer of it behind its own.
    layer = {
        name: float(k + sum(one in _GRAINED for one in _bases(names[:k])))
        for names in sizes.values()
        for k, name in enumerate(names)
    }
    beyond = [instance for instance in scene.backdrop if instance.surface == HORIZON]
    drawn: list[tuple[Part, Material, int]] = []
    # Kinds of surfaces, and what is smooth together: parts of a thing with one crease.
    kinds, groups = {tags: k for k, tags in enumerate(_ORDER)}, {(-1, _LAND): 0}
    kind, group = [], []
    for k, instance in (*enumerate(scene.instances), *((-1, instance) for instance in beyond)):
        for part in instance.parts:
            material = scene.materials[part.material]
            if is_foreign(part, material):
                continue
            # Land of several materials is smooth across their seams. Buildings are flat: shallow roofs have a ridge.
            crease = _CREASES.get(part.material.split(":")[0], _THINGS if instance.shape else None)
            crease, tags = (crease, _tags(material)) if k >= 0 else (_LAND, (*_tags(material), "HORIZON"))
            drawn.append((part, material, k))
            kind.append(kinds.setdefault(tags, len(kinds)))
            group.append(-1 if crease is None else groups.setdefault((k, crease), len(groups)))
    rows, part_of = packed(drawn)
    textured = [material.texture is not None for _, material, _ in drawn]
    texels = [texel_m(m) if some else 0.0 for some, (_, m, _) in zip(textured, drawn, strict=True)]
    rows["texel_m"] = np.array(texels, np.float32)[part_of, None]
    own_layer = [layer[part.material] if some else 0.0 for some, (part, _, _) in zip(textured, drawn, strict=True)]
    rows["layer"] = np.array(own_layer, np.float32)[part_of, None]
    smooth(rows, np.array(group, np.int64)[part_of], np.array([crease for _, crease in groups]))
    layers = {fine: _layers(scene, names) for fine, names in sizes.items()}
    kind_of = np.array(kind, np.int64)[part_of]
    return [
        Kind(cut(rows[kind_of == k]), tags, layers[_FINE in tags] if "TEXTURED" in tags else None)
        for tags, k in kinds.items()
        if (kind_of == k).any()
    ]


def _tags(material: Material) -> tuple[str, ...]:
    """Variant of the program that draws a material of the catalogue."""
    tags: tuple[str, ...] = ()
    if material.texture is not None:
        tags = ("TEXTURED", "NATURAL") if material.name.split(":")[0] in _GRAINED else ("TEXTURED",)
        tags = (*tags, _FINE) if is_fine(material) else tags
    return (*tags, "SHINY") if is_shiny(material) else tags


def smooth(rows: NDArray[np.void], group: Ints, creases: Floats) -> None:
    """Give corners the mean normal of the faces about them that turn less than a crease from their own, in place.

    Rows (n, 3) of `VERTEX` belong to groups (n,), each with its crease; a group ends at its own corners, and rows of
    -1 stay flat.
    """
    points = np.ascontiguousarray(rows["position"]).view(np.uint32).reshape(-1, 3)
    normals = np.ascontiguousarray(rows["normal"]).reshape(-1, 3)
    rows["normal"] = _mean_normals(points, normals, np.repeat(group, 3), creases).reshape(-1, 3, 3)


@njit(cache=True)
def _mean_normals(points: NDArray[np.uint32], normal: Singles, group: Ints, creases: Floats) -> Singles:
    """Mean normals (n, 3) of corners, by the bits of their points."""
    found = normal.copy()
    size = 1024
    while size < 2 * len(points):
        size *= 2
    # A hash table of points; the corners of each in a chain, in their order.
    first, last = np.full(size, -1, np.int64), np.empty(size, np.int64)
    following = np.full(len(points), -1, np.int64)
    for i in range(len(points)):
        if group[i] < 0:
            continue
        key = np.uint64(group[i])
        for a in range(3):
            key = (key ^ np.uint64(points[i, a])) * np.uint64(0x9E3779B97F4A7C15)
            key ^= key >> np.uint64(29)
        slot = np.int64(key >> np.uint64(1)) & (size - 1)
        while first[slot] >= 0:
            k = first[slot]
            if group[k] == group[i] and (points[k] == points[i]).all():
                break
            slot = (slot + 1) & (size - 1)
        if first[slot] < 0:
            first[slot] = i
        else:
            following[last[slot]] = i
        last[slot] = i
    for start in first:
        i = int(start)
        while i >= 0:
            x = y = z = np.float32(0.0)
            j = start
            while j >= 0:
                dot = normal[i, 0] * normal[j, 0] + normal[i, 1] * normal[j, 1] + normal[i, 2] * normal[j, 2]
                if dot > creases[group[i]]:
                    x, y, z = x + normal[j, 0], y + normal[j, 1], z + normal[j, 2]
                j = following[j]
            length = max(np.sqrt(x * x + y * y + z * z), np.float32(1e-9))
            found[i, 0], found[i, 1], found[i, 2] = x / length, y / length, z / length
            i = following[i]
    return found


def is_foreign(part: Part, material: Material) -> bool:
    """Whether a part is drawn as one of an imported mesh."""
    return material.foreign or part.colours is not None


def packed(drawn: Sequence[tuple[Part, Material, int]]) -> tuple[NDArray[np.void], Ints]:
    """Pack the triangles of parts that have an area, (n, 3) of `VERTEX`, and say which part each is of, (n,).

    Parts come with their material and the number of their instance; texel and layer are left at 0.
    """
    if not drawn:
        return np.zeros((0, 3), dtype=VERTEX), np.zeros(0, np.int64)
    parts = [part for part, _, _ in drawn]
    vertices, faces = soup(parts)
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    solid = length > 0.0
    faces, part_of = faces[solid], np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])[solid]
    rows = np.zeros((len(faces), 3), dtype=VERTEX)
    rows["position"] = corners[solid]
    rows["uv"] = np.concatenate([part.uv for part in parts])[faces]
    rows["normal"] = (normal[solid] / length[solid, None])[:, None]
    tones = [np.array(m.colour) if m.unlit else muted(np.array(m.colour)) for _, m, _ in drawn]
    rows["colour"][..., :3] = np.array(tones)[part_of, None]
    ends, first = np.searchsorted(part_of, np.arange(len(parts) + 1)), 0
    for k, (part, material, _) in enumerate(drawn):
        if part.colours is not None:
            own = part.colours if material.unlit else muted(part.colours)
            rows["colour"][ends[k] : ends[k + 1], :, :3] = own[faces[ends[k] : ends[k + 1]] - first]
        first += len(part.vertices)
    rows["instance"] = np.array([k for _, _, k in drawn], np.float32)[part_of, None]
    return rows, part_of


def cut(triangles: NDArray[np.void], double_sided: bool = False) -> Chunks:
    """Cut packed triangles, at least one, into chunks; double-sided triangles face every eye."""
    corners = triangles["position"].astype(np.float64)
    # NumPy takes five times as long along an axis of three.
    low, high = (reduce(of, np.moveaxis(corners, 1, 0)) for of in (np.minimum, np.maximum))
    extent = (high - low).max(axis=1)
    # Separate large triangles from small ones, or every chunk's box would be as large as its largest triangle.
    size = np.floor(np.log2(np.maximum(extent, 1.0)) / 1.5).astype(np.int64)
    order = np.lexsort((morton_codes((low + high) / 2.0, _MORTON_BITS), size))
    triangles, corners = triangles[order], corners[order]
    starts = np.arange(0, len(triangles), CHUNK_TRIANGLES)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    planes = np.column_stack([normal, -np.einsum("ij,ij->i", normal, corners[:, 0])])
    if double_sided:
        planes[:] = 0.0, 0.0, 0.0, 1.0
    return Chunks(
        triangles.ravel(),
        np.append(starts, len(triangles)),
        np.minimum.reduceat(low[order], starts),
        np.maximum.reduceat(high[order], starts),
        _blocks(planes),
        _blocks(triangles["position"].reshape(-1, 9)),
    )


def _blocks(rows: NDArray[Any]) -> NDArray[Any]:
    """Lay triangles' rows out by chunk, field and triangle, for vectorised loops."""
    padded = np.pad(rows, ((0, -len(rows) % CHUNK_TRIANGLES), (0, 0)))
    blocks = padded.reshape(-1, CHUNK_TRIANGLES, rows.shape[1]).transpose(0, 2, 1)
    return np.ascontiguousarray(blocks).reshape(len(blocks), -1)


def _bases(names: list[str]) -> list[str]:
    return [name.split(":")[0] for name in names]


def _layers(scene: Scene, names: list[str]) -> Bytes | None:
    textures = [t for name in names if (t := scene.materials[name].texture) is not None]
    if not textures:
        return None
    largest = min(_LARGEST_TEXTURE, max(max(t.shape[:2]) for t in textures))
    edge = 1 << (largest - 1).bit_length()
    layers: list[Bytes] = []
    for texture, base in zip(textures, _bases(names), strict=True):
        larger = max(texture.shape[:2]) > edge
        sized = cv2.resize(texture[::-1], (edge, edge), interpolation=cv2.INTER_AREA if larger else cv2.INTER_NEAREST)
        layers.append(cv2.transform(sized, MUTE))
        if base in _GRAINED:
            mean = layers[-1].mean(axis=(0, 1))
            spread = np.minimum(_GRAIN_SPREAD * layers[-1].std(axis=(0, 1)), _GRAIN_MOST)
            layers.append(np.clip(mean + spread * _grain(edge)[..., None], 0, 255).astype(np.uint8))
    return np.stack(layers)


@lru_cache(maxsize=2)
def _grain(edge: int) -> Floats:
    """Noise without a scale, tileable: what a material shows from afar, where its own pattern would be too large."""
    return fractal(edge, 6, 6, texture_rng("grain"), 0.75)


# Fourth byte of the vertex colour of an unlit material.
_UNLIT = 255
_Key = tuple[int, int, bool, bool]


def foreign_kinds(scene: Scene) -> list[Kind]:
    """Pack the triangles that `own_kinds` leaves out."""
    return _foreign(scene.instances, scene.materials, True, ("FOREIGN",))


def backdrop_kinds(scene: Scene) -> list[Kind]:
    """Pack sky domes: all materials, both sides."""
    domes = [instance for instance in scene.backdrop if instance.surface != HORIZON]
    # No light falls on a dome: its colours stay as vivid as they are.
    unlit = {name: replace(material, unlit=True) for name, material in scene.materials.items()}
    return _foreign(domes, unlit, False, ("FOREIGN", "BACKDROP"))


def _foreign(
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
        _foreign_layers(list(layer.values()), key) if key[0] else None,
        smooth=True,
        double_sided=key[3],
    )


def _size(material: Material) -> tuple[int, int]:
    """Height and width of the layer that a texture gets: powers of two, so that few sizes serve all."""
    if material.texture is None:
        return 0, 0
    height, width = material.texture.shape[:2]
    return 1 << (height - 1).bit_length(), 1 << (width - 1).bit_length()


def _foreign_layers(materials: list[Material], key: _Key) -> Bytes:
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
