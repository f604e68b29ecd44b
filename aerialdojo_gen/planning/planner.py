"""The planner of a scene: one goal and its starts in, certified reference routes out. It does no I/O."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.config.sections import PlanConfig, SearchAttempt
from aerialdojo_gen.base.constants import RADIUS_M
from aerialdojo_gen.geometry.arrays import Floats, Int32s, Singles
from aerialdojo_gen.geometry.motion import TURN_RAD, nearest_heading
from aerialdojo_gen.planning.attempt import plan_once
from aerialdojo_gen.planning.certify import certify
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import collision_world
from aerialdojo_gen.planning.column_lanes import MIN_CELLS
from aerialdojo_gen.planning.cost_to_go import cost_to_go, costs_at, lengths_at, seed_goal
from aerialdojo_gen.planning.field_cache import FieldCache
from aerialdojo_gen.planning.hybrid_astar import EXHAUSTED, FOUND, SearchArrays, SearchOptions, make_search_arrays
from aerialdojo_gen.planning.preference import Preference, clearance_cost_field
from aerialdojo_gen.planning.query_field import NearField
from aerialdojo_gen.scenes.model import Scene

# The cost-to-go is interpolated between cells, so allow for a small error.
_INTERPOLATION = 1.005
# Few lattice states allow an Approach that flies ahead: a search for the very best one would expand all others.
_GOAL_TOLERANCE_M = 0.15
# Number of growing reaches that a single query tries before the whole field.
_TRIES = 3
# Clearance cost of the longest routes at a weight of 1, metres; 99 in 100 cost less.
_EXTRA_M = 3.0


@dataclass(frozen=True, eq=False)
class Route:
    """The route from one start, or why there is none.

    Attributes
    ----------
    outcome : str
        One of `aerialdojo_gen.base.constants.OUTCOMES`.
    poses : (K + 1, 4) float64
        x, y, z in metres and yaw in (-pi, pi], world frame; no rows unless SOLVED.
    actions : (K + 1,) int8
        Action at every pose, Stop at the last.
    length_m : float
        The paper's L; 0 unless SOLVED.
    expansions : int
        States expanded, all attempts together.
    min_clearance_m : float or None
        Smallest distance from the centre line to any surface; None unless SOLVED.
    cost_to_go_m : float
        Length of the cheapest grid path; infinite where there is none within bounds.
    attempts : int
        Search attempts made.
    """

    outcome: str
    poses: Floats = field(default_factory=lambda: np.empty((0, 4)))
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
    config : PlanConfig, optional
        How to plan; as the paper's dataset was planned where absent.
    radius_m : float
        The body's radius.
    """

    def __init__(self, scene: Scene, config: PlanConfig | None = None, radius_m: float = RADIUS_M) -> None:
        config = config or PlanConfig()
        self.config = config
        self.radius_m = radius_m
        self.world = collision_world(scene)
        self.grid = ClearanceGrid.of(
            scene, cell_m=config.cell_m, radius_m=radius_m, margin_m=config.margin_m, cap_m=config.clearance_cap_m
        )
        self._prefer = Preference(
            config.clearance_preference_m, config.clearance_weight,
            math.cos(math.radians(config.max_approach_angle_deg)), config.approach_detour_m,
        )  # fmt: skip
        self._clearance_cost = clearance_cost_field(self.grid.arrays.field, self._prefer)
        self._cost = self._scratch = np.empty(self.grid.moves.shape, np.float32)
        self._fields = FieldCache(0, 0)
        # A route's final heading is up to half a turn off the goal's yaw, so the grid's Approach may be too.
        angle = min(math.radians(config.max_approach_angle_deg) + TURN_RAD / 2, math.pi)
        self._prefer_on_grid = self._prefer._replace(ahead_cos=math.cos(angle))
        self._longest_m = config.max_length_m * config.length_slack
        self._bound_m = self._longest_m + _EXTRA_M * config.clearance_weight
        self._memory: dict[int, SearchArrays] = {}
        self._blocked_starts: dict[bytes, bool] = {}

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
            One a start, in their order; none depends on the other starts.
        """
        goal_pose, start_poses = _poses(goal, starts)
        return [
            self._search(s, goal_pose, route.cost_to_go_m, self._cost, self.config.ladder)
            if route.outcome == "NOT_NEEDED"
            else route
            for s, route in zip(start_poses, self.estimate_routes(goal_pose, start_poses), strict=True)
        ]

    def plan_one(self, goal: ArrayLike, start: ArrayLike) -> Route:
        """Plan from one start to a goal: the route of `plan_target`, sooner where the goal has no other starts.

        The goal's cost-to-go is computed only where the search needs it (`aerialdojo_gen.planning.query_field`);
        where that does not guarantee the same route, `plan_target` plans it.

        Parameters
        ----------
        goal, start : (4,) float
            x, y, z in metres and yaw in radians, world frame.

        Returns
        -------
        Route
            As `plan_target` returns it.
        """
        goal_pose, (start_pose,) = _poses(goal, start)
        weight = self.config.ladder[0].weight
        low = self.grid.moves.shape[2] < MIN_CELLS
        if low or weight < 1.0 or self.grid.in_collision(goal_pose[:3]) or self._blocked(start_pose):
            return self.plan_target(goal_pose, start_pose)[0]
        c, min_reach_m = self.config, 0.0
        for _ in range(_TRIES):
            found = self._near_field.between(goal_pose, start_pose, min_reach_m)
            if found.cost is None:
                return Route("NO_PATH") if found.unreachable else self.plan_target(goal_pose, start_pose)[0]
            (length,) = self._lengths(start_pose[None], goal_pose, found.cost)
            route = self._estimate(start_pose, goal_pose, float(length))
            if route.outcome != "NOT_NEEDED":
                return route
            route = self._search(start_pose, goal_pose, route.cost_to_go_m, found.cost, c.ladder[:1])
            min_reach_m = float(self._memory[c.ladder[0].budget].highest[0])
            if route.outcome != "SOLVED":
                break
            if min_reach_m <= found.reach_m:
                return route
        return self.plan_target(goal_pose, start_pose)[0]

    def estimate_routes(self, goal: ArrayLike, starts: ArrayLike) -> list[Route]:
        """Estimate the routes to a goal from its cost-to-go alone, without a search.

        Parameters
        ----------
        goal : (4,) float
            x, y, z in metres and yaw in radians, world frame.
        starts : (n, 4) float
            Start poses.

        Returns
        -------
        list of Route
            One a start, in their order. Where a search is needed to say more its outcome is NOT_NEEDED, and
            `cost_to_go_m` predicts the length; any other outcome is what `plan_target` returns too.
        """
        goal_pose, start_poses = _poses(goal, starts)
        if self.grid.in_collision(goal_pose[:3]):
            return [Route("START_IN_COLLISION" if self._blocked(s) else "GOAL_IN_COLLISION") for s in start_poses]
        blocked = [self._blocked(s) for s in start_poses]
        if not all(blocked):
            self._expand(goal_pose)
        values = self._lengths(start_poses, goal_pose, self._cost)
        return [
            Route("START_IN_COLLISION") if b else self._estimate(s, goal_pose, float(v))
            for s, b, v in zip(start_poses, blocked, values, strict=True)
        ]

    @contextmanager
    def keeping_fields(self, plain_mb: float, packed_mb: float) -> Iterator[None]:
        """Cache goals' cost-to-go until the block ends, so that a repeated goal is not expanded again.

        Parameters
        ----------
        plain_mb, packed_mb : float
            Megabytes of raw and of compressed fields; further goals are expanded each time.
        """
        self._fields = FieldCache(plain_mb, packed_mb)
        try:
            yield
        finally:
            self._cost, self._fields = self._scratch, FieldCache(0, 0)

    def cost_to_go(self, points: ArrayLike) -> Floats:
        """Cost-to-go of points, (n, 3) float metres; (n,) float64 metres.

        It is that of the last goal of `plan_target` or `estimate_routes`.
        """
        p = np.ascontiguousarray(np.asarray(points, np.float64).reshape(-1, 3))
        return np.asarray(costs_at(p, self.grid.arrays, self._cost))

    def _blocked(self, start: Floats) -> bool:
        # All goals of a scene share its anchors as starts.
        key = start[:3].tobytes()
        if key not in self._blocked_starts:
            self._blocked_starts[key] = self.grid.in_collision(start[:3])
        return self._blocked_starts[key]

    def _expand(self, goal: Floats) -> None:
        cached = self._fields.find(goal.tobytes(), self._scratch)
        if cached is not None:
            self._cost = cached
            return
        approach_m = self.config.max_approach_m
        self._cost = cost_to_go(
            goal, self.grid, approach_m, self._bound_m, self._longest_m + 2 * approach_m, self._prefer_on_grid,
            self._clearance_cost, self._scratch,
        )  # fmt: skip
        self._fields.store(goal.tobytes(), self._cost)

    @cached_property
    def _near_field(self) -> NearField:
        c, g = self.config, self.grid

        def seed(goal: Floats, cost: Singles) -> Int32s:
            prefer = self._prefer_on_grid
            return np.asarray(seed_goal(*goal, c.max_approach_m, g.radius_m, g.arrays, g.moves, cost, prefer))

        return NearField(g, self._clearance_cost, c.ladder[0].weight, c.max_approach_m, self._bound_m, seed)

    def _lengths(self, starts: Floats, goal: Floats, cost: Singles) -> Floats:
        """Lengths of the cheapest grid paths from starts (n, 4)."""
        points, grid = np.ascontiguousarray(starts[:, :3]), self.grid
        return np.asarray(lengths_at(points, goal[:3], grid.arrays, grid.moves, cost, self._clearance_cost))

    def _estimate(self, start: Floats, goal: Floats, value: float) -> Route:
        if not value <= self._longest_m:
            return Route("NO_PATH")
        # The grid path is collision-free, so the shortest route is no longer: `filter` would reject the task.
        straight = value * _INTERPOLATION < self.config.min_detour_ratio * math.dist(goal[:3], start[:3])
        return Route("NEAR_STRAIGHT" if straight else "NOT_NEEDED", cost_to_go_m=value)

    def _search(
        self, start: Floats, goal: Floats, value: float, cost: Singles, ladder: tuple[SearchAttempt, ...]
    ) -> Route:
        c, g = self.config, self.grid
        heading = nearest_heading(float(start[3]), float(goal[3]))
        expansions = 0
        for number, attempt in enumerate(ladder, start=1):
            memory = self._memory.get(attempt.budget)
            if memory is None:
                memory = self._memory[attempt.budget] = make_search_arrays(attempt.budget)
            options = SearchOptions(
                g.radius_m + attempt.extra_radius_m, attempt.weight, c.action_cost_m, c.max_approach_m,
                attempt.budget, attempt.duplicate_cell_m, attempt.heading_sectors, c.sideways_actions_per_m,
                self._prefer, _GOAL_TOLERANCE_M, attempt.tolerance_growth_m,
            )  # fmt: skip
            result = plan_once(start, goal[:3], heading, cost, g.arrays, memory, options, self.radius_m, g.cap_m)
            expansions += result.expansions
            if result.status != FOUND:
                continue
            # The curtain hangs from the rim only; holes in the ground have none.
            if g.has_curtain and g.below_ground(result.poses[:, :3]):
                continue
            if certify(result.profile, self.radius_m, self.world, c.prove_by_grid):
                return Route(
                    "SOLVED", result.poses, result.actions, result.length, expansions, result.profile.clearance,
                    value, number,
                )  # fmt: skip
        outcome = "NO_PATH" if result.status == EXHAUSTED else "BUDGET_EXHAUSTED"
        return Route(outcome, expansions=expansions, cost_to_go_m=value, attempts=len(ladder))


def _poses(goal: ArrayLike, starts: ArrayLike) -> tuple[Floats, Floats]:
    return np.asarray(goal, np.float64), np.asarray(starts, np.float64).reshape(-1, 4)


def plan(
    scene: Scene, start: ArrayLike, goal: ArrayLike, *, config: PlanConfig | None = None, radius_m: float = RADIUS_M
) -> Route:
    """Plan one trajectory; for several in one scene make a `Planner`, which is where the time goes.

    Parameters
    ----------
    scene : Scene
        World coordinates, metres.
    start, goal : (4,) float
        x, y, z in metres and yaw in radians, world frame.
    config : PlanConfig, optional
        How to plan; as the paper's dataset was planned where absent.
    radius_m : float
        The body's radius.

    Returns
    -------
    Route
        Its outcome says whether there is one; no route is an outcome, not an error.
    """
    return Planner(scene, config, radius_m).plan_one(goal, start)
