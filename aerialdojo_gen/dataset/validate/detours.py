"""Checks that routes are no longer than they need be: their own corners cut short, and a way over a grid.

L is measured in the action set's metric: a free displacement costs |horizontal| + |vertical|. A straight way, or one
over a grid, may be free and yet none that the actions can fly: steps of a metre and turns of 15° do not lead through
every gap. So a route that either of them faults is only suspected, until a search far wider than the planner's own
finds a shorter one that can be flown. The limits lie beyond what a sound release of 42 scenes has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import SearchAttempt
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Rows, SceneData
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.cost_to_go import cost_to_go, costs_at
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.planning.preference import approach_penalty, clearance_penalty
from aerialdojo_gen.store.schemas import APPROACH

_FITS = ("list_lengths_differ", "out_of_bounds", "route_length", "route_collision")
# A piece of a route is a needless one if going straight saves so many metres and so much of the piece, or very many.
# The planner's own pieces go to 1.8 m at 0.37 of the piece, and to 2.6 m at a twentieth of it.
_SAVED_M, _SAVED_SHARE, _SAVED_ANYWAY_M = 1.9, 0.45, 4.0
# The straight way must be free by more than the body: the planner's search keeps margins too.
_ROOM_M = 0.05
# A grid of 1 m cells is fast, and loses passages but never invents them: its path is feasible, not optimal.
_CELL_M, _LONGER_M, _LONGER_SHARE = 1.0, 4.5, 0.1
# The wide search: all but exhaustive (of the planner's own routes 4 % longer at most), a second a route.
_WIDE = SearchAttempt(weight=0.97, budget=400_000, duplicate_cell_m=0.25)
# Of what routes are searched for. The planner's own, where a grid or their corners cast doubt on them, go to 0.14.
_SHORTER_M, _SHORTER_SHARE = 1.0, 0.15


@check("routes", after=_FITS, samples=True)
def needless_piece(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """No piece of a route is flown for nothing: the straight way between its ends is blocked, or hardly shorter."""
    world, room = data.world, data.pipeline.embodiment.radius_m + _ROOM_M
    for row in data.sampled(rows).tolist():
        positions = data.paths.xyz[data.paths.of(row)]
        if not np.isfinite(positions).all():
            continue
        for first, last, flown, straight in _pieces(positions):
            if _straight_is_free(world, positions[first], positions[last], room):
                if _flown_shorter(data, row) is None:
                    break
                found = f"{flown:.2f} m from pose {first} to pose {last}"
                yield Finding(row, found, f"{straight:.2f} m: the straight way is free")
                break


@check("routes", after=(*_FITS, "goal_anchor", "end_position"))
def long_way_round(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """No route is much longer than a way over a grid of 1 m cells, found anew from every goal."""
    paths = data.paths
    goals = rows.floats("goal_x_m", "goal_y_m", "goal_z_m")
    finite = np.isfinite(goals).all(axis=1) & np.isfinite(paths.starts).all(axis=1)
    fit = np.flatnonzero(finite & rows.judged)
    if not len(fit):
        return
    plan, embodiment = data.pipeline.plan, data.pipeline.embodiment
    grid = ClearanceGrid.build(
        data.mesh, cell_m=_CELL_M, radius_m=embodiment.radius_m, margin_m=plan.margin_m,
        cap_m=plan.clearance_cap_m,
    )  # fmt: skip
    longest = float(paths.length_m[fit].max())
    places, owner = np.unique(goals[fit], axis=0, return_inverse=True)
    for g, goal in enumerate(places):
        own = fit[owner.ravel() == g]
        cost = cost_to_go(np.append(goal, 0.0), grid, _CELL_M, longest, longest + 2.0)
        ways = np.asarray(costs_at(np.ascontiguousarray(paths.starts[own, :3]), grid.arrays, cost))
        over = paths.length_m[own] - ways
        for row in own[over > np.maximum(_LONGER_M, _LONGER_SHARE * ways)].tolist():
            if (shorter := _flown_shorter(data, row)) is not None:
                yield Finding(row, f"L = {paths.length_m[row]:.2f} m", f"{shorter:.2f} m, by a wider search")


def _flown_shorter(data: SceneData, row: int) -> float | None:
    """Metres of a route that the wide search finds, where it is clearly better than a row's; else None.

    Clearly is by `_SHORTER_M`, and by a share, of what routes are searched for: metres, and what they cost beside for
    surfaces that they come near and an Approach that does not fly ahead (`aerialdojo_gen.planning.preference`).
    """
    config = data.pipeline.plan.model_copy(update={"ladder": (_WIDE,), "min_detour_ratio": 1.0})
    radius_m = data.pipeline.embodiment.radius_m
    planner = data.cached("wide", lambda: Planner(data.mesh, config, radius_m))
    poses = data.paths.poses(row)
    (route,) = planner.plan_target(poses[-1], [poses[0]])
    if route.outcome != "SOLVED":
        return None
    own = _cost_m(planner, poses, data.paths.action[data.paths.of(row)])
    other = _cost_m(planner, route.poses, route.actions)
    return None if own - other <= max(_SHORTER_M, _SHORTER_SHARE * own) else float(route.length_m)


def _cost_m(planner: Planner, poses: Floats, actions: NDArray[np.integer[Any]]) -> float:
    """What a route costs in the planner's metres: its length, and what it had rather not do."""
    plan, grid = planner.config, planner.grid.arrays
    total = 0.0
    for here, there in pairwise(poses[:, :3].tolist()):
        total += math.dist(here, there) + clearance_penalty(
            *here, *there, plan.clearance_preference_m, plan.clearance_weight, *grid.origin.tolist(), grid.cell,
            grid.field,
        )  # fmt: skip
    if len(actions) > 1 and actions[-2] == APPROACH:
        dx, dy, dz = (poses[-1, :3] - poses[-2, :3]).tolist()
        ahead = math.cos(math.radians(plan.max_approach_angle_deg))
        total += approach_penalty(dx, dy, float(poses[-1, 3]), math.hypot(dx, dy, dz), ahead, plan.approach_detour_m)
    return total


@njit(cache=True)
def _pieces(positions: Floats) -> list[tuple[int, int, float, float]]:
    """Shortest pieces of a route that the straight way would save enough of: first and last pose, flown, straight."""
    n = len(positions)
    along = np.zeros(n)
    for i in range(1, n):
        dx, dy, dz = positions[i] - positions[i - 1]
        along[i] = along[i - 1] + math.sqrt(dx * dx + dy * dy + dz * dz)
    found, end = [(0, 0, 0.0, 0.0) for _ in range(0)], n
    # From the last start backwards: a piece that holds a shorter one is not looked at.
    for first in range(n - 2, -1, -1):
        for last in range(first + 1, end):
            dx, dy, dz = positions[last] - positions[first]
            straight, flown = math.hypot(dx, dy) + abs(dz), along[last] - along[first]
            saved = flown - straight
            if (saved >= _SAVED_M and saved >= _SAVED_SHARE * flown) or saved >= _SAVED_ANYWAY_M:
                found.append((first, last, flown, straight))
                end = last
                break
    return found


def _straight_is_free(world: CollisionWorld, start: Floats, end: Floats, radius: float) -> bool:
    """Whether level flight and a climb, in either order, lead from one place to the other."""
    corners = (np.array([end[0], end[1], start[2]]), np.array([start[0], start[1], end[2]]))
    return any(not world.route_in_collision(np.array([start, corner, end]), radius) for corner in corners)
