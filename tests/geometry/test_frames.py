import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.geometry import frames
from aerialdojo_gen.geometry.frames import wrap_angle_rad, yaw_towards
from aerialdojo_gen.store.schemas import DIRECTIONS

angles = st.floats(-1e4, 1e4)
metres = st.floats(-1e3, 1e3)
points = st.tuples(metres, metres, metres)


@given(angles)
def test_wrapped_angle_is_the_same_direction_in_range(a):
    w = float(wrap_angle_rad(a))
    assert -math.pi < w <= math.pi
    assert math.cos(w) == pytest.approx(math.cos(a), abs=1e-9)
    assert math.sin(w) == pytest.approx(math.sin(a), abs=1e-9)


@given(st.floats(-math.pi, math.pi, exclude_min=True))
def test_angle_in_range_is_left_bit_for_bit(a):
    assert float(wrap_angle_rad(a)) == a


def test_half_turns_wrap_to_plus_pi():
    turns = np.array([math.pi, -math.pi, np.nextafter(-math.pi, -4), -3 * math.pi])
    assert (wrap_angle_rad(turns) > 0).tolist() == [True] * 4
    assert wrap_angle_rad(turns[:2]).tolist() == [math.pi, math.pi]


@given(points, points)
def test_yaw_towards_leads_to_the_target(p, q):
    distance = math.hypot(q[0] - p[0], q[1] - p[1])
    yaw = float(yaw_towards(p, q))
    assert -math.pi < yaw <= math.pi
    assert p[0] + distance * math.cos(yaw) == pytest.approx(q[0], abs=1e-6)
    assert p[1] + distance * math.sin(yaw) == pytest.approx(q[1], abs=1e-6)


def test_yaw_towards_broadcasts_and_faces_west_with_plus_pi():
    yaw = yaw_towards([[1.0, 0.0, 5.0], [0.0, -2.0, 0.0]], [0.0, 0.0, 0.0])
    assert yaw.tolist() == [math.pi, math.pi / 2]
    assert float(yaw_towards([1.0, 0.0], [0.0, -0.0])) == math.pi


@pytest.mark.parametrize(("k", "name"), list(enumerate(DIRECTIONS)))
def test_compass_sectors_are_centred_and_45_degrees_wide(k, name):
    for off in (-22.4, 0.0, 22.4):
        a = math.radians(45 * k + off)
        assert frames.compass_direction(30 * math.cos(a), 30 * math.sin(a)) == name


def test_compass_north_is_plus_y_and_no_displacement_is_refused():
    assert frames.compass_direction(0, 1) == "north"
    assert frames.compass_direction(1, 0) == "east"
    assert frames.compass_direction(-1, -0.0) == "west"
    with pytest.raises(ValueError, match="no compass direction"):
        frames.compass_direction(0.0, -0.0)


@given(metres.filter(lambda v: abs(v) > 1e-6), metres.filter(lambda v: abs(v) > 1e-6))
def test_compass_direction_and_its_opposite(dx, dy):
    there, back = (DIRECTIONS.index(frames.compass_direction(s * dx, s * dy)) for s in (1, -1))
    assert (there - back) % 8 == 4


@given(angles, st.sampled_from([-3.0, -1.0, 0.5, 1.0]))
def test_quaternion_round_trip_whatever_its_length_and_sign(yaw, length):
    q = frames.yaw_to_quaternion_xyzw(yaw)
    assert q[3] >= 0.0
    assert np.linalg.norm(q) == pytest.approx(1.0)
    again = float(frames.quaternion_xyzw_to_yaw(length * q))
    assert float(wrap_angle_rad(again - yaw)) == pytest.approx(0.0, abs=1e-9)


def test_quaternion_yaw_of_a_pitched_body_is_where_its_nose_points():
    half_pitch, half_yaw = math.radians(-20) / 2, math.radians(130) / 2
    # yaw then pitch, as quaternion product z * y
    q = [
        -math.sin(half_yaw) * math.sin(half_pitch), math.cos(half_yaw) * math.sin(half_pitch),
        math.sin(half_yaw) * math.cos(half_pitch), math.cos(half_yaw) * math.cos(half_pitch),
    ]  # fmt: skip
    assert math.degrees(float(frames.quaternion_xyzw_to_yaw(q))) == pytest.approx(130)
