"""The scene in memory: named instances made of parts, each part of one material.

World frame: right-handed, x east, y north, z up, metres.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.light import Light, Weather

# Land beyond the flight volume: drawn, and nothing else.
HORIZON = "horizon"
# Closed body; open sheet, solid from both sides; open ground, below which no body flies; sky; land beyond.
SURFACES = ("solid", "sheet", "ground", "dome", HORIZON)
BACKDROPS = ("dome", HORIZON)


@dataclass(frozen=True, eq=False)
class Material:
    """A surface: a colour, a small tileable texture, or a picture that came with a foreign mesh."""

    name: str  # Unique in a scene, e.g. ``"brick:#9a4a3c"``
    colour: tuple[int, int, int]  # sRGB, 0-255; for a textured material the texture's mean colour
    texture: NDArray[np.uint8] | None = None  # sRGB tile, repeated over the surface; row 0 is the top (v = 1)
    tile_m: float = 1.0  # Edge of one texture tile in metres; UVs are metres divided by it
    mask: NDArray[np.bool_] | None = None  # Opaque texels, of the texture's size; None for all
    atlas: bool = False
    double_sided: bool = False  # Whether its triangles are visible from both sides
    unlit: bool = False
    jpeg: bytes = b""

    @property
    def foreign(self) -> bool:
        """Whether it has properties that only imported materials have."""
        return self.atlas or self.double_sided or self.unlit or self.mask is not None


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material."""

    vertices: NDArray[np.float64]  # (n, 3) float64
    faces: NDArray[np.int32]  # (m, 3) int32; indices into `vertices`, counter-clockwise seen from outside
    uv: NDArray[np.float32]  # (n, 2) float32; texture coordinates in tiles (metres / `Material.tile_m`)
    material: str  # Name of a `Material` of the scene
    colours: NDArray[np.uint8] | None = None  # (n, 3) uint8 or None


@dataclass(frozen=True, eq=False)
class Instance:
    """A named object of the scene, in world coordinates."""

    node: str  # Unique in the scene and stable between builds, e.g. ``"delivery_van_003"``
    category: str
    variant: str  # Name of the catalogue's variant, empty if it has none
    attributes: dict[str, str]  # For descriptions, e.g. ``{"colour": "red", "state": "open"}``
    parts: tuple[Part, ...]  # At least one, none of them empty
    anatomy: Anatomy | None = None  # Its fronts and named parts, if its catalogue has them
    surface: str = ""
    shape: str = ""  # Digest of its geometry in its own frame: congruent things have the same; empty if none is known
    held_out: bool = False  # Whether its design stands in no scene of the training side

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
        copies = self.copies_of(name)
        return np.unique(np.concatenate(copies)) if copies else np.zeros(0, np.int64)

    def copies_of(self, name: str) -> list[NDArray[np.int64]]:
        """Indices (k,) into `faces` of every copy of a named part, or of several; empty where it has none."""
        offsets, out = np.cumsum([0, *self.face_counts]), []
        runs = {} if self.anatomy is None else self.anatomy.runs
        for run in (run for one in name.split("|") for run in runs.get(one, ())):
            start = int(offsets[run.part]) + run.first
            out += [np.arange(start + k * run.faces, start + (k + 1) * run.faces) for k in range(run.copies)]
        return out

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
    """A whole scene."""

    name: str  # E.g. ``"U_Mall_0"``
    instances: tuple[Instance, ...]  # In a stable order; node names are unique
    materials: dict[str, Material]  # By name; every part's material is here
    bounds: NDArray[np.float64]  # (2, 3) float64
    sky: tuple[int, int, int] = (150, 190, 230)  # sRGB of the sky, 0-255
    sun: tuple[float, float, float] = (0.45, -0.35, 0.82)  # Unit vector from the scene towards the sun, world frame
    weather: Weather = "clear"
    imported: bool = False  # Whether it is an imported mesh, with categories of its own
    backdrop: tuple[Instance, ...] = ()
    attribution: str = ""  # Source and licence of imported data
    _by_node: dict[str, Instance] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Index the instances; ValueError for a duplicate node name."""
        for instance in (*self.instances, *self.backdrop):
            if instance.node in self._by_node:
                raise ValueError(f"scene {self.name}: duplicate node {instance.node!r}")
            self._by_node[instance.node] = instance
        for instance in self.backdrop:
            del self._by_node[instance.node]

    @property
    def light(self) -> Light:
        """The scene's own light."""
        return Light(self.sun, self.weather)

    @property
    def ceiling_m(self) -> float:
        """Highest z that a drone may fly at, metres."""
        return float(self.bounds[1, 2])

    @property
    def n_triangles(self) -> int:
        """Number of triangles of all instances."""
        return sum(len(p.faces) for i in self.instances for p in i.parts)

    def __contains__(self, node: object) -> bool:
        """Whether the scene has an instance of that node name."""
        return node in self._by_node

    def __getitem__(self, node: str) -> Instance:
        """Look an instance up by its node name; KeyError where there is none."""
        return self._by_node[node]


# Directions of a category's fronts in its own frame, degrees counter-clockwise from +x.
FRONTS: Mapping[str, tuple[float, ...]] = {
    "none": (), "+x": (0.0,), "-x": (180.0,), "+y": (90.0,), "-y": (-90.0,), "x": (0.0, 180.0), "y": (90.0, -90.0),
}  # fmt: skip
_MAX_RUNS = 100_000


@dataclass(frozen=True)
class Run:
    """Consecutive faces of one part."""

    part: int  # Index into the instance's parts (a part is what has one material)
    first: int  # First face in that part and number of faces, of the first copy
    faces: int
    copies: int = 1  # Consecutive copies of as many faces each


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Named parts and fronts of an instance, from its catalogue."""

    yaw_rad: float  # Direction of its own +x, world frame
    fronts_rad: tuple[float, ...]
    identifying_parts: tuple[str, ...]
    runs: Mapping[str, tuple[Run, ...]]  # The faces of every named part; a name is a tag or a role of the catalogue

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON, as stored in a scene file."""
        runs = {name: [[r.part, r.first, r.faces, r.copies] for r in members] for name, members in self.runs.items()}
        return {
            "yaw_rad": self.yaw_rad,
            "fronts_rad": list(self.fronts_rad),
            "tells": list(self.identifying_parts),
            "parts": runs,
        }


def parse_anatomy(raw: Any, counts: Sequence[int]) -> Anatomy:
    """Parse `Anatomy.to_json`; ValueError where it is malformed."""
    runs = {}
    total = 0
    for name, members in raw["parts"].items():
        found = []
        for part, first, faces, copies in members:
            if any(type(n) is not int for n in (part, first, faces, copies)) or min(part, first) < 0:
                raise ValueError("a run of faces is malformed")
            if faces < 1 or copies < 1 or part >= len(counts) or first + faces * copies > counts[part]:
                raise ValueError("a run goes beyond the part's faces")
            found.append(Run(part, first, faces, copies))
        total += len(found)
        runs[name] = tuple(found)
    if total > _MAX_RUNS:
        raise ValueError("too many runs of faces")
    angles = [raw["yaw_rad"], *raw["fronts_rad"]]
    if not all(type(a) in (int, float) and math.isfinite(a) for a in angles):
        raise ValueError("a direction is no finite number")
    if not all(isinstance(text, str) for text in raw["tells"]):
        raise ValueError("an identifying part must be text")
    return Anatomy(float(angles[0]), tuple(float(a) for a in angles[1:]), tuple(raw["tells"]), runs)


def remap_runs(runs: Mapping[str, Iterable[Run]], kept: Sequence[NDArray[np.bool_]]) -> dict[str, tuple[Run, ...]]:
    """Remap runs of faces after dropping the faces that are not `kept`; empty copies are dropped."""
    if all(k.all() for k in kept):
        return {name: tuple(members) for name, members in runs.items()}
    before = [np.concatenate([[0], np.cumsum(k)]) for k in kept]
    place = np.cumsum([0, *(bool(k.any()) for k in kept)])
    out = {}
    for name, members in runs.items():
        left = []
        for run in members:
            at = before[run.part]
            ends = [(run.first + k * run.faces, run.first + (k + 1) * run.faces) for k in range(run.copies)]
            spans = [(int(at[a]), int(at[b])) for a, b in ends]
            left += [Run(int(place[run.part]), a, b - a) for a, b in spans if b > a]
        if left:
            out[name] = tuple(left)
    return out


def turned(scene: Scene, turn_deg: int) -> Scene:
    """Turn a scene counter-clockwise by a multiple of 90°; the sun stays where it is."""
    for _ in range(turn_deg // 90 % 4):
        scene = _quarter(scene)
    return scene


def _quarter(scene: Scene) -> Scene:
    low, high = scene.bounds
    bounds = scene.bounds.copy()
    bounds[:, 0], bounds[:, 1] = (-high[1], -low[1]), (low[0], high[0])
    return replace(
        scene,
        bounds=bounds,
        instances=tuple(map(_thing, scene.instances)),
        backdrop=tuple(map(_thing, scene.backdrop)),
    )


def _thing(thing: Instance) -> Instance:
    parts = tuple(
        replace(part, vertices=np.column_stack([-part.vertices[:, 1], part.vertices[:, 0], part.vertices[:, 2]]))
        for part in thing.parts
    )
    anatomy = thing.anatomy
    if anatomy is not None:
        yaw, *fronts = wrap_angle_rad(np.array([anatomy.yaw_rad, *anatomy.fronts_rad]) + math.pi / 2).tolist()
        anatomy = replace(anatomy, yaw_rad=yaw, fronts_rad=tuple(fronts))
    return replace(thing, parts=parts, anatomy=anatomy)
