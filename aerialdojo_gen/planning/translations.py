"""Translations, the edges of a search: 24 directions times three lengths, and up and down.

To fly in a direction the body turns until that direction lies ahead, to its left or to its right, whichever takes
fewer turns.
"""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Ints
from aerialdojo_gen.geometry.motion import N_HEADINGS, QUARTER

# A translation is direction * 3 + step for the horizontal ones, then up 1 and 2 m, down 1 and 2 m.
STEPS_M = np.array([1.0, 3.0, 5.0])
N_STEPS = 3
N_FLAT = N_HEADINGS * N_STEPS
LIFTS_M = np.array([1.0, 2.0, -1.0, -2.0])
N_TRANSLATIONS = N_FLAT + 4
# Directions of a leg beyond the horizontal ones.
UP, DOWN = N_HEADINGS, N_HEADINGS + 1


@njit(cache=True, inline="always")
def turns_between(a: int, b: int) -> int:
    """Fewest turns from heading a to heading b."""
    d = (b - a) % N_HEADINGS
    return min(d, N_HEADINGS - d)


@njit(cache=True, inline="always")
def wrap_heading(heading: int) -> int:
    """Wrap a number from -24 to 23 into 0 to 23, without a division."""
    return heading + N_HEADINGS if heading < 0 else heading


def _best_headings() -> tuple[Ints, Ints]:
    """Turns to the best heading for every direction relative to the heading, and their number; ahead wins ties."""
    by, count = np.zeros(N_HEADINGS, np.int64), np.zeros(N_HEADINGS, np.int64)
    for direction in range(N_HEADINGS):
        options = [direction, (direction - QUARTER) % N_HEADINGS, (direction + QUARTER) % N_HEADINGS]
        turns = [min(d, N_HEADINGS - d) for d in options]
        best = int(np.argmin(turns))
        by[direction], count[direction] = options[best], turns[best]
    return by, count


TURN_BY, N_TURNS = _best_headings()


@njit(cache=True, inline="always")
def fewest_moves(direction: int, metres: int) -> int:
    """Fewest moves that fly a leg."""
    if direction >= N_HEADINGS:
        return (metres + 1) // 2
    rest = metres % 5
    return metres // 5 + rest // 3 + rest % 3


@njit(cache=True, error_model="numpy")
def count_actions(heading: int, goal_heading: int, directions: Ints, metres: Ints) -> int:
    """Number of actions of legs, with the turns before, between and after them and an Approach."""
    count = 1
    for i in range(len(metres)):
        if metres[i] == 0:
            continue
        count += fewest_moves(directions[i], metres[i])
        if directions[i] >= N_HEADINGS:
            continue
        relative = wrap_heading(directions[i] - heading)
        count, heading = count + N_TURNS[relative], wrap_heading(heading + TURN_BY[relative] - N_HEADINGS)
    return count + turns_between(heading, goal_heading)
