"""The shape of scenes, written from their meshes alone: point clouds and occupancy grids, a file a scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.exchange.folder import write_json
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.planning.occupancy import Occupancy
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene

# About a gigabyte.
MAX_POINTS = 50_000_000
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1"), ("instance", "<i4")]
)
_PLY = {"<f4": "float", "|u1": "uchar", "<i4": "int"}


def sample_surface(scene: Scene, points_per_m2: float) -> NDArray[np.void]:
    """Draw `POINT`s (world metres, sRGB) from all surfaces but the backdrop, each instance by a stream of its own."""
    expected = points_per_m2 * float(_areas(*soup(scene.instances)).sum()) if scene.instances else 0.0
    if expected > MAX_POINTS:
        raise UsageError(
            f"{scene.name}: {expected:,.0f} points are more than {MAX_POINTS:,}: choose a smaller --points-per-m2"
        )
    parts = [_sample(scene, k, points_per_m2) for k in range(len(scene.instances))]
    return np.concatenate([np.empty(0, POINT), *parts])


def _areas(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0)


def _sample(scene: Scene, number: int, points_per_m2: float) -> NDArray[np.void]:
    instance: Instance = scene.instances[number]
    draw = rng.generator(0, "point cloud", scene.name, instance.node)
    ends = np.cumsum(_areas(instance.vertices, instance.faces))
    # What is left of a point is one by chance: small things are not without points on the average.
    n = int(ends[-1] * points_per_m2 + draw.random())
    points = np.zeros(n, POINT)
    points["instance"] = number + 1
    # A point in every n-th of the area, and the golden ratio across it: more even than chance.
    at = (np.arange(n) + draw.random(n)) * (ends[-1] / max(n, 1))
    face = np.minimum(np.searchsorted(ends, at, side="right"), len(ends) - 1)
    begins = np.concatenate([[0.0], ends[:-1]])[face]
    along = np.sqrt(np.clip((at - begins) / (ends[face] - begins), 0.0, 1.0))
    across = (np.arange(n) * _GOLDEN + draw.random()) % 1.0
    weights = np.stack([1.0 - along, along * (1.0 - across), along * across], axis=1)
    place = np.einsum("nk,nka->na", weights, instance.vertices[instance.faces[face]])
    points["x"], points["y"], points["z"] = place.T
    first = 0
    for part in instance.parts:
        rows = np.flatnonzero((face >= first) & (face < first + len(part.faces)))
        colours = _colours(part, scene.materials[part.material], face[rows] - first, weights[rows])
        points["red"][rows], points["green"][rows], points["blue"][rows] = colours.T
        first += len(part.faces)
    return points


def _colours(
    part: Part, material: Material, face: NDArray[np.int64], weights: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """Colours (n, 3) uint8, sRGB, at points of a part's faces."""
    plain = np.broadcast_to(np.array(material.colour, np.uint8), (len(face), 3))
    if material.texture is None:
        if part.colours is None:
            return plain
        mixed = np.einsum("nk,nkc->nc", weights, part.colours[part.faces[face]].astype(np.float64))
        return np.asarray(np.rint(mixed).astype(np.uint8))
    height, width = material.texture.shape[:2]
    u, v = np.einsum("nk,nka->an", weights, part.uv[part.faces[face]].astype(np.float64))
    # A texture repeats; its first row is the top.
    column = np.floor(u % 1.0 * width).astype(np.int64) % width
    row = height - 1 - np.floor(v % 1.0 * height).astype(np.int64) % height
    found = material.texture[row, column]
    return found if material.mask is None else np.where(material.mask[row, column, None], found, plain)


# A cell takes up to some 25 bytes while they are computed.
_MAX_CELLS = 100_000_000


def write_points(scene: Scene, stem: Path, points_per_m2: float) -> dict[str, int]:
    """Write a scene's point cloud, and the nodes that its instances are."""
    points = sample_surface(scene, points_per_m2)
    about = f"{scene.name}: x east, y north, z up, metres; instance k is node k - 1 of the mesh"
    fields = [f"property {_PLY[POINT[name].str]} {name}" for name in POINT.names or ()]
    head = ["ply", "format binary_little_endian 1.0", f"comment {about}", f"element vertex {len(points)}", *fields]
    stem.with_name(f"{stem.name}.ply").write_bytes("\n".join([*head, "end_header\n"]).encode() + points.tobytes())
    write_json(stem.with_name(f"{stem.name}.nodes.json"), {"nodes": [one.node for one in scene.instances]})
    return {"points": len(points)}


def write_occupancy(scene: Scene, stem: Path, voxel_m: float) -> dict[str, int]:
    """Write a scene's occupancy grid."""
    cells = int(np.prod(np.ceil((scene.bounds[1] - scene.bounds[0]) / voxel_m)))
    if cells > _MAX_CELLS:
        raise UsageError(f"{scene.name}: {cells:,} voxels are more than {_MAX_CELLS:,}: choose a larger --voxel-m")
    grid = Occupancy.of(scene, voxel_m)
    np.savez_compressed(
        stem.with_name(f"{stem.name}.npz"), occupied=grid.occupied, reachable=grid.reachable,
        origin_m=grid.origin_m, voxel_m=np.float64(grid.voxel_m),
    )  # fmt: skip
    return {"voxels": grid.occupied.size, "occupied": int(grid.occupied.sum())}
