"""The planner of a scene: one goal and its starts in, certified reference routes out. It does no I/O."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.config import PlanConfig
from aerialdojo_gen.planning.certify import certify
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.cost_to_go import columns_by_distance, cost_at, expand_cost, seed_goal
from aerialdojo_gen.planning.hybrid_astar import (
    EXHAUSTED,
    FOUND,
    SearchArrays,
    SearchOptions,
    make_search_arrays,
    search,
)
from aerialdojo_gen.planning.primitives import nearest_heading, replay, route_length_m
from aerialdojo_gen.planning.refine import moves_to_actions
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.schemas import APPROACH, STOP

# A goal nearer than this is met already, and needs no Approach.
_ON_GOAL_M = 1e-9
# Between cells the cost-to-go is interpolated: a little more than it is taken for what it promises.
_INTERPOLATION = 1.005


@dataclass(frozen=True, eq=False)
class Route:
    """What became of one start.

    Attributes
    ----------
    outcome : str
        One of `aerialdojo_gen.schemas.OUTCOMES`.
    poses : (K + 1, 4) float64
        x, y, z in metres and yaw in (-pi, pi], world frame; no rows unless SOLVED.
    actions : (K + 1,) int8
        What is done at every pose, Stop at the last.
    length_m : float
        The paper's L; 0 unless SOLVED.
    expansions : int
        States expanded, all attempts together.
    min_clearance_m : float or None
        Smallest distance from the centre line to any surface; None unless SOLVED.
    cost_to_go_m : float
        Length of the shortest grid path; infinite where there is none within bounds.
    attempts : int
        Rungs of the ladder that were tried.
    """

    outcome: str
    poses: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4)))
    actions: NDArray[np.int8] = field(default_factory=lambda: np.empty(0, np.int8))
    length_m: float = 0.0
    expansions: int = 0
    min_clearance_m: float | None = None
    cost_to_go_m: float = float("inf")
    attempts: int = 0

    @property
    def n_actions(self) -> int:
        """Number of actions, Stop included."""
        return len(self.actions)


class Planner:
    """Plans in one scene; builds its collision world and clearance grid once.

    Parameters
    ----------
    scene : Scene
        World coordinates, metres.
    config : PlanConfig
        How to plan.
    radius_m : float
        The body's radius.
    """

    def __init__(self, scene: Scene, config: PlanConfig, radius_m: float) -> None:
        self.config = config
        self.radius_m = radius_m
        self.world = CollisionWorld(scene)
        self.grid = ClearanceGrid.build(
            scene, cell_m=config.cell_m, radius_m=radius_m, margin_m=config.margin_m, cap_m=config.clearance_cap_m
        )
        self._cost = np.empty(self.grid.moves.shape, np.float32)
        self._order = columns_by_distance(
            math.ceil((config.max_length_m * config.length_slack + 2 * config.max_approach_m) / config.cell_m)
        )
        self._memory: dict[int, SearchArrays] = {}

    def plan_target(self, goal: ArrayLike, starts: ArrayLike) -> list[Route]:
        """Plan from every start to one goal.

        Parameters
        ----------
        goal : (4,) float
            x, y, z in metres and yaw in radians, world frame.
        starts : (n, 4) float
            Start poses.

        Returns
        -------
        list of Route
            One a start, in their order. The cost-to-go ends a little beyond the farthest start, so that a route may
            in principle depend on the other starts too: plan a target's starts together.
        """
        target = np.asarray(goal, np.float64)
        begins = np.asarray(starts, np.float64).reshape(-1, 4)
        if self.grid.in_collision(target[:3]):
            return [Route("START_IN_COLLISION" if self._blocked(s) else "GOAL_IN_COLLISION") for s in begins]
        blocked = [self._blocked(s) for s in begins]
        free = begins[[not b for b in blocked]]
        if len(free):
            self._expand(target[:3], np.ascontiguousarray(free[:, :3]))
        return [
            Route("START_IN_COLLISION") if b else self._plan(s, target) for s, b in zip(begins, blocked, strict=True)
        ]

    def cost_to_go(self, points: ArrayLike) -> NDArray[np.float64]:
        """Cost-to-go of points, (n, 3) float metres, to the goal that was planned for last; (n,) float64 metres."""
        p = np.asarray(points, np.float64).reshape(-1, 3)
        return np.array([cost_at(x, y, z, self.grid.arrays, self._cost) for x, y, z in p])

    def _blocked(self, start: NDArray[np.float64]) -> bool:
        return self.grid.in_collision(start[:3])

    def _expand(self, goal: NDArray[np.float64], starts: NDArray[np.float64]) -> None:
        c, g = self.config, self.grid
        self._cost.fill(np.inf)
        seeds = seed_goal(*goal, c.max_approach_m, g.radius_m, g.arrays, g.moves, self._cost)
        expand_cost(seeds, self._order, c.max_length_m * c.length_slack, g.arrays.cell, g.moves, self._cost)

    def _plan(self, start: NDArray[np.float64], goal: NDArray[np.float64]) -> Route:
        c = self.config
        value = float(cost_at(*start[:3], self.grid.arrays, self._cost))
        if not value <= c.max_length_m * c.length_slack:
            return Route("NO_PATH")
        # The grid path is free of collision, so that the shortest route is no longer: a task that filter refuses.
        if value * _INTERPOLATION < c.min_detour_ratio * float(np.linalg.norm(goal[:3] - start[:3])):
            return Route("NEAR_STRAIGHT", cost_to_go_m=value)
        heading = nearest_heading(float(start[3]), float(goal[3]))
        expansions = 0
        for attempt, rung in enumerate(c.ladder, start=1):
            memory = self._memory.get(rung.budget)
            if memory is None:
                memory = self._memory[rung.budget] = make_search_arrays(rung.budget)
            radius = self.grid.radius_m + rung.extra_radius_m
            options = SearchOptions(
                radius, rung.weight, c.action_cost_m, c.max_approach_m, rung.budget,
                rung.duplicate_cell_m, rung.heading_sectors,
            )  # fmt: skip
            status, n, moves = search(start, goal[:3], heading, self._cost, self.grid.arrays, memory, options)
            expansions += n
            if status != FOUND:
                continue
            actions = moves_to_actions(start, moves, heading, radius, self.grid.arrays)
            route = self._route(start, goal, actions, expansions, value, attempt)
            if route is not None:
                return route
        outcome = "NO_PATH" if status == EXHAUSTED else "BUDGET_EXHAUSTED"
        return Route(outcome, expansions=expansions, cost_to_go_m=value, attempts=len(c.ladder))

    def _route(
        self, start: NDArray[np.float64], goal: NDArray[np.float64], actions: NDArray[np.int8], expansions: int,
        value: float, attempt: int,
    ) -> Route | None:  # fmt: skip
        poses = replay(start, actions)
        if np.linalg.norm(poses[-1, :3] - goal[:3]) > _ON_GOAL_M:
            poses = np.concatenate([poses, [[*goal[:3], poses[-1, 3]]]])
            actions = np.append(actions, np.int8(APPROACH))
        else:
            poses[-1, :3] = goal[:3]
        certificate = certify(poses[:, :3], self.radius_m, self.grid, self.world, self.config.prove_by_grid)
        if not certificate.collision_free:
            return None
        return Route(
            "SOLVED", poses, np.append(actions, np.int8(STOP)), route_length_m(poses[:, :3]), expansions,
            certificate.min_clearance_m, value, attempt,
        )  # fmt: skip
