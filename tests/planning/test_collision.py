import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import distances, solid, town
from support.handmade import box, instance, scene

from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld

WORLD = town()
FCL = CollisionWorld(WORLD)
GRID = ClearanceGrid.build(WORLD)
MESH = solid(WORLD)


def test_distance_agrees_with_trimesh():
    points = np.random.default_rng(0).uniform([-17, -17, 0.1], [17, 17, 11], (300, 3))
    assert np.abs([FCL.distance_m(p) for p in points] - distances(MESH, points)).max() < 1e-5


coordinate = st.floats(-17, 17)
height = st.floats(0.3, 11)


@settings(max_examples=150, deadline=None)
@given(st.tuples(coordinate, coordinate, height), st.floats(0.05, 2.0))
def test_a_ball_collides_exactly_when_a_surface_is_nearer_than_its_radius(p, radius):
    d = float(distances(MESH, np.array([p]))[0])
    if abs(d - radius) > 1e-4:
        assert FCL.sphere_in_collision(p, radius) == (d < radius)


@settings(max_examples=60, deadline=None)
@given(st.tuples(coordinate, coordinate, height), st.tuples(coordinate, coordinate, height))
def test_a_sweep_collides_exactly_when_some_ball_of_it_does(p, q):
    a, b = np.array(p), np.array(q)
    b = a + (b - a) / max(1.0, np.linalg.norm(b - a) / 5.0)
    d = distances(MESH, a + np.linspace(0, 1, 201)[:, None] * (b - a))
    spacing = np.linalg.norm(b - a) / 200
    if d.min() < 0.25 - 1e-4:
        assert FCL.segment_in_collision(a, b, 0.25)
    elif d.min() > 0.25 + spacing / 2 + 1e-4:
        assert not FCL.segment_in_collision(a, b, 0.25)


def test_a_thin_pole_between_two_free_ends_is_hit():
    world = CollisionWorld(scene(instance("pole", box((-0.01, -0.01, 0), (0.01, 0.01, 5)))))
    assert world.segment_in_collision((-2.5, 0.2, 2), (2.5, 0.2, 2), 0.25)
    assert not world.segment_in_collision((-2.5, 0.3, 2), (2.5, 0.3, 2), 0.25)
    assert world.segment_in_collision((0.2, 0, 8), (0.2, 0, 3), 0.25)
    assert not world.segment_in_collision((0.2, 0, 8), (0.2, 0, 5.3), 0.25)


def test_a_route_collides_when_any_leg_does():
    world = CollisionWorld(scene(instance("wall", box((-5, -0.1, 0), (5, 0.1, 3)))))
    over = [(0, -2, 1), (0, -2, 4), (0, 2, 4), (0, 2, 1)]
    assert not world.route_in_collision(over, 0.25)
    assert world.route_in_collision([over[0], over[3]], 0.25)
    assert world.route_in_collision([(0, 0, 1)], 0.25)


def test_inside_a_solid_the_surface_is_far():
    world = CollisionWorld(scene(instance("block", box((-3, -3, 0), (3, 3, 6)))))
    assert world.distance_m((0, 0, 3)) == pytest.approx(3.0, abs=1e-5)
    assert not world.sphere_in_collision((0, 0, 3), 0.25)


@settings(max_examples=100, deadline=None)
@given(st.tuples(coordinate, coordinate, height), st.floats(0.05, 2.0))
def test_a_ball_that_the_grid_proves_free_touches_nothing(p, radius):
    if GRID.segment_proven_free(p, p, radius):
        assert not FCL.sphere_in_collision(p, radius)
