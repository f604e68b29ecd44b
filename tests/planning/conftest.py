"""Routes of a town that several files look at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from support.flying import METRES, free_poses, town

from aerialdojo_gen.planning.planner import Planner, Route


class Planned(NamedTuple):
    planner: Planner
    goals: list[np.ndarray]
    starts: list[np.ndarray]  # To each goal
    routes: list[list[Route]]  # Of each goal, from each of its starts
    shortest: list[list[Route]]  # The same by `METRES`

    def rows(self, routes: list[list[Route]] | None = None) -> list[tuple[np.ndarray, np.ndarray, Route]]:
        """Goals, starts and routes."""
        return [
            (goal, start, route)
            for goal, starts, own in zip(self.goals, self.starts, routes or self.routes, strict=True)
            for start, route in zip(starts, own, strict=True)
        ]


@pytest.fixture(scope="session")
def planned() -> Planned:
    """The town's planner, and routes from many starts to a few goals, with the preferences that ship and without."""
    planner, rng = Planner(town(), None, 0.25), np.random.default_rng(10)
    goals = free_poses(planner.grid, rng, 3, room_m=1.0)
    starts = [np.array(free_poses(planner.grid, rng, 25)) for _ in goals]
    routes, shortest = (
        [one.plan_target(goal, own) for goal, own in zip(goals, starts, strict=True)]
        for one in (planner, Planner(town(), METRES, 0.25))
    )
    return Planned(planner, goals, starts, routes, shortest)
