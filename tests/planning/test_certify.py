"""The certificate: FCL decides every leg that the grid does not prove free, wherever on the route it lies."""

import numpy as np
import pytest
from support.handmade import box, instance, scene

from aerialdojo_gen.planning.certify import certify, clearance_profile, corners
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


def profile_of(route, radius=RADIUS):
    return clearance_profile(route, radius, GRID.cap_m, GRID.arrays)


@pytest.mark.parametrize("place", THROUGH)
def test_a_wall_across_any_one_leg_is_found(place):
    profile = profile_of(THROUGH[place])
    assert not certify(profile, RADIUS, WORLD)
    assert profile.clearance == pytest.approx(0.0, abs=1e-9)
    # What the grid says of the legs counts only where it may prove them free.
    wrong = profile._replace(undecided=np.zeros(len(profile.undecided), bool))
    assert certify(wrong, RADIUS, WORLD)
    assert not certify(wrong, RADIUS, WORLD, prove=False)


def test_fcl_answers_for_every_leg_that_is_not_proven_free():
    # Legs along the wall: too near for the grid to prove, free for FCL by a millimetre.
    side = -0.1 - RADIUS - 0.001
    near = np.array([[side, -5.0, 2], [side, 0, 2], [side, 0, 5], [side, 5, 5]])
    for route, undecided in ((near, 3), (WEST, 0), (np.concatenate([WEST[:2], near[:1]]), 1)):
        profile = profile_of(route)
        assert (len(profile.undecided), profile.undecided.sum()) == (len(route) - 1, undecided)
        assert certify(profile, RADIUS, WORLD)
    assert profile_of(near).clearance == pytest.approx(RADIUS + 0.001, abs=1e-6)
    # A body two millimetres thicker touches the wall on each of the legs.
    for k in range(len(near) - 1):
        assert not certify(profile_of(near[k : k + 2], RADIUS + 0.002), RADIUS + 0.002, WORLD)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_corner_outside_the_flight_volume_is_refused(place):
    route = WEST.copy()
    route[place, 2] += 20
    assert not certify(profile_of(route), RADIUS, WORLD)


def test_corners_drop_what_lies_on_the_way_and_keep_turning_points():
    way = np.array([[0.0, 0, 1], [0, 0, 1], [1, 0, 1], [3, 0, 1], [3, 0, 1], [1, 0, 1], [1, 4, 1], [1, 5, 1]])
    # From x = 3 the way leads back: a reversal is a corner.
    assert corners(way).tolist() == [[0, 0, 1], [3, 0, 1], [1, 0, 1], [1, 5, 1]]
    assert corners(way[:2]).tolist() == [[0, 0, 1]]
