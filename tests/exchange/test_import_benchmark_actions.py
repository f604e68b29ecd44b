"""Actions of others: what they do, and which of ours do the same."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerialdojo_gen.exchange.actions import actions_of, move, replay, words_of
from aerialdojo_gen.exchange.readers import AERIALVLN_MOVES as AERIALVLN
from aerialdojo_gen.exchange.readers import OPENFLY_MOVES as OPENFLY
from aerialdojo_gen.geometry import motion
from aerialdojo_gen.store.schemas import ACTION_NAMES, APPROACH

starts = st.tuples(st.floats(-500, 500), st.floats(-500, 500), st.floats(0, 60), st.floats(-math.pi, math.pi))
action_lists = st.lists(st.integers(1, APPROACH - 1), min_size=1, max_size=40)
directions = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)).filter(
    lambda v: 0.05 < np.linalg.norm(v) <= 1
)


@settings(deadline=None)
@given(starts, action_lists)
def test_words_and_poses_give_the_actions_back(start, actions):
    poses = motion.replay(start, actions)
    words = words_of(np.array([*actions, 0], np.int8), poses)
    assert words[0] == "start"
    found, error = actions_of(words[1:], poses)
    assert found == [*actions, 0]
    assert error < 1e-9


@settings(deadline=None)
@given(starts, action_lists, directions)
def test_an_approach_comes_back_as_one(start, actions, direction):
    poses = motion.replay(start, actions)
    end = poses[-1].copy()
    end[:3] += direction
    poses = np.vstack([poses, end])
    words = words_of(np.array([*actions, APPROACH, 0], np.int8), poses)
    found, error = actions_of(words[1:], poses)
    # A straight metre forward, left, right, up or down is the move of that size, and is called so.
    replayed = motion.replay(poses[-2], [found[-2]])[-1]
    assert found[:-2] == actions
    assert found[-2] == APPROACH or np.allclose(replayed[:3], end[:3], atol=1e-4)
    assert error < 1e-4


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
    ours = {number: m.ours for number, m in AERIALVLN.items()}
    names = {number: ACTION_NAMES[a] for number, a in ours.items()}
    assert names == {
        0: "Stop", 1: "MoveForward5", 2: "TurnLeft15", 3: "TurnRight15", 4: "MoveUp2", 5: "MoveDown2", 6: "MoveLeft5",
        7: "MoveRight5",
    }  # fmt: skip
    assert {number for number, m in OPENFLY.items() if m.ours is None} == {2, 3, 4, 5, 8, 9}
    assert move("turn left 30°", turn_deg=30).ours is None


@settings(deadline=None)
@given(starts, action_lists)
def test_replay_agrees_with_that_of_the_planner(start, actions):
    steps = np.column_stack([motion.DISPLACEMENTS[actions], motion.TURNS[actions] * motion.TURN_RAD])
    mine, theirs = replay(start, steps), motion.replay(start, actions)
    assert np.abs(mine[:, :3] - theirs[:, :3]).max() < 1e-9
    assert np.abs(np.exp(1j * mine[:, 3]) - np.exp(1j * theirs[:, 3])).max() < 1e-9
