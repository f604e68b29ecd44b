"""Actions of other benchmarks as steps in the body's frame, and as actions of ours.

A step is (forward, left, up, turn): metres and radians, turn counter-clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURN_RAD
from aerialdojo_gen.store.schemas import ACTION_NAMES, APPROACH, STOP, TURN_LEFT, TURN_RIGHT

Floats = NDArray[np.float64]

# How far a recorded move may be from one of ours and still be called by its name.
_SAME_M, _SAME_RAD = 0.25, math.radians(1.0)
_EXACT_M = 1e-5


@dataclass(frozen=True)
class Move:
    """What a foreign action does."""

    name: str  # Its name in the file or, where that has numbers, in the benchmark's documents
    step: tuple[float, float, float, float]  # Forward, left, up in metres; turn in radians, counter-clockwise
    ours: int | None  # The action of ours that does the same; None where none does


def move(name: str, *, forward: float = 0, left: float = 0, up: float = 0, turn_deg: float = 0) -> Move:
    """Describe a foreign action and find the one of ours that does the same."""
    step = (forward, left, up, math.radians(turn_deg))
    if not any(step):
        return Move(name, step, STOP)
    if turn_deg:
        return Move(name, step, {15: TURN_LEFT, -15: TURN_RIGHT}.get(round(turn_deg)))
    same = (a for a in range(STOP + 1, APPROACH) if tuple(DISPLACEMENTS[a]) == step[:3])
    return Move(name, step, next(same, None))


def replay(start: Floats, steps: Floats) -> Floats:
    """Replay steps, (n, 4), from a pose, without a map: poses, (n + 1, 4)."""
    ahead, left, up, turn = steps.T
    yaws = start[3] + np.concatenate([[0.0], np.cumsum(turn)])
    cos, sin = np.cos(yaws[:-1]), np.sin(yaws[:-1])
    moves = np.column_stack([cos * ahead - sin * left, sin * ahead + cos * left, up])
    path = np.concatenate([np.zeros((1, 3)), np.cumsum(moves, axis=0)]) + start[:3]
    return np.column_stack([path, yaws])


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
_OURS = {word: [i for i, name in enumerate(ACTION_NAMES) if name.startswith(p)] for word, (_, _, p) in WORDS.items()}
_SIZES = {
    word: [float(np.abs(DISPLACEMENTS[a]).sum()) or TURN_RAD for a in actions] for word, actions in _OURS.items()
}
_WORD_OF = {a: word for word, actions in _OURS.items() for a in actions}


def words_of(actions: NDArray[np.int8], poses: Floats) -> list[str]:
    """Name what led into each pose in the authors' words; an Approach takes the word of its main body axis."""
    words = ["start"]
    for k, action in enumerate(actions[:-1].tolist()):
        if action != APPROACH:
            words.append(_WORD_OF[action])
            continue
        step = body_steps(poses[k : k + 2])[0, :3]
        # The set has no way back: an approach backwards is named by the next axis.
        ways = {word: sign * float(step[axis]) for word, (axis, sign, _) in WORDS.items() if axis < 3}
        words.append(max(ways, key=lambda word: ways[word]))
    return words


def actions_of(words: Sequence[str], poses: Floats) -> tuple[list[int] | None, float]:
    """Find our actions for the authors' words from the poses, (n, 4), and the replay error in metres."""
    found = body_steps(poses)
    steps = np.zeros_like(found)
    actions: list[int] = []
    for k, word in enumerate(words):
        axis, sign, _ = WORDS[word]
        sizes, along = _SIZES[word], sign * float(found[k, axis])
        nearest = min(range(len(sizes)), key=lambda i: abs(sizes[i] - along))
        steps[k, axis] = sign * sizes[nearest]
        actions.append(_OURS[word][nearest])
    off = found - steps
    off_m = np.sqrt((off[:, :3] ** 2).sum(axis=1))
    same = (off_m <= _SAME_M) & (np.abs(off[:, 3]) <= _SAME_RAD)
    short = len(words) > 0 and float(np.linalg.norm(found[-1, :3])) <= 1.0 + _EXACT_M
    if short and off_m[-1] > _EXACT_M and abs(found[-1, 3]) <= _EXACT_M:
        actions[-1], same[-1] = APPROACH, True
        steps = steps[:-1]
    end = replay(poses[0], steps)[-1, :3]
    error = float(np.linalg.norm(end - poses[len(steps), :3]))
    return ([*actions, STOP] if same.all() else None), error


def replay_error_m(moves: Sequence[Move], poses: Floats) -> float:
    """Metres between the recorded end and that of a replay of foreign actions from the recorded start."""
    steps = np.array([m.step for m in moves], np.float64).reshape(-1, 4)
    return float(np.linalg.norm(replay(poses[0], steps)[-1, :3] - poses[-1, :3]))
