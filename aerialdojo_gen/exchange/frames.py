"""Frames, poses and actions of foreign task files, and the one way from each into ours.

World: x east, y north, z up, metres; yaw counter-clockwise from +x. All frames here are right-handed, so that a way
between them is a turn: distances, angles and handedness stay. A step is (forward, left, up, turn) in the frame of the
body: metres and radians, turn counter-clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.geometry.frames import quaternion_xyzw_to_yaw, wrap_angle_rad, yaw_to_quaternion_xyzw
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURN_RAD, TURNS
from aerialdojo_gen.store.schemas import ACTION_NAMES, APPROACH, STOP

Floats = NDArray[np.float64]

_DIRECTIONS = {"e": (1, 0, 0), "w": (-1, 0, 0), "n": (0, 1, 0), "s": (0, -1, 0), "u": (0, 0, 1), "d": (0, 0, -1)}


@dataclass(frozen=True)
class Frame:
    """A right-handed frame; what is said of yaws holds where its z axis is vertical."""

    name: str  # Where its x, y and z axes point, e.g. ``ned`` for north, east, down

    @cached_property
    def matrix(self) -> Floats:
        """(3, 3) float64: world = matrix @ frame; a turn."""
        return np.array([_DIRECTIONS[letter] for letter in self.name], np.float64).T

    def positions_to_world(self, xyz_m: ArrayLike) -> Floats:
        """Turn positions, (..., 3) metres, into the world; exact, as it only reorders and changes signs."""
        return np.asarray(np.asarray(xyz_m, np.float64) @ self.matrix.T + 0.0)

    def positions_from_world(self, xyz_m: ArrayLike) -> Floats:
        """Turn world positions, (..., 3) metres, into the frame: the inverse of `positions_to_world`."""
        return np.asarray(np.asarray(xyz_m, np.float64) @ self.matrix + 0.0)

    @cached_property
    def _sense_and_turn(self) -> tuple[np.float64, np.float64]:
        """Which way the frame's yaws count, 1 or -1, and the world yaw of its x axis."""
        m = self.matrix
        return m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0], np.arctan2(m[1, 0], m[0, 0])

    def yaw_to_world(self, yaw_rad: ArrayLike) -> Floats:
        """Turn yaws about the frame's own z axis, counted from its x towards its y, into world yaws in (-π, π]."""
        sense, turn = self._sense_and_turn
        return wrap_angle_rad(sense * np.asarray(yaw_rad, np.float64) + turn)

    def quaternion_to_world_yaw(self, quaternion_xyzw: ArrayLike) -> Floats:
        """World yaw of attitudes, (..., 4) xyzw of any length but zero: where the body's x axis points."""
        return self.yaw_to_world(quaternion_xyzw_to_yaw(quaternion_xyzw))

    def quaternion_from_world_yaw(self, yaw_rad: ArrayLike) -> Floats:
        """Attitudes, (..., 4) unit xyzw in the frame, of upright bodies with these world yaws."""
        sense, turn = self._sense_and_turn
        return yaw_to_quaternion_xyzw(wrap_angle_rad(sense * (np.asarray(yaw_rad, np.float64) - turn)))


FRAMES = {name: Frame(name) for name in ("enu", "nwu", "ned", "esd")}
NED = FRAMES["ned"]
HABITAT = Frame("eus")  # Its y axis is the vertical one


def yaw_to_habitat_quaternion_xyzw(yaw_rad: ArrayLike) -> Floats:
    """Attitudes, (..., 4) unit xyzw, of upright bodies in Habitat, where a body at rest looks along -z (north)."""
    return yaw_to_quaternion_xyzw(np.asarray(yaw_rad, np.float64) - np.pi / 2)[..., [0, 2, 1, 3]]


# What our actions do, (17, 4) float64: steps.
_STEPS = np.column_stack([DISPLACEMENTS, TURNS * TURN_RAD])
_UNITS = {
    "forward": (1, 0, 0, 0), "left": (0, 1, 0, 0), "right": (0, -1, 0, 0), "up": (0, 0, 1, 0), "down": (0, 0, -1, 0),
    "turn left": (0, 0, 0, math.radians(1)), "turn right": (0, 0, 0, -math.radians(1)),
}  # fmt: skip
# How far a recorded move may be from one of ours and still be called by its name.
_SAME_M, _SAME_RAD = 0.25, math.radians(1.0)
_EXACT_M = 1e-5


@dataclass(frozen=True)
class Move:
    """What a foreign action does."""

    name: str  # Its name in the file or, where that has numbers, in the benchmark's documents
    step: Floats  # (4,) float64
    ours: int | None  # The action of ours that does the same; None where none does


def move(name: str) -> Move:
    """Describe a foreign action, such as ``forward 5 m``, ``turn left 15°`` or ``stop``."""
    direction, _, size = name.removesuffix(" m").removesuffix("°").rpartition(" ")
    step = np.multiply(_UNITS[direction], float(size)) if direction else np.zeros(4)
    same = np.flatnonzero(np.isclose(_STEPS, step).all(axis=1))
    return Move(name, step, int(same[0]) if len(same) else None)


def replay(start: Floats, steps: Floats) -> Floats:
    """Replay steps, (n, 4), from a pose, without a map: poses, (n + 1, 4)."""
    ahead, left, up, turn = steps.T
    yaws = start[3] + np.concatenate([[0.0], np.cumsum(turn)])
    cos, sin = np.cos(yaws[:-1]), np.sin(yaws[:-1])
    moves = np.column_stack([cos * ahead - sin * left, sin * ahead + cos * left, up])
    path = np.concatenate([np.zeros((1, 3)), np.cumsum(moves, axis=0)]) + start[:3]
    return np.column_stack([path, yaws])


def replay_moves(start: Floats, moves: Sequence[Move]) -> Floats:
    """Replay foreign actions from a pose: poses, (n + 1, 4)."""
    return replay(start, np.array([m.step for m in moves], np.float64).reshape(-1, 4))


def body_steps(poses: Floats) -> Floats:
    """Say what happens between consecutive poses, (n, 4), in the body's frame: (n - 1, 4) steps."""
    d = np.diff(poses[:, :3], axis=0)
    cos, sin = np.cos(poses[:-1, 3]), np.sin(poses[:-1, 3])
    turn = wrap_angle_rad(np.diff(poses[:, 3]))
    return np.column_stack([cos * d[:, 0] + sin * d[:, 1], cos * d[:, 1] - sin * d[:, 0], d[:, 2], turn])


# The words of the authors' layout: the axis of a step, which way along it, and how the names of ours begin.
WORDS: Mapping[str, tuple[int, int, str]] = {
    "forward": (0, 1, "MoveForward"), "left": (1, 1, "MoveLeft"), "right": (1, -1, "MoveRight"),
    "ascend": (2, 1, "MoveUp"), "descend": (2, -1, "MoveDown"), "rotl": (3, 1, "TurnLeft"),
    "rotr": (3, -1, "TurnRight"),
}  # fmt: skip
_ACTIONS = {
    word: [i for i, name in enumerate(ACTION_NAMES) if name.startswith(p)] for word, (_, _, p) in WORDS.items()
}
_WORD_OF = {a: word for word, actions in _ACTIONS.items() for a in actions}


def words_of(actions: NDArray[np.int8], poses: Floats) -> list[str]:
    """Name what led into each pose in the authors' words; an Approach takes the word of its main body axis."""
    words = ["start"]
    for k, action in enumerate(actions[:-1].tolist()):
        if action != APPROACH:
            words.append(_WORD_OF[action])
            continue
        step = body_steps(poses[k : k + 2])[0, :3]
        # The set has no way back: an approach backwards is named by the next axis.
        along = {word: sign * float(step[axis]) for word, (axis, sign, _) in WORDS.items() if axis < 3}
        words.append(max(along, key=lambda word: along[word]))
    return words


def actions_of(words: Sequence[str], poses: Floats) -> tuple[list[int] | None, float]:
    """Find our actions for the authors' words from the poses, (n, 4), and the replay error in metres."""
    recorded = body_steps(poses)
    actions: list[int] = []
    for word, step in zip(words, recorded, strict=True):
        axis = WORDS[word][0]
        actions.append(min(_ACTIONS[word], key=lambda a: abs(_STEPS[a, axis] - step[axis])))
    steps = _STEPS[actions]
    off = recorded - steps
    off_m = np.sqrt((off[:, :3] ** 2).sum(axis=1))
    same = (off_m <= _SAME_M) & (np.abs(off[:, 3]) <= _SAME_RAD)
    short = len(words) > 0 and float(np.linalg.norm(recorded[-1, :3])) <= 1.0 + _EXACT_M
    if short and off_m[-1] > _EXACT_M and abs(recorded[-1, 3]) <= _EXACT_M:
        actions[-1], same[-1] = APPROACH, True
        steps = steps[:-1]
    end = replay(poses[0], steps)[-1, :3]
    error = float(np.linalg.norm(end - poses[len(steps), :3]))
    return ([*actions, STOP] if same.all() else None), error
