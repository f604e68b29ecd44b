import numpy as np
import pytest
import trimesh
from support.handmade import box, instance, mesh_of, scene

from aerialdojo_gen.geometry.rays import RayCaster, TriangleRayCaster
from aerialdojo_gen.geometry.surface import Surface

WALL = instance("wall", box((5.0, -4.0, 0.0), (5.25, 4.0, 4.0)))
BALL = instance("ball", trimesh.creation.icosphere(3, radius=1.5).apply_translation([9.0, 0.5, 2.0]))
YARD = scene(WALL, BALL)


def test_first_hit_tells_distance_and_instance():
    rays = RayCaster(YARD)
    assert rays.nodes == ("ground", "wall", "ball")
    distance, which = rays.first_hit(
        [0.0, 0.0, 2.0], [[1, 0, 0], [2, 0, 0], [0, 0, -1], [0, 0, 1], [-1, 0, 0.001], [0.6, 0, 0.8]]
    )
    assert distance[:3] == pytest.approx([5.0, 5.0, 2.0], abs=1e-9)
    assert np.isinf(distance[3:]).all()
    assert which.tolist() == [1, 1, 0, -1, -1, -1]


def test_distances_agree_with_float64_intersections_far_from_the_origin():
    shift = np.array([900.0, -700.0, 40.0])
    ball = trimesh.creation.icosphere(3, radius=1.5).apply_translation((shift[0] + 200.0, shift[1], shift[2]))
    rng = np.random.default_rng(0)
    targets = trimesh.sample.sample_surface(ball, 400, seed=1)[0]
    origins = np.tile(shift, (400, 1)) + rng.normal(size=(400, 3))
    directions = targets - origins
    distance, face = TriangleRayCaster(np.asarray(ball.vertices), np.asarray(ball.faces, np.int32)).first_hit(
        origins, directions
    )
    assert (face >= 0).all()
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    hit = origins + distance[:, None] * unit
    # On the plane of the face, in its triangle, and no other face nearer: all in float64.
    plane = np.einsum("ij,ij->i", hit - ball.triangles[face, 0], ball.face_normals[face])
    assert np.abs(plane).max() < 1e-9
    inside = trimesh.triangles.points_to_barycentric(ball.triangles[face], hit)
    assert inside.min() > -1e-3
    slow = trimesh.ray.ray_triangle.RayMeshIntersector(ball)
    where, ray, _ = slow.intersects_location(origins, unit, multiple_hits=True)
    nearest = np.full(400, np.inf)
    np.minimum.at(nearest, ray, np.linalg.norm(where - origins[ray], axis=1))
    sure = np.isfinite(nearest)
    assert sure.mean() > 0.98
    assert np.abs(nearest - distance)[sure].max() < 1e-6


def test_rays_at_vertices_and_edges_of_a_closed_mesh_do_not_slip_through():
    ball = trimesh.creation.icosphere(4, radius=30.0)
    caster = TriangleRayCaster(np.asarray(ball.vertices), np.asarray(ball.faces, np.int32))
    edges = ball.vertices[ball.edges_unique].mean(axis=1)
    distance, _ = caster.first_hit([0.1, -0.2, 0.3], edges - [0.1, -0.2, 0.3])
    assert np.isfinite(distance).all()


def test_visible_needs_a_free_line_and_forgives_the_points_own_surface():
    rays = RayCaster(YARD)
    on_ball = [9.0 - 1.5, 0.5, 2.0]
    assert rays.visible([0.0, 0.5, 12.0], on_ball).tolist() == [True]
    assert rays.visible([0.0, 0.5, 2.0], on_ball).tolist() == [False]
    behind = [9.0 + 1.5, 0.5, 2.0]
    assert rays.visible([0.0, 0.5, 12.0], behind).tolist() == [False]
    assert rays.visible([0.0, 0.5, 12.0], behind, own_instance=2).tolist() == [True]
    assert rays.visible([0.0, 0.5, 2.0], behind, own_instance=2).tolist() == [False]
    assert rays.visible(on_ball, on_ball).tolist() == [True]


def test_slivers_are_left_out_and_an_area_is_needed():
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    distance, face = TriangleRayCaster(flat, np.array([[0, 1, 2], [0, 1, 3]], np.int32)).first_hit(
        [0.2, 0.2, 5.0], [[0, 0, -1]]
    )
    assert (distance.tolist(), face.tolist()) == ([5.0], [1])
    with pytest.raises(ValueError, match="no triangle"):
        TriangleRayCaster(flat, np.array([[0, 1, 2]], np.int32))


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.icosphere(2, radius=2.0),
        trimesh.creation.torus(3.0, 0.4),
        box((-1, -6, 0), (1, 6, 3)),
        trimesh.creation.cone(1.0, 4.0),
    ],
    ids=["sphere", "torus", "long box", "cone"],
)
def test_surface_distance_is_trimeshs(mesh):
    rng = np.random.default_rng(3)
    points = rng.uniform(-8, 8, (300, 3))
    mine = Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32))
    _, theirs, _ = trimesh.proximity.closest_point(mesh, points)
    assert mine.distance_m(points) == pytest.approx(theirs, abs=1e-9)
    near = np.array([mine.nearest_point(p) for p in points[:40]])
    assert np.linalg.norm(near - points[:40], axis=1) == pytest.approx(theirs[:40], abs=1e-9)
    assert mine.distance_m(near).max() < 1e-9


def test_surface_samples_lie_on_it_evenly_by_area():
    thing = instance("thing", box((0, 0, 0), (1, 1, 1)), box((10, 0, 0), (13, 1, 1)))
    points = Surface.of(thing).sample(2000, np.random.default_rng(0))
    _, distance, _ = trimesh.proximity.closest_point(mesh_of(thing), points)
    assert distance.max() < 1e-9
    assert (points[:, 0] < 5).sum() == pytest.approx(2000 * 6 / 20, abs=2)
    again = Surface.of(thing).sample(2000, np.random.default_rng(0))
    assert (points == again).all()


def test_standoff_is_the_first_place_from_outside_at_the_offset():
    mesh = trimesh.creation.torus(3.0, 0.4)
    surface = Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32))
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    up = np.linspace(-1.4, 1.4, 24)
    out = np.column_stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    stop = surface.standoff(np.zeros(3), out, 0.5)
    reached = ~np.isnan(stop[:, 0])
    assert 0 < (~reached).sum() < 24
    assert surface.distance_m(stop[reached]) == pytest.approx(0.5, abs=1e-4)
    for direction, end in zip(out, stop, strict=True):
        whole_way = np.linspace(0.0 if np.isnan(end[0]) else np.linalg.norm(end) + 1e-3, 9.0, 400)
        assert surface.distance_m(whole_way[:, None] * direction).min() > 0.5


def test_unobstructed_and_visible_say_what_the_first_hit_says():
    """Also where the origin or the point is the wall's own, and where both are one."""
    caster = RayCaster(YARD)._triangles
    rng = np.random.default_rng(2)
    origins = rng.uniform([-14, -14, 0.2], [14, 14, 9], (3000, 3))
    points = np.vstack([rng.uniform([-14, -14, 0.2], [14, 14, 9], (1500, 3)), Surface.of(BALL).sample(1500, rng)])
    way = points - origins
    expected = caster.first_hit(origins, way)[0] >= np.linalg.norm(way, axis=1) - 5e-3
    assert 0.2 < expected.mean() < 0.9
    assert (caster.unobstructed(origins, points) == expected).mean() > 0.999
    assert (RayCaster(YARD).visible(origins, points) == expected).all()
    assert caster.unobstructed(origins[0], origins[:1]).all()
    row, column = (rng.integers(3000, size=500).astype(np.int32) for _ in range(2))
    named = caster.unobstructed(origins, points, ends=(row, column))
    assert (named == caster.unobstructed(origins[row], points[column])).all()
