import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import distances, solid, town
from support.handmade import box, instance, scene

from aerialdojo_gen.geometry.triangles import segment_triangle_d2, split_triangles
from aerialdojo_gen.planning.bvh import build_bvh
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.distance_field import build_distance_field
from aerialdojo_gen.planning.grid_kernels import polyline_clearance

WORLD = town()
GRID = ClearanceGrid.build(WORLD)
FCL = CollisionWorld(WORLD)
MESH = solid(WORLD)


def random_segments(n, seed, longest=5.0):
    rng = np.random.default_rng(seed)
    p = rng.uniform([-17.7, -17.7, 0.3], [17.7, 17.7, 11.7], (n, 3))
    u = rng.normal(size=(n, 3)) * [1, 1, 0.4]
    u *= rng.uniform(0.2, longest, (n, 1)) / np.linalg.norm(u, axis=1, keepdims=True)
    return p, np.clip(p + u, [-17.7, -17.7, 0.3], [17.7, 17.7, 11.7])


def test_field_is_exact_in_the_band_and_never_too_large():
    a = GRID.arrays
    rng = np.random.default_rng(1)
    cells = np.stack([rng.integers(0, n, 1500) for n in a.field.shape], axis=1)
    true = distances(MESH, a.origin + (cells + 0.5) * a.cell)
    field = a.field[tuple(cells.T)].astype(float)
    assert (field <= np.minimum(true, GRID.cap_m)).all()
    assert (true - field)[true < 1.0].max() < 3e-5
    assert (np.minimum(true, GRID.cap_m) - field).max() < 3**0.5 * a.cell + 1e-4


def test_the_grid_never_proves_free_what_fcl_refuses():
    p, q = random_segments(6000, 2)
    proven = np.array([GRID.segment_proven_free(a, b, 0.25) for a, b in zip(p, q, strict=True)])
    assert 0.2 < proven.mean() < 0.95
    assert not any(FCL.segment_in_collision(p[i], q[i], 0.25) for i in np.flatnonzero(proven))


def test_grid_with_triangles_agrees_with_fcl_on_every_segment():
    p, q = random_segments(2500, 3)
    ours = np.array([GRID.segment_in_collision(a, b, 0.25) for a, b in zip(p, q, strict=True)])
    fcl = np.array([FCL.segment_in_collision(a, b, 0.25) for a, b in zip(p, q, strict=True)])
    assert 0.1 < fcl.mean() < 0.9
    assert (ours == fcl).all()


def test_point_distance_agrees_with_trimesh():
    points = np.random.default_rng(4).uniform([-17, -17, 0.1], [17, 17, 11], (300, 3))
    expected = np.minimum(distances(MESH, points), GRID.cap_m)
    assert np.abs(GRID.distance_m(points) - expected).max() < 1e-9


def test_clearance_of_a_polyline_is_that_of_its_nearest_point():
    p, q = random_segments(40, 5, longest=12.0)
    for a, b in zip(p, q, strict=True):
        got = polyline_clearance(np.stack([a, b]), 5.0, GRID.arrays)
        sampled = distances(MESH, a + np.linspace(0, 1, 241)[:, None] * (b - a)).min()
        assert got - 1e-9 <= min(sampled, 5.0) <= got + np.linalg.norm(b - a) / 480 + 1e-9


def test_points_in_solids_and_sealed_rooms_do_not_reach_the_sky():
    block = instance("block", box((2, 2, -0.1), (8, 8, 6)))
    cavity = box((-7.5, -7.5, 0.4), (-2.5, -2.5, 5.5))
    cavity.invert()
    shell = instance("shell", box((-8, -8, -0.1), (-2, -2, 6)), cavity)
    grid = ClearanceGrid.build(scene(block, shell))
    assert grid.in_collision((5, 5, 3))
    assert not grid.reachable((5, 5, 3))
    assert not grid.reachable((-5, -5, 3))
    assert not grid.in_collision((-5, -5, 3))
    assert grid.reachable((0, 0, 1))
    assert not grid.in_collision((0, 0, 1))


def test_bounds_keep_the_whole_body_inside():
    grid = ClearanceGrid.build(scene())
    assert not grid.in_collision((14.75, 0, 5))
    assert grid.in_collision((14.76, 0, 5))
    assert grid.in_collision((0, 0, 14.8))
    assert not grid.reachable((0, 0, 20))


@pytest.mark.parametrize(("gap", "passed"), [(1.2, True), (1.0, True), (0.4, False)])
def test_a_room_with_a_gap_is_reachable_where_the_body_fits_through(gap, passed):
    # Closed but for a slot in its front wall, half a cell off the grid.
    y = 0.13
    room = instance(
        "room", box((-4, -4, 3), (4, 4, 3.3)), box((-4, -4, 0), (-3.8, 4, 3)), box((3.8, -4, 0), (4, 4, 3)),
        box((-4, 3.8, 0), (4, 4, 3)), box((-4, -4, 0), (y - gap / 2, -3.8, 3)),
        box((y + gap / 2, -4, 0), (4, -3.8, 3)),
    )  # fmt: skip
    assert ClearanceGrid.build(scene(room)).reachable((0, 1, 1.5)) is passed


def test_building_twice_gives_the_same_bytes():
    again = ClearanceGrid.build(town())
    for a, b in zip(GRID.arrays, again.arrays, strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()
    assert GRID.moves.tobytes() == again.moves.tobytes()
    assert GRID.sky.tobytes() == again.sky.tobytes()


def test_a_scene_without_instances_is_free_everywhere():
    empty = scene()
    grid = ClearanceGrid.build(type(empty)("U_Empty_0", (), {}, empty.bounds))
    assert grid.distance_m((0, 0, 1)) == grid.cap_m
    assert grid.sky.all()


corner = st.tuples(*[st.floats(-3, 3)] * 3)


@settings(max_examples=200, deadline=None)
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
    rng = np.random.default_rng(6)
    tri = rng.uniform(-20, 20, (12, 9))
    low, high = np.full(3, -50.0), np.full(3, 50.0)
    pieces, rows = split_triangles(tri, 4.0, low, high)
    pieces = pieces.reshape(-1, 3, 3)

    def area(t):
        return np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() / 2

    assert area(pieces) == pytest.approx(area(tri.reshape(-1, 3, 3)), rel=1e-9)
    assert np.linalg.norm(pieces - np.roll(pieces, -1, axis=1), axis=2).max() <= 4.0 + 1e-9
    whole = tri.reshape(-1, 3, 3)[rows]
    normal = np.cross(whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0])
    assert np.abs(((pieces - whole[:, :1]) * normal[:, None]).sum(axis=2)).max() < 1e-9 * np.abs(normal).max()
    for k in range(len(tri)):
        assert area(pieces[rows == k]) == pytest.approx(area(tri[k].reshape(1, 3, 3)), rel=1e-9)
    ordered, boxes, order = build_bvh(pieces.reshape(-1, 9))
    assert np.array_equal(ordered, pieces.reshape(-1, 9)[order])
    assert sorted(map(tuple, ordered.round(9))) == sorted(map(tuple, pieces.reshape(-1, 9).round(9)))
    assert np.allclose(boxes[1], np.concatenate([pieces.min(axis=(0, 1)), pieces.max(axis=(0, 1))]))


def test_a_plane_of_forty_kilometres_is_cut_to_the_scene():
    huge = np.array([[-2e4, -2e4, 0, 2e4, -2e4, 0, 0, 2e4, 0]])
    assert len(split_triangles(huge, 4.0, np.full(3, -20.0), np.full(3, 20.0))[0]) < 3000


def test_too_narrow_a_band_is_refused():
    with pytest.raises(ValueError, match="band"):
        build_distance_field(np.empty((0, 9)), np.zeros(3), (2, 2, 2), 0.5, 0.3, 5.0)
