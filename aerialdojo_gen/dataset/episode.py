"""One episode, as the evaluator sees it: where the body is, how far from the goal, and whether it is over.

The dataset's self-test flies reference trajectories in it: an agent that does so succeeds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from aerialdojo_gen.geometry.frames import wrap_one_rad
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURN_RAD, TURNS
from aerialdojo_gen.planning.flight_space import FlightSpace, Point
from aerialdojo_gen.store.schemas import APPROACH, STOP

# Plain numbers: numpy's scalars would cost more than the motion itself.
_MOVES = [tuple(row) for row in DISPLACEMENTS.tolist()]
_TURNS = TURNS.tolist()

# Least SPL of a reference that is flown exactly; the Approach is not flown.
MIN_SPL = 0.99


class Episode:
    """An episode under way.

    It ends by Stop, by a collision or with the last action of the budget (paper: termination), and by the first of
    these that an action brings about: the last action may be a Stop or a collision, and is then judged as such. An
    episode that starts in collision ends in collision at its first action, whichever that is, Stop too.
    """

    __slots__ = (
        "_budget", "_goal", "_heading", "_space", "_start_yaw", "_starts_free", "distance_m", "horizontal_distance_m",
        "min_distance_m", "min_horizontal_distance_m", "n_actions", "n_invalid", "n_refused", "path_length_m",
        "position", "refused", "stop_called", "termination",
    )  # fmt: skip

    def __init__(
        self, space: FlightSpace, start: tuple[float, float, float, float], goal: Point, action_budget: int
    ) -> None:
        if action_budget < 1:
            raise ValueError(f"an episode has at least one action, not {action_budget}")
        self._space, self._goal, self._budget = space, goal, action_budget
        self.position: Point = (start[0], start[1], start[2])
        self._start_yaw, self._heading = start[3], 0
        self._starts_free = not space.in_collision(self.position)
        self.n_actions = self.n_refused = self.n_invalid = 0
        self.path_length_m = 0.0
        self.min_distance_m = self.min_horizontal_distance_m = math.inf
        self.termination: str | None = None
        self.stop_called = self.refused = False
        self._measure()

    @property
    def yaw_rad(self) -> float:
        """Yaw, radians, in (-pi, pi], counted from the start's as `aerialdojo_gen.geometry.motion.replay` does."""
        return wrap_one_rad(self._start_yaw + self._heading * TURN_RAD)

    @property
    def remaining_actions(self) -> int:
        """Actions left, Stop included."""
        return self._budget - self.n_actions

    def success(self, radius_m: float) -> bool:
        """Whether it ended with a Stop at most `radius_m` from the goal, without collision (paper: success)."""
        return self.termination == "stop" and self.distance_m <= radius_m

    def step(self, action: int | None) -> None:
        """Spend an action."""
        if self.termination is not None:
            raise RuntimeError(f"the episode is over ({self.termination}): begin another")
        if action is not None and not 0 <= action < APPROACH:
            raise ValueError(f"actions are numbers from 0 to {APPROACH - 1}, not {action}")
        self.n_actions += 1
        self.refused = False
        self.stop_called = action == STOP
        if not self._starts_free:
            self.termination = "collision"
        elif action is None:
            self.n_invalid += 1
        elif action == STOP:
            self.termination = "stop"
        elif _TURNS[action]:
            self._heading += _TURNS[action]
        else:
            self._move(action)
        if self.termination is None and self.n_actions >= self._budget:
            self.termination = "budget"

    def _move(self, action: int) -> None:
        ahead, left, up = _MOVES[action]
        yaw = self._start_yaw + self._heading * TURN_RAD
        cos, sin = math.cos(yaw), math.sin(yaw)
        x, y, z = before = self.position
        wanted = (x + cos * ahead - sin * left, y + sin * ahead + cos * left, z + up)
        self.position, collision, self.refused = self._space.fly(before, wanted)
        if self.refused:
            self.n_refused += 1
            return
        self.path_length_m += math.dist(before, self.position)
        self._measure()
        if collision:
            self.termination = "collision"

    def _measure(self) -> None:
        (x, y, z), (goal_x, goal_y, goal_z) = self.position, self._goal
        dx, dy, dz = x - goal_x, y - goal_y, z - goal_z
        self.horizontal_distance_m = math.hypot(dx, dy)
        self.distance_m = math.sqrt(dx * dx + dy * dy + dz * dz)
        self.min_distance_m = min(self.min_distance_m, self.distance_m)
        self.min_horizontal_distance_m = min(self.min_horizontal_distance_m, self.horizontal_distance_m)


class Reference(NamedTuple):
    """A navigation task with its reference trajectory."""

    start: tuple[float, float, float, float]  # x, y, z in metres, world frame, and yaw in radians
    goal: Point  # Position of the goal anchor, metres, world frame
    action_budget: int  # Most actions, Stop included
    length_m: float  # Recorded length of the trajectory
    actions: Sequence[int]  # Of the trajectory; an Approach among them is not flown, for agents have none


def fly(space: FlightSpace, reference: Reference) -> Episode:
    """Fly a reference trajectory by the motion and collision of the environment, up to the episode's end."""
    episode = Episode(space, reference.start, reference.goal, reference.action_budget)
    for action in reference.actions:
        if episode.termination is None and action != APPROACH:
            episode.step(action)
    return episode


def spl_fault(episode: Episode, length_m: float, radius_m: float) -> str:
    """Say why a flown reference is no success (SR, OSR, CR, SPL); empty where it is one. Lengths in metres."""
    if episode.termination == "collision":
        x, y, z = episode.position
        return f"a collision at action {episode.n_actions}, at ({x:.2f}, {y:.2f}, {z:.2f}) m"
    if episode.n_refused:
        return f"{episode.n_refused} actions that would leave the flight volume"
    if episode.termination != "stop":
        spent = f"{episode.n_actions} actions"
        return f"no Stop within the budget of {spent}" if episode.termination else f"no Stop in its {spent}"
    if not episode.success(radius_m):
        return f"a Stop {episode.distance_m:.3f} m from the goal"
    # A length of 0 asks for none.
    spl = length_m / max(length_m, episode.path_length_m) if length_m else 1.0
    return "" if spl >= MIN_SPL else f"{episode.path_length_m:.3f} m flown, {length_m:.3f} m told: SPL {spl:.3f}"
