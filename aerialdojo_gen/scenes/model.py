"""The scene in memory: named instances made of parts, each part of one material.

World frame: right-handed, x east, y north, z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.anatomy import Anatomy

# Closed; open and there from both sides; open and the ground, which nobody flies below; behind everything.
SURFACES = ("solid", "sheet", "ground", "dome")


@dataclass(frozen=True, eq=False)
class Material:
    """A surface: a colour, a small tileable texture, or a picture that came with a foreign mesh.

    Attributes
    ----------
    name : str
        Unique in a scene, e.g. ``"brick:#9a4a3c"``.
    colour : tuple of int
        sRGB, 0-255; for a textured material the texture's mean colour.
    texture : (H, W, 3) uint8 or None
        sRGB tile, repeated over the surface; row 0 is the top (v = 1).
    tile_m : float
        Edge of one texture tile in metres; UVs are metres divided by it.
    mask : (H, W) bool or None
        Where the texture is there, of its size; None where it is everywhere.
    atlas : bool
        Whether the texture is a foreign mesh's own, in which a place stands for a place of the surface: it is drawn
        at every distance, where a tileable one fades into its mean. `tile_m` is then its width at its mean scale.
        So is one without a texture, whose parts have vertex colours.
    double_sided : bool
        Whether its triangles are there from both sides; else from the front alone.
    unlit : bool
        Whether its colours have their light in them, as those of a photograph have, and are drawn as they are.
    jpeg : bytes
        The texture's file, where that is a JPEG: it is stored as it is. Empty where the texture is stored as PNG.
    """

    name: str
    colour: tuple[int, int, int]
    texture: NDArray[np.uint8] | None = None
    tile_m: float = 1.0
    mask: NDArray[np.bool_] | None = None
    atlas: bool = False
    double_sided: bool = False
    unlit: bool = False
    jpeg: bytes = b""

    @property
    def foreign(self) -> bool:
        """Whether it is drawn as only a foreign mesh's materials are."""
        return self.atlas or self.double_sided or self.unlit or self.mask is not None


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material.

    Attributes
    ----------
    vertices : (n, 3) float64
        Metres; the frame is the owner's (a prop's own frame, or the world for an `Instance`).
    faces : (m, 3) int32
        Indices into `vertices`, counter-clockwise seen from outside.
    uv : (n, 2) float32
        Texture coordinates in tiles (metres / `Material.tile_m`).
    material : str
        Name of a `Material` of the scene.
    colours : (n, 3) uint8 or None
        sRGB of the vertices, in place of the material's colour; None where that counts.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    uv: NDArray[np.float32]
    material: str
    colours: NDArray[np.uint8] | None = None


@dataclass(frozen=True, eq=False)
class Instance:
    """A named thing that stands in the scene, in world coordinates.

    Attributes
    ----------
    node : str
        Unique in the scene and stable between builds, e.g. ``"delivery_van_003"``.
    category : str
        Category of the catalogue (``"delivery_van"``) or of the structure (``"ground"``, ``"mall_building"``).
    variant : str
        Name of the catalogue's variant, empty if it has none.
    attributes : dict of str to str
        What a description may speak of, e.g. ``{"colour": "red", "state": "open"}``.
    parts : tuple of Part
        At least one, none of them empty.
    anatomy : Anatomy or None
        Its fronts and named parts, where its catalogue says them.
    surface : str
        What its surface is, one of `SURFACES`, where ``add-scene`` has decided it; empty where form alone tells.
    """

    node: str
    category: str
    variant: str
    attributes: dict[str, str]
    parts: tuple[Part, ...]
    anatomy: Anatomy | None = None
    surface: str = ""

    @property
    def vertices(self) -> NDArray[np.float64]:
        """Vertices of all parts, (n, 3) float64, metres, world frame."""
        return self._soup[0]

    @property
    def faces(self) -> NDArray[np.int32]:
        """Faces of all parts, (m, 3) int32, indices into `vertices`."""
        return self._soup[1]

    def faces_of(self, name: str) -> NDArray[np.int64]:
        """Indices into `faces` of a named part, or of several, ``"a|b"``; empty where it has none."""
        return np.zeros(0, np.int64) if self.anatomy is None else self.anatomy.faces(name, self.face_counts)

    def copies_of(self, name: str) -> list[NDArray[np.int64]]:
        """Indices into `faces` of every copy of a named part; empty where it has none."""
        return [] if self.anatomy is None else self.anatomy.copies(name, self.face_counts)

    @property
    def face_counts(self) -> list[int]:
        """Number of faces of each of its parts."""
        return [len(part.faces) for part in self.parts]

    @cached_property
    def _soup(self) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        return soup(self.parts)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Axis-aligned box, (2, 3) float64, metres, world frame: lower corner, upper corner."""
        v = self.vertices
        return np.stack([v.min(axis=0), v.max(axis=0)])

    @cached_property
    def centroid(self) -> NDArray[np.float64]:
        """Centre of the axis-aligned box, (3,) float64, metres, world frame."""
        return self.bounds.mean(axis=0)


@dataclass(frozen=True, eq=False)
class Scene:
    """A whole scene.

    Attributes
    ----------
    name : str
        E.g. ``"U_Mall_0"``.
    instances : tuple of Instance
        In a stable order; node names are unique.
    materials : dict of str to Material
        By name; every part's material is here.
    bounds : (2, 3) float64
        The volume that a drone may fly in: lower corner (x, y, ground), upper corner (x, y, ceiling), metres.
    sky : tuple of int
        sRGB of the sky, 0-255.
    sun : tuple of float
        Unit vector from the scene towards the sun, world frame.
    imported : bool
        Whether it comes from a mesh of another make, whose categories are its own.
    backdrop : tuple of Instance
        Sky domes and the like: drawn behind everything, and nowhere else there, neither for rays nor for collision.
    attribution : str
        Whose data it is made of, and under which licence; empty for what is this program's own.
    """

    name: str
    instances: tuple[Instance, ...]
    materials: dict[str, Material]
    bounds: NDArray[np.float64]
    sky: tuple[int, int, int] = (150, 190, 230)
    sun: tuple[float, float, float] = (0.45, -0.35, 0.82)
    imported: bool = False
    backdrop: tuple[Instance, ...] = ()
    attribution: str = ""
    _by_node: dict[str, Instance] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Index the instances and refuse a node name that stands twice."""
        for instance in (*self.instances, *self.backdrop):
            if instance.node in self._by_node:
                raise ValueError(f"scene {self.name}: node {instance.node!r} stands twice")
            self._by_node[instance.node] = instance
        for instance in self.backdrop:
            del self._by_node[instance.node]

    @property
    def ceiling_m(self) -> float:
        """Highest z that a drone may fly at, metres."""
        return float(self.bounds[1, 2])

    @property
    def n_triangles(self) -> int:
        """Number of triangles of all instances."""
        return sum(len(p.faces) for i in self.instances for p in i.parts)

    def __contains__(self, node: object) -> bool:
        """Whether an instance of that node name stands in the scene."""
        return node in self._by_node

    def __getitem__(self, node: str) -> Instance:
        """Look an instance up by its node name; KeyError where there is none."""
        return self._by_node[node]
