"""A small town to fly in, and checks of routes that share nothing with the planner."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import trimesh
from support.handmade import box, instance, mesh_of, scene

from aerialdojo_gen.base.config.sections import PlanConfig, SearchAttempt
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.scenes.model import Scene

# Metres alone, the fewest there are: the control that preferences are seen against.
METRES = PlanConfig(
    clearance_weight=0.0,
    max_approach_angle_deg=180.0,
    ladder=(SearchAttempt(weight=1.05, budget=20_000, tolerance_growth_m=0.0),),
)


def turned(mesh: trimesh.Trimesh, angle: float, at: tuple[float, float, float]) -> trimesh.Trimesh:
    mesh.apply_transform(trimesh.transformations.rotation_matrix(angle, [0, 0, 1]))
    mesh.apply_translation(at)
    return mesh


def town(half: float = 18.0, ceiling: float = 12.0, n: int = 26, seed: int = 3) -> Scene:
    """Houses at any angle, trees, and roofs on posts; the middle is a crossing walled on two sides."""
    rng = np.random.default_rng(seed)
    things = []
    for k in range(n):
        x, y = rng.uniform(-half + 2, half - 2, 2)
        if k % 3 == 0:
            size = rng.uniform([2, 2, 3], [6, 5, 9])
            mesh = turned(trimesh.creation.box(extents=size), rng.uniform(0, 3), (x, y, size[2] / 2))
        elif k % 3 == 1:
            trunk = trimesh.creation.cylinder(0.15, 4.0, sections=8).apply_translation([0, 0, 2.0])
            crown = trimesh.creation.icosphere(2, rng.uniform(0.8, 1.8)).apply_translation([0, 0, 4.5])
            mesh = turned(trimesh.util.concatenate([trunk, crown]), 0.0, (x, y, 0.0))
        else:
            posts = [box((a - 0.1, b - 0.1, 0), (a + 0.1, b + 0.1, 2.5)) for a in (-2, 2) for b in (-1.5, 1.5)]
            mesh = turned(
                trimesh.util.concatenate([*posts, box((-2.5, -2, 2.5), (2.5, 2, 2.7))]),
                rng.uniform(0, 3),
                (x, y, 0.0),
            )
        things.append(instance(f"thing_{k:02d}", mesh))
    return scene(*things, half=half, ceiling=ceiling)


def solid(world: Scene) -> trimesh.Trimesh:
    """All surfaces of a scene as one mesh, for trimesh's own distance queries."""
    return trimesh.util.concatenate([mesh_of(i) for i in world.instances])


def distances(mesh: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Exact distances to the surface, by trimesh."""
    return trimesh.proximity.closest_point(mesh, points)[1]


def along(points: np.ndarray, spacing: float) -> np.ndarray:
    """Points of a polyline no further apart than `spacing`, corners included."""
    pieces = [points[:1]]
    for p, q in pairwise(points):
        n = max(1, int(np.ceil(np.linalg.norm(q - p) / spacing)))
        pieces.append(p + (q - p) * (np.arange(1, n + 1) / n)[:, None])
    return np.concatenate(pieces)


def free_poses(grid: ClearanceGrid, rng: np.random.Generator, n: int, room_m: float = 0.4) -> list[np.ndarray]:
    """Draw poses up to 7 m high that have some room and are connected with the sky."""
    low, high = grid.arrays.lower, np.minimum(grid.arrays.upper, [np.inf, np.inf, 7.0])
    found: list[np.ndarray] = []
    while len(found) < n:
        pose = rng.uniform([*low, -np.pi], [*high, np.pi])
        if grid.distance_m(pose[:3]) > room_m and grid.reachable(pose[:3]):
            found.append(pose)
    return found
