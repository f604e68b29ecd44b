"""The grid promises nothing that surfaces do not keep: around its bounds, and for a body of any width."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import distances
from support.handmade import box, instance

from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.connectivity import MOVES, N_HALF
from aerialdojo_gen.planning.distance_field import build_distance_field
from aerialdojo_gen.scenes.model import Material, Scene

CELL = 0.5
SHAPE = (14, 10, 8)


def centres(low: np.ndarray) -> np.ndarray:
    return low + (np.stack(np.meshgrid(*(np.arange(n) for n in SHAPE), indexing="ij"), -1) + 0.5) * CELL


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.floats(0.05, 3.0))
def test_the_field_is_a_lower_bound_with_surfaces_all_around(seed, n, size_m):
    rng = np.random.default_rng(seed)
    low = rng.uniform(-3, 3, 3)
    high = low + np.array(SHAPE) * CELL
    corner = rng.uniform(low - 6.0, high + 6.0, (n, 1, 3))
    triangles = corner + rng.normal(0.0, size_m, (n, 3, 3))
    field = build_distance_field(triangles.reshape(-1, 9), low, SHAPE, CELL, 1.0, 5.0)
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)
    true = distances(mesh, centres(low).reshape(-1, 3)).reshape(SHAPE)
    assert (field <= np.minimum(true, 5.0)).all()
    # And not a needlessly low one.
    assert (np.minimum(true, 5.0) - field).max() < 3**0.5 * CELL + 1e-4


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_wall_just_outside_is_known_inside(axis, side):
    away = 1.1
    low, high = np.zeros(3), np.array(SHAPE) * CELL
    at = high[axis] + away if side > 0 else -away
    others = [k for k in range(3) if k != axis]
    corners = np.full((4, 3), at)
    for corner, (u, v) in zip(corners, ((-9, -9), (20, -9), (20, 20), (-9, 20)), strict=True):
        corner[others] = u, v
    triangles = np.stack([corners[[0, 1, 2]], corners[[0, 2, 3]]]).reshape(-1, 9)
    field = build_distance_field(triangles, low, SHAPE, CELL, 1.0, 5.0)
    true = np.abs(centres(low)[..., axis] - at)
    assert true.min() == pytest.approx(1.35)
    assert (field <= np.minimum(true, 5.0)).all()


def grove(seed: int, cell_m: float = 0.5, thick_m: float = 0.04) -> Scene:
    """Thin poles on a small ground, about midway between the centres of cells, where nobody flies but diagonally."""
    rng = np.random.default_rng(seed)
    places = -4 + cell_m * rng.integers(1, int(8 / cell_m) - 1, (24, 2)) + rng.uniform(-0.05, 0.05, (24, 2))
    poles = [
        instance(f"pole_{k}", box((x - thick_m / 2, y - thick_m / 2, 0), (x + thick_m / 2, y + thick_m / 2, 4)))
        for k, (x, y) in enumerate(places)
    ]
    floor = instance("ground", box((-6, -6, -0.5), (6, 6, 0)))
    materials = {"grey": Material("grey", (128, 128, 128))}
    return Scene("U_Grove_0", (floor, *poles), materials, np.array([[-4.0, -4, 0], [4, 4, 3]]))


@pytest.mark.parametrize(("radius_m", "cell_m"), [(0.2, 0.5), (0.25, 0.5), (0.1, 0.5), (0.25, 1.0), (0.25, 1.6)])
def test_no_move_that_the_grid_lets_pass_meets_a_pole(radius_m, cell_m):
    collisions, moves = 0, 0
    for seed in range(2):
        scene = grove(seed, cell_m)
        grid, world = ClearanceGrid.build(scene, cell_m=cell_m, radius_m=radius_m), CollisionWorld(scene)
        for cell in np.argwhere(grid.moves):
            bits = int(grid.moves[tuple(cell)])
            p = grid.arrays.origin + (cell + 0.5) * cell_m
            for m in (m for m in range(N_HALF) if bits >> m & 1):
                moves += 1
                collisions += world.segment_in_collision(p, p + MOVES[m] * cell_m, radius_m - 1e-6)
    assert moves > 200
    assert collisions == 0
