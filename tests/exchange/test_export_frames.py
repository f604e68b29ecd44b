"""The frames of foreign task files: turns that keep handedness, with an exact way back."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aerialdojo_gen.exchange.frames import FRAMES, frame_named, world_to_habitat, yaw_to_habitat_quaternion_xyzw

frames = st.sampled_from(list(FRAMES.values()))
coordinates = st.floats(-1e5, 1e5, allow_subnormal=False)
points = st.tuples(coordinates, coordinates, coordinates)
yaws = st.floats(-math.pi, math.pi)


def rotate(quaternion_xyzw, vector):
    return Rotation.from_quat(quaternion_xyzw).apply(vector)


def forward(yaw):
    return np.array([math.cos(yaw), math.sin(yaw), 0.0])


@settings(deadline=None)
@given(frames, points)
def test_positions_come_back_to_the_last_bit(frame, point):
    assert frame.positions_to_world(frame.positions_from_world(point)).tolist() == list(point)
    x, y, z = world_to_habitat(point)
    assert [x, -z, y] == list(point)


@settings(deadline=None)
@given(frames, yaws)
def test_an_attitude_looks_the_same_way_in_both_frames(frame, yaw):
    quaternion = frame.quaternion_from_world_yaw(yaw)
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-12)
    assert frame.matrix @ rotate(quaternion, [1, 0, 0]) == pytest.approx(forward(yaw), abs=1e-12)
    back = float(frame.quaternion_to_world_yaw(quaternion))
    assert abs(math.remainder(back - yaw, 2 * math.pi)) < 1e-9
    assert -math.pi < back <= math.pi


@settings(deadline=None)
@given(yaws)
def test_habitats_bodies_look_along_minus_z(yaw):
    quaternion = yaw_to_habitat_quaternion_xyzw(yaw)
    assert rotate(quaternion, [0, 0, -1]) == pytest.approx(world_to_habitat(forward(yaw)), abs=1e-12)
    # Up stays up, left stays left.
    assert rotate(quaternion, [0, 1, 0]) == pytest.approx(world_to_habitat([0, 0, 1]), abs=1e-12)
    assert rotate(quaternion, [-1, 0, 0]) == pytest.approx(world_to_habitat(forward(yaw + math.pi / 2)), abs=1e-12)


@pytest.mark.parametrize("name", FRAMES)
def test_axes_point_where_the_letters_of_the_name_say(name):
    """Which makes each frame a turn that keeps handedness."""
    ways = {"e": [1, 0, 0], "w": [-1, 0, 0], "n": [0, 1, 0], "s": [0, -1, 0], "u": [0, 0, 1], "d": [0, 0, -1]}
    axes = frame_named(name).positions_to_world(np.eye(3))
    assert axes.tolist() == [ways[letter] for letter in name]
    assert np.linalg.det(axes) == 1.0
