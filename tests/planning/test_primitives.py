import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.geometry.frames import wrap_turned_rad
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, N_HEADINGS, TURNS, nearest_heading, replay, route_length_m
from aerialdojo_gen.store import schemas

action = st.integers(0, 16)
pose = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(0, 30), st.floats(-math.pi, math.pi))


def test_the_table_is_the_papers():
    by_name = dict(zip(schemas.ACTION_NAMES, DISPLACEMENTS.tolist(), strict=True))
    assert by_name["MoveForward5"] == [5, 0, 0]
    assert by_name["MoveLeft3"] == [0, 3, 0]
    assert by_name["MoveRight1"] == [0, -1, 0]
    assert by_name["MoveUp2"] == [0, 0, 2]
    assert by_name["MoveDown2"] == [0, 0, -2]
    assert TURNS.tolist() == [0] * 14 + [1, -1, 0]
    assert sorted(np.abs(DISPLACEMENTS).sum(axis=1)) == [0] * 4 + [1] * 5 + [2] * 2 + [3] * 3 + [5] * 3


def test_a_square_flown_by_hand():
    start = (1.0, 2.0, 3.0, math.pi / 2)
    names = ["MoveForward5", *["TurnLeft15"] * 6, "MoveForward3", "MoveLeft1", "MoveRight5", "MoveUp2", "Stop"]
    poses = replay(start, [schemas.ACTION_NAMES.index(n) for n in names])
    assert poses[1] == pytest.approx([1, 7, 3, math.pi / 2])
    assert poses[7] == pytest.approx([1, 7, 3, math.pi])
    assert poses[8] == pytest.approx([-2, 7, 3, math.pi])
    assert poses[9] == pytest.approx([-2, 6, 3, math.pi])
    assert poses[10] == pytest.approx([-2, 11, 3, math.pi])
    assert poses[12] == pytest.approx([-2, 11, 5, math.pi])


@given(pose, st.lists(action, max_size=40))
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


@given(pose, st.lists(action, max_size=40))
def test_length_is_what_the_moves_add_up_to(start, actions):
    expected = np.abs(DISPLACEMENTS[actions]).sum() if actions else 0.0
    assert route_length_m(replay(start, actions)[:, :3]) == pytest.approx(expected, abs=1e-9)


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_nearest_heading_is_within_seven_and_a_half_degrees(start, wanted):
    k = nearest_heading(start, wanted)
    assert 0 <= k < N_HEADINGS
    off = (start + k * math.radians(15) - wanted + math.pi) % (2 * math.pi) - math.pi
    assert abs(off) <= math.radians(7.5) + 1e-9


def test_pi_stays_pi():
    assert wrap_turned_rad(np.array([math.pi, -math.pi, 3 * math.pi])).tolist() == [math.pi] * 3


@pytest.mark.parametrize("wrong", [-1, 17])
def test_an_unknown_action_is_refused(wrong):
    with pytest.raises(ValueError, match="actions"):
        replay((0, 0, 0, 0), [wrong])
