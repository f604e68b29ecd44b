"""The frames of foreign task files, with an exact way back, and their actions: which of ours do the same."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aerialdojo_gen.exchange import frames as foreign
from aerialdojo_gen.exchange.frames import FRAMES, HABITAT, actions_of, move, words_of
from aerialdojo_gen.exchange.readers import AERIALVLN_MOVES as AERIALVLN
from aerialdojo_gen.exchange.readers import OPENFLY_MOVES as OPENFLY
from aerialdojo_gen.geometry import motion
from aerialdojo_gen.store.schemas import ACTION_NAMES, APPROACH

frames = st.sampled_from(list(FRAMES.values()))
coordinates = st.floats(-1e5, 1e5, allow_subnormal=False)
points = st.tuples(coordinates, coordinates, coordinates)
yaws = st.floats(-math.pi, math.pi)


def rotate(quaternion_xyzw, vector):
    return Rotation.from_quat(quaternion_xyzw).apply(vector)


def forward(yaw):
    return np.array([math.cos(yaw), math.sin(yaw), 0.0])


@given(frames, points)
def test_positions_come_back_to_the_last_bit(frame, point):
    assert frame.positions_to_world(frame.positions_from_world(point)).tolist() == list(point)
    x, y, z = HABITAT.positions_from_world(point)
    assert [x, -z, y] == list(point)


@given(frames, yaws)
def test_an_attitude_looks_the_same_way_in_both_frames(frame, yaw):
    quaternion = frame.quaternion_from_world_yaw(yaw)
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-12)
    assert frame.matrix @ rotate(quaternion, [1, 0, 0]) == pytest.approx(forward(yaw), abs=1e-12)
    back = float(frame.quaternion_to_world_yaw(quaternion))
    assert abs(math.remainder(back - yaw, 2 * math.pi)) < 1e-9
    assert -math.pi < back <= math.pi


@given(yaws)
def test_habitats_bodies_look_along_minus_z(yaw):
    quaternion = foreign.yaw_to_habitat_quaternion_xyzw(yaw)
    assert rotate(quaternion, [0, 0, -1]) == pytest.approx(HABITAT.positions_from_world(forward(yaw)), abs=1e-12)
    # Up stays up, left stays left.
    assert rotate(quaternion, [0, 1, 0]) == pytest.approx(HABITAT.positions_from_world([0, 0, 1]), abs=1e-12)
    assert rotate(quaternion, [-1, 0, 0]) == pytest.approx(
        HABITAT.positions_from_world(forward(yaw + math.pi / 2)), abs=1e-12
    )


@pytest.mark.parametrize("name", FRAMES)
def test_axes_point_where_the_letters_of_the_name_say(name):
    """Which makes each frame a turn that keeps handedness."""
    ways = {"e": [1, 0, 0], "w": [-1, 0, 0], "n": [0, 1, 0], "s": [0, -1, 0], "u": [0, 0, 1], "d": [0, 0, -1]}
    axes = FRAMES[name].positions_to_world(np.eye(3))
    assert axes.tolist() == [ways[letter] for letter in name]
    assert np.linalg.det(axes) == 1.0


starts = st.tuples(st.floats(-500, 500), st.floats(-500, 500), st.floats(0, 60), st.floats(-math.pi, math.pi))
action_lists = st.lists(st.integers(1, APPROACH - 1), min_size=1, max_size=40)
directions = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)).filter(
    lambda v: 0.05 < np.linalg.norm(v) <= 1
)


@given(starts, action_lists, st.none() | directions)
def test_words_and_poses_give_the_actions_back_and_an_approach_at_the_end(start, actions, direction):
    poses, flown = motion.replay(start, actions), [*actions, 0]
    if direction is not None:
        end = poses[-1].copy()
        end[:3] += direction
        poses, flown = np.vstack([poses, end]), [*actions, APPROACH, 0]
    words = words_of(np.array(flown, np.int8), poses)
    assert words[0] == "start"
    found, error = actions_of(words[1:], poses)
    assert error < (1e-9 if direction is None else 1e-4)
    if found != flown:
        # A straight metre forward, left, right, up or down is the move of that size, and is called so.
        assert found == [*actions, found[-2], 0]
        assert np.allclose(motion.replay(poses[-2], [found[-2]])[-1, :3], poses[-1, :3], atol=1e-4)
        assert direction is not None


def test_the_approach_takes_the_word_of_its_longest_axis():
    poses = np.array([[0, 0, 5, math.pi / 2], [0.2, 0.6, 4.7, math.pi / 2]])
    assert words_of(np.array([APPROACH, 0], np.int8), poses) == ["start", "forward"]
    assert words_of(np.array([APPROACH, 0], np.int8), poses * [1, -1, 1, 1]) == ["start", "descend"]


def test_a_move_of_another_size_is_none_of_ours_but_is_replayed():
    poses = np.array([[0, 0, 5, 0.0], [2.0, 0, 5, 0.0], [5.0, 0, 5, 0.0]])
    found, error = actions_of(["forward", "forward"], poses)
    assert found is None
    # 1 m is the nearest of ours to 2 m: the replay ends 1 m short.
    assert error == pytest.approx(1.0)


def test_actions_that_do_the_same_are_found():
    names = ["Stop", "MoveForward5", "TurnLeft15", "TurnRight15", "MoveUp2", "MoveDown2", "MoveLeft5", "MoveRight5"]
    assert [ACTION_NAMES[AERIALVLN[number].ours] for number in range(8)] == names
    assert {number for number, m in OPENFLY.items() if m.ours is None} == {2, 3, 4, 5, 8, 9}
    assert move("turn left 30°").ours is None


@given(starts, action_lists)
def test_replay_agrees_with_that_of_the_planner(start, actions):
    steps = np.column_stack([motion.DISPLACEMENTS[actions], motion.TURNS[actions] * motion.TURN_RAD])
    mine, theirs = foreign.replay(start, steps), motion.replay(start, actions)
    assert np.abs(mine[:, :3] - theirs[:, :3]).max() < 1e-9
    assert np.abs(np.exp(1j * mine[:, 3]) - np.exp(1j * theirs[:, 3])).max() < 1e-9
