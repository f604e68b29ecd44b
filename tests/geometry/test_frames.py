import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from aerialdojo_gen.geometry import frames
from aerialdojo_gen.geometry.frames import wrap_angle_rad, wrap_turned_rad, yaw_towards
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURN_RAD, TURNS, nearest_heading, replay, route_length_m
from aerialdojo_gen.store.schemas import ACTION_NAMES, DIRECTIONS

angles = st.floats(-1e4, 1e4)
metres = st.floats(-1e3, 1e3)
points = st.tuples(metres, metres, metres)


@given(st.one_of(angles, st.floats(-math.pi, math.pi)))
@example(math.pi)
@example(-math.pi)
@example(float(np.nextafter(-math.pi, -4)))
@example(-3 * math.pi)
def test_a_wrapped_angle_is_the_same_direction_in_range(a):
    w = float(wrap_angle_rad(a))
    assert -math.pi < w <= math.pi
    assert math.cos(w) == pytest.approx(math.cos(a), abs=1e-9)
    assert math.sin(w) == pytest.approx(math.sin(a), abs=1e-9)
    assert w == a or not -math.pi < a <= math.pi, "one in range is left as it is, to the bit"
    assert wrap_angle_rad(np.array([a, 0.0])).tolist() == [w, 0.0]


@given(points, points)
@example((1.0, 0.0, 5.0), (0.0, -0.0, 0.0))  # due west, which arctan2 may call -pi
def test_yaw_towards_leads_to_the_target(p, q):
    distance = math.hypot(q[0] - p[0], q[1] - p[1])
    yaw, _ = yaw_towards([p, q], q).tolist()
    assert -math.pi < yaw <= math.pi
    assert p[0] + distance * math.cos(yaw) == pytest.approx(q[0], abs=1e-6)
    assert p[1] + distance * math.sin(yaw) == pytest.approx(q[1], abs=1e-6)


def test_compass_sectors_are_centred_and_45_degrees_wide():
    assert (frames.compass_direction(1, 0), frames.compass_direction(0, 1)) == ("east", "north")
    assert frames.compass_direction(-1, -0.0) == "west"
    for k, name in enumerate(DIRECTIONS):
        for off in (-22.4, 0.0, 22.4):
            a = math.radians(45 * k + off)
            assert frames.compass_direction(30 * math.cos(a), 30 * math.sin(a)) == name
    with pytest.raises(ValueError, match="no compass direction"):
        frames.compass_direction(0.0, -0.0)


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


def test_the_table_is_the_papers():
    by_name = dict(zip(ACTION_NAMES, DISPLACEMENTS.tolist(), strict=True))
    assert by_name["MoveForward5"] == [5, 0, 0]
    assert by_name["MoveLeft3"] == [0, 3, 0]
    assert by_name["MoveRight1"] == [0, -1, 0]
    assert by_name["MoveUp2"] == [0, 0, 2]
    assert by_name["MoveDown2"] == [0, 0, -2]
    assert TURNS.tolist() == [0] * 14 + [1, -1, 0]
    assert sorted(np.abs(DISPLACEMENTS).sum(axis=1)) == [0] * 4 + [1] * 5 + [2] * 2 + [3] * 3 + [5] * 3


@given(st.tuples(*[st.floats(-50, 50)] * 3, st.floats(-math.pi, math.pi)), st.lists(st.integers(0, 16), max_size=40))
@example((0.0, 0.0, 0.0, -math.pi), [14] * 24)
def test_replay_is_one_action_after_the_other(start, actions):
    poses = replay(start, actions)
    assert poses.shape == (len(actions) + 1, 4)
    x, y, z, yaw = start
    for k, a in enumerate(actions):
        dx, dy, dz = DISPLACEMENTS[a]
        x, y, z = x + math.cos(yaw) * dx - math.sin(yaw) * dy, y + math.sin(yaw) * dx + math.cos(yaw) * dy, z + dz
        yaw += TURNS[a] * math.radians(15)
        assert poses[k + 1, :3] == pytest.approx([x, y, z], abs=1e-9)
        assert math.cos(poses[k + 1, 3] - yaw) == pytest.approx(1.0, abs=1e-12)
    assert (poses[:, 3] > -math.pi).all()
    assert (poses[:, 3] <= math.pi).all()
    headings = np.cumsum([0, *TURNS[np.array(actions, int)]])
    assert poses[:, 3].tolist() == wrap_turned_rad(start[3] + headings * TURN_RAD).tolist()
    flown = np.abs(DISPLACEMENTS[np.array(actions, int)]).sum()
    assert route_length_m(poses[:, :3]) == pytest.approx(flown, abs=1e-9)


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_nearest_heading_is_within_seven_and_a_half_degrees(start, wanted):
    k = nearest_heading(start, wanted)
    assert 0 <= k < 24
    assert abs(math.remainder(start + k * TURN_RAD - wanted, 2 * math.pi)) <= math.radians(7.5) + 1e-9


@pytest.mark.parametrize("wrong", [-1, 17])
def test_an_unknown_action_is_refused(wrong):
    with pytest.raises(ValueError, match="actions"):
        replay((0, 0, 0, 0), [wrong])
