"""The frames of foreign task files: turns that keep handedness, with an exact way back."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aerialdojo_gen.exchange.frames import (
    FRAMES,
    Frame,
    frame_named,
    world_to_habitat,
    yaw_to_habitat_quaternion_xyzw,
)

frames = st.sampled_from(list(FRAMES.values()))
coordinates = st.floats(-1e5, 1e5, allow_subnormal=False)
points = st.tuples(coordinates, coordinates, coordinates)
yaws = st.floats(-math.pi, math.pi)


def rotate(quaternion_xyzw, vector):
    return Rotation.from_quat(quaternion_xyzw).apply(vector)


def forward(yaw):
    return np.array([math.cos(yaw), math.sin(yaw), 0.0])


@pytest.mark.parametrize("frame", FRAMES.values(), ids=list(FRAMES))
def test_a_frame_is_a_turn_that_keeps_handedness(frame: Frame):
    assert np.allclose(frame.matrix @ frame.matrix.T, np.eye(3))
    assert np.linalg.det(frame.matrix) == pytest.approx(1.0)


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


@settings(deadline=None)
@given(points, points, points)
def test_habitats_frame_keeps_handedness(a, b, c):
    ours = np.linalg.det(np.array([a, b, c]) / 1e5)
    assert np.linalg.det(world_to_habitat([a, b, c]) / 1e5) == pytest.approx(ours, abs=1e-9)


@settings(deadline=None)
@given(points, yaws)
def test_ned_is_north_east_down_and_a_heading_points_the_same_way(point, yaw):
    ned = FRAMES["ned"]
    x, y, z = point
    assert ned.positions_from_world(point).tolist() == [y, x, -z]
    heading = float(ned.yaw_from_world(yaw))
    ahead = ned.positions_from_world([math.cos(yaw), math.sin(yaw), 0.0])
    assert ahead[:2] == pytest.approx([math.cos(heading), math.sin(heading)], abs=1e-9)


@pytest.mark.parametrize(
    ("name", "x_points", "y_points", "z_points"),
    [("enu", "east", "north", "up"), ("nwu", "north", "west", "up"), ("ned", "north", "east", "down"),
     ("esd", "east", "south", "down")],
)  # fmt: skip
def test_axes_point_where_the_name_says(name, x_points, y_points, z_points):
    ways = {"east": [1, 0, 0], "west": [-1, 0, 0], "north": [0, 1, 0], "south": [0, -1, 0], "up": [0, 0, 1],
            "down": [0, 0, -1]}  # fmt: skip
    axes = frame_named(name).positions_to_world(np.eye(3))
    assert axes.tolist() == [ways[x_points], ways[y_points], ways[z_points]]
