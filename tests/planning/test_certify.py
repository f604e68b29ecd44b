"""The certificate: FCL decides every leg that the grid does not prove free, wherever on the route it lies."""

import numpy as np
import pytest
from support.handmade import box, instance, scene

from aerialdojo_gen.planning.certify import certify, corners
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld

RADIUS = 0.25
WALL = scene(instance("wall", box((-0.1, -16, 0), (0.1, 16, 6))))
GRID, WORLD = ClearanceGrid.build(WALL), CollisionWorld(WALL)
# A turn west of the wall and one east of it; joined, only the leg between them meets the wall.
WEST = np.array([[-6.0, -5, 2], [-6, 5, 2], [-3, 5, 3]])
EAST = np.array([[3.0, 5, 4], [6, 5, 2], [6, -5, 2]])
THROUGH = {
    "first": np.concatenate([WEST[-1:], EAST]),
    "middle": np.concatenate([WEST, EAST]),
    "last": np.concatenate([WEST, EAST[:1]]),
    "only": np.stack([WEST[-1], EAST[0]]),
}


@pytest.mark.parametrize("prove", [True, False])
@pytest.mark.parametrize("place", THROUGH)
def test_a_wall_across_any_one_leg_is_found(place, prove):
    route = THROUGH[place]
    certificate = certify(route, RADIUS, GRID, WORLD, prove)
    assert not certificate.collision_free
    assert certificate.legs == len(route) - 1
    assert certificate.min_clearance_m == pytest.approx(0.0, abs=1e-9)


def test_fcl_answers_for_every_leg_that_is_not_proven_free_and_for_all_without_proof():
    # Legs along the wall: too near for the grid to prove, free for FCL by a millimetre.
    side = -0.1 - RADIUS - 0.001
    near = np.array([[side, -5.0, 2], [side, 0, 2], [side, 0, 5], [side, 5, 5]])
    for route, undecided in ((near, 3), (WEST, 0), (np.concatenate([WEST[:2], near[:1]]), 1)):
        assert certify(route, RADIUS, GRID, WORLD).fcl_checks == undecided
        every = certify(route, RADIUS, GRID, WORLD, prove=False)
        assert (every.collision_free, every.fcl_checks) == (True, len(route) - 1)
    assert certify(near, RADIUS, GRID, WORLD).min_clearance_m == pytest.approx(RADIUS + 0.001, abs=1e-6)
    # A body two millimetres thicker touches the wall on each of the legs.
    for k in range(len(near) - 1):
        assert not certify(near[k : k + 2], RADIUS + 0.002, GRID, WORLD).collision_free


@pytest.mark.parametrize("place", [0, 1, 3])
def test_a_corner_outside_the_flight_volume_is_refused(place):
    route = np.concatenate([WEST, [[-3.0, 8, 3]]])
    route[place] += [0, 0, 20]
    assert not certify(route, RADIUS, GRID, WORLD).collision_free


def test_corners_drop_what_lies_on_the_way_and_keep_turning_points():
    way = np.array([[0.0, 0, 1], [0, 0, 1], [1, 0, 1], [3, 0, 1], [3, 0, 1], [1, 0, 1], [1, 4, 1], [1, 5, 1]])
    # From x = 3 the way leads back: a reversal is a corner.
    assert corners(way).tolist() == [[0, 0, 1], [3, 0, 1], [1, 0, 1], [1, 5, 1]]
    assert corners(way[:2]).tolist() == [[0, 0, 1]]
