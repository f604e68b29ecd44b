"""The clearance grid, FCL and trimesh agree on what is near; the grid promises nothing that surfaces do not keep."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import distances, solid, town
from support.handmade import box, instance, scene

from aerialdojo_gen.geometry.triangles import segment_triangle_d2, split_triangles
from aerialdojo_gen.planning.bvh import LEAF, build_bvh
from aerialdojo_gen.planning.bvh_groups import group_boxes, segment_blocker
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.connectivity import MOVES, N_HALF
from aerialdojo_gen.planning.distance_field import build_distance_field
from aerialdojo_gen.planning.grid_kernels import polyline_clearance, segment_free
from aerialdojo_gen.scenes.model import Material, Scene

WORLD = town()
GRID = ClearanceGrid.build(WORLD)
FCL = CollisionWorld(WORLD)
MESH = solid(WORLD)
LOW, HIGH = [-17.7, -17.7, 0.3], [17.7, 17.7, 11.7]


def random_segments(n, seed, longest=5.0):
    """Segments in the town, every tenth one straight up or down, and every other tenth none but a point."""
    rng = np.random.default_rng(seed)
    p = rng.uniform(LOW, HIGH, (n, 3))
    u = rng.normal(size=(n, 3)) * [1, 1, 0.4]
    u[::10, :2] = 0.0
    u *= rng.uniform(0.2, longest, (n, 1)) / np.linalg.norm(u, axis=1, keepdims=True)
    u[5::10] = 0.0
    return p, np.clip(p + u, LOW, HIGH)


def test_distances_and_balls_agree_with_trimesh():
    rng = np.random.default_rng(4)
    points, radii = rng.uniform([-17, -17, 0.1], [17, 17, 11], (400, 3)), rng.uniform(0.05, 2.0, 400)
    true = distances(MESH, points)
    assert np.abs(GRID.distance_m(points) - np.minimum(true, GRID.cap_m)).max() < 1e-9
    assert np.abs([FCL.distance_m(p) for p in points] - true).max() < 1e-5
    touching = [FCL.sphere_in_collision(p, radius) for p, radius in zip(points, radii, strict=True)]
    assert (touching == (true < radii))[np.abs(true - radii) > 1e-4].all()


@pytest.mark.parametrize(
    ("radius", "n"), [(0.25, 3000), (0.8, 3000), pytest.param(0.25, 200_000, marks=pytest.mark.nightly)]
)
def test_grid_with_triangles_agrees_with_fcl_and_never_proves_free_what_fcl_refuses(radius, n):
    p, q = random_segments(n, 3)
    free, proven, fcl = np.array([
        [*(segment_free(*a, *b, radius, GRID.arrays, prove) for prove in (False, True)),
         FCL.segment_in_collision(a, b, radius)]
        for a, b in zip(p, q, strict=True)
    ]).T  # fmt: skip
    assert 0.1 < fcl.mean() < 0.9
    assert (free != fcl).all()
    assert 0.2 < proven.mean() < 0.95
    assert not (proven & fcl).any()


def test_a_sweep_is_all_points_of_its_way():
    """It collides exactly when a ball of it does, and its clearance is that of its nearest point."""
    for longest in (5.0, 12.0):
        for a, b in zip(*random_segments(20, 5, longest), strict=True):
            spacing = np.linalg.norm(b - a) / 100
            least = distances(MESH, a + np.linspace(0, 1, 101)[:, None] * (b - a)).min()
            clearance = polyline_clearance(np.stack([a, b]), 5.0, GRID.arrays)
            assert clearance - 1e-9 <= min(least, 5.0) <= clearance + spacing / 2 + 1e-9
            if least < 0.25 - 1e-4 or least > 0.25 + spacing / 2 + 1e-4:
                assert FCL.segment_in_collision(a, b, 0.25) == (least < 0.25)


def test_a_route_collides_when_any_leg_does():
    world = CollisionWorld(scene(instance("wall", box((-5, -0.1, 0), (5, 0.1, 3)))))
    over = [(0, -2, 1), (0, -2, 4), (0, 2, 4), (0, 2, 1)]
    assert not world.route_in_collision(over, 0.25)
    assert world.route_in_collision([over[0], over[3]], 0.25)
    assert world.route_in_collision([(0, 0, 1)], 0.25)


def test_points_in_solids_sealed_rooms_and_at_the_bounds_do_not_reach_the_sky():
    block = instance("block", box((2, 2, -0.1), (8, 8, 6)))
    cavity = box((-7.5, -7.5, 0.4), (-2.5, -2.5, 5.5))
    cavity.invert()
    world = scene(block, instance("shell", box((-8, -8, -0.1), (-2, -2, 6)), cavity))
    grid, fcl = ClearanceGrid.build(world), CollisionWorld(world)
    for place, free, open_ in (
        ((5, 5, 3), False, False), ((-5, -5, 3), True, False), ((0, 0, 1), True, True), ((14.75, 0, 5), True, True),
        ((14.76, 0, 5), False, False), ((0, 0, 14.8), False, False), ((0, 0, 20), False, False),
    ):  # fmt: skip
        assert (not grid.in_collision(place), grid.reachable(place)) == (free, open_)
    # FCL knows surfaces alone, and inside a solid these are far.
    assert fcl.distance_m((5, 5, 3)) == pytest.approx(3.0, abs=1e-5)
    assert not fcl.sphere_in_collision((5, 5, 3), 0.25)


def test_building_twice_gives_the_same_bytes():
    again = ClearanceGrid.build(town())
    for a, b in zip((*GRID.arrays, GRID.moves, GRID.sky), (*again.arrays, again.moves, again.sky), strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_a_scene_without_instances_is_free_everywhere():
    empty = scene()
    grid = ClearanceGrid.build(type(empty)("U_Empty_0", (), {}, empty.bounds))
    assert grid.distance_m((0, 0, 1)) == grid.cap_m
    assert grid.sky.all()


corner = st.tuples(*[st.floats(-3, 3)] * 3)


@settings(max_examples=50, deadline=None)
@given(st.lists(corner, min_size=5, max_size=5))
def test_segment_triangle_distance_is_the_least_over_points_of_both(points):
    p, q, *abc = np.array(points)
    tri = np.concatenate(abc).reshape(1, 9)
    d = segment_triangle_d2(*p, *q, tri, 0, 100.0) ** 0.5
    s = p + np.linspace(0, 1, 41)[:, None] * (q - p)
    u, v = (k.ravel() for k in np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 21)))
    inside = u + v <= 1
    t = abc[0] + u[inside, None] * (abc[1] - abc[0]) + v[inside, None] * (abc[2] - abc[0])
    sampled = np.linalg.norm(s[:, None] - t[None], axis=2).min()
    sides = max(np.linalg.norm(abc[i] - abc[i - 1]) for i in range(3))
    assert d - 1e-6 <= sampled <= d + np.linalg.norm(q - p) / 80 + sides / 20 + 1e-6


def test_split_triangles_cover_the_same_surface():
    tri = np.random.default_rng(6).uniform(-20, 20, (12, 3, 3))
    pieces, rows = split_triangles(tri.reshape(-1, 9), 4.0, np.full(3, -50.0), np.full(3, 50.0))
    pieces = pieces.reshape(-1, 3, 3)
    assert np.linalg.norm(pieces - np.roll(pieces, -1, axis=1), axis=2).max() <= 4.0 + 1e-9
    normal, own = (np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (tri, pieces))
    areas = np.bincount(rows, np.linalg.norm(own, axis=1), len(tri))
    assert areas == pytest.approx(np.linalg.norm(normal, axis=1), rel=1e-9)
    # In the plane of the triangle that they are cut from.
    assert np.abs(((pieces - tri[rows, :1]) * normal[rows, None]).sum(axis=2)).max() < 1e-9 * np.abs(normal).max()
    # A plane of forty kilometres is cut to the scene.
    huge = np.array([[-2e4, -2e4, 0, 2e4, -2e4, 0, 0, 2e4, 0]])
    assert len(split_triangles(huge, 4.0, np.full(3, -20.0), np.full(3, 20.0))[0]) < 3000


@settings(max_examples=20, deadline=None)
@given(
    n=st.integers(0, 700), places=st.integers(1, 400), seed=st.integers(0, 2**32 - 1),
    away_m=st.sampled_from([0.0, 1e3, 1e6]),
)  # fmt: skip
def test_a_tree_holds_every_triangle_once_and_finds_what_trying_all_finds(n, places, seed, away_m):
    """Also where many triangles lie at the same place, which no split can part, and far from the origin."""
    rng = np.random.default_rng(seed)
    at = (away_m + rng.uniform(-10, 10, (places, 3)))[rng.integers(0, places, n)]
    triangles = (at[:, None] + rng.uniform(-1, 1, (n, 3, 3))).reshape(n, 9)
    if n and rng.random() < 0.3:
        triangles[:] = triangles[0]
    ordered, boxes, order = build_bvh(triangles)
    assert sorted(order.tolist()) == list(range(n))
    assert np.array_equal(ordered, triangles[order])
    leaves = len(boxes) // 2
    corners = ordered.reshape(-1, 3, 3)
    for node in range(1, 2 * leaves):
        level = node.bit_length() - 1
        span = (leaves >> level) * LEAF
        below = corners[(node - (1 << level)) * span :][:span]
        if len(below):
            assert np.array_equal(boxes[node], np.concatenate([below.min(axis=(0, 1)), below.max(axis=(0, 1))]))
    for _ in range(5):
        p, q, radius = *(away_m + rng.uniform(-11, 11, (2, 3))), rng.uniform(0.05, 2.0)
        near = [k for k in range(n) if segment_triangle_d2(*p, *q, ordered, k, radius) <= radius * radius]
        found = segment_blocker(*p, *q, radius, ordered, group_boxes(boxes))
        assert found in near if near else found == -1


CELL = 0.5
SHAPE = (14, 10, 8)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.sampled_from([0.05, 0.5, 3.0, 30.0]))
def test_the_field_is_a_lower_bound_with_surfaces_all_around_and_exact_near_them(seed, n, size_m):
    rng = np.random.default_rng(seed)
    low = rng.uniform(-3, 3, 3)
    corner = rng.uniform(low - 6.0, low + np.array(SHAPE) * CELL + 6.0, (n, 1, 3))
    triangles = corner + rng.normal(0.0, size_m, (n, 3, 3))
    field = build_distance_field(triangles.reshape(-1, 9), low, SHAPE, CELL, 1.0, 5.0)
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3), process=False)
    centres = low + (np.argwhere(np.ones(SHAPE)) + 0.5) * CELL
    true = np.minimum(distances(mesh, centres).reshape(SHAPE), 5.0)
    assert (field <= true).all()
    # And not a needlessly low one.
    assert (true - field)[true < 1.0].max(initial=0.0) < 3e-5
    assert (true - field).max() < 3**0.5 * CELL + 1e-4


def test_too_narrow_a_band_is_refused():
    with pytest.raises(ValueError, match="band"):
        build_distance_field(np.empty((0, 9)), np.zeros(3), (2, 2, 2), 0.5, 0.3, 5.0)


def grove(seed: int, cell_m: float = 0.5, thick_m: float = 0.04) -> Scene:
    """Thin poles on a small ground, about midway between the centres of cells, where nobody flies but diagonally."""
    rng = np.random.default_rng(seed)
    places = -4 + cell_m * rng.integers(1, int(8 / cell_m) - 1, (24, 2)) + rng.uniform(-0.05, 0.05, (24, 2))
    half = thick_m / 2
    poles = [box((x - half, y - half, 0), (x + half, y + half, 4)) for x, y in places]
    floor = instance("ground", box((-6, -6, -0.5), (6, 6, 0)))
    materials = {"grey": Material("grey", (128, 128, 128))}
    return Scene("U_Grove_0", (floor, instance("poles", *poles)), materials, np.array([[-4.0, -4, 0], [4, 4, 3]]))


@pytest.mark.parametrize(("radius_m", "cell_m"), [(0.2, 0.5), (0.25, 0.5), (0.1, 0.5), (0.25, 1.0), (0.25, 1.6)])
def test_no_move_that_the_grid_lets_pass_meets_a_pole(radius_m, cell_m):
    moves = 0
    scene = grove(0, cell_m)
    grid, world = ClearanceGrid.build(scene, cell_m=cell_m, radius_m=radius_m), CollisionWorld(scene)
    for cell in np.argwhere(grid.moves):
        p = grid.arrays.origin + (cell + 0.5) * cell_m
        for m in np.flatnonzero(grid.moves[tuple(cell)] >> np.arange(N_HALF, dtype=np.uint32) & 1):
            moves += 1
            assert not world.segment_in_collision(p, p + MOVES[m] * cell_m, radius_m - 1e-6)
    assert moves > 100
