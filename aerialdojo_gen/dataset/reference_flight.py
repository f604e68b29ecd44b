"""The dataset's self-test: an agent that flies a reference trajectory succeeds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.planning.flight_space import FlightSpace, Point
from aerialdojo_gen.store.schemas import APPROACH

# Least SPL of a reference that is flown exactly; the Approach is not flown.
LEAST_SPL = 0.99


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


def shortcoming(episode: Episode, length_m: float, radius_m: float) -> str:
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
    return "" if spl >= LEAST_SPL else f"{episode.path_length_m:.3f} m flown, {length_m:.3f} m told: SPL {spl:.3f}"
