"""Checks that fly the routes again: FCL sweeps every leg, and an agent that does what a route says succeeds.

No clearance grid takes part in the sweeps. FCL's answers take less time than the grid takes to be built, and so a
fault of the grid, which the planner searched by, cannot hide here. The oracle agent flies the reference trajectories,
and so do the references as an agent can fly them (`agent_action`), which besides end where the target is seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from aerialdojo_gen.base.constants import NEAR_GOAL_M, SUCCESS_RADIUS_M
from aerialdojo_gen.dataset.episode import MIN_SPL, Reference, fly, spl_fault
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import ALWAYS_AFTER, START, Floats, Mask, Rows, SceneData, place_text
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.planning.certify import corners
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.flight_space import FlightSpace
from aerialdojo_gen.rendering.casters import all_in_sight
from aerialdojo_gen.store.schemas import APPROACH, STOP

_FITS = ("list_lengths_differ", "out_of_bounds")
# FCL's tolerance for a capsule against a triangle is well below this.
_CLEARANCE_M = 1e-4
_HALVINGS = 14
# These faults make an episode fail too, and are reported by their own checks.
_ROUTE_FAULTS = (
    "list_lengths_differ", "action_order", "route_length", "keeping_rule", "out_of_bounds", "route_without_task",
    "replay_differs", "goal_anchor", "stops_far", "route_collision", "replay_collision",
)  # fmt: skip
_TASK_FAULTS = ("telling_number", "task_start", "task_budget", "task_setting", "instances_agree")
_EXPECTED = f"a success at {SUCCESS_RADIUS_M:g} m, SPL {MIN_SPL:g} or more"
# A stored position is the replay's to this much; it may make of the metre a little more.
_REPLAY_M = 1e-5


@check("routes", after=_FITS, samples=True)
def route_collision(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The body's sweep along the stored positions touches no surface (FCL, a capsule a leg)."""
    world, radius, cap = data.world, data.pipeline.embodiment.radius_m, data.pipeline.plan.clearance_cap_m
    bodies = rows.floats("min_clearance_m") - _CLEARANCE_M
    wide = _free_as_stored(data)
    for row in data.sampled(rows).tolist():
        legs = corners(data.paths.xyz[data.paths.of(row)])
        # Where a body as thick as the stored clearance passes, so does the drone's: one sweep for two checks.
        wide[row] = radius <= bodies[row] <= cap and not world.route_in_collision(legs, float(bodies[row]))
        if not wide[row] and (hit := _hit(world, legs, radius)):
            yield Finding(row, f"the body touches a surface {hit}", "a free sweep")


@check("routes", after=(*_FITS, "action_order", "replay_differs", "route_collision"), samples=True)
def replay_collision(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The body's sweep along the replayed actions touches no surface."""
    world, radius = data.world, data.pipeline.embodiment.radius_m
    paths = data.paths
    for row in data.sampled(rows).tolist():
        flown = replay(paths.starts[row], paths.action[paths.of(row)][:-1])[:, :3]
        # Where the two agree to the last bit but for the Approach, the certificate above is this one too.
        if np.array_equal(flown[:-1], paths.xyz[paths.of(row)][:-1]):
            continue
        if hit := _hit(world, corners(flown), radius):
            yield Finding(row, f"the body touches a surface {hit}", "a free sweep")


@check("routes", after=(*_FITS, "route_collision"), samples=True)
def min_clearance(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The stored clearance is right: a body a little thinner passes everywhere, one a little thicker does not."""
    world, cap = data.world, data.pipeline.plan.clearance_cap_m
    stored, paths, wide = rows.floats("min_clearance_m"), data.paths, _free_as_stored(data)
    for row in data.sampled(rows).tolist():
        legs, stored_m = corners(paths.xyz[paths.of(row)]), float(stored[row])
        if stored_m > cap + _CLEARANCE_M:
            yield Finding(row, f"{stored_m:.6g} m", f"{cap:g} m at most")
            continue
        passes = wide[row] or stored_m <= _CLEARANCE_M or not world.route_in_collision(legs, stored_m - _CLEARANCE_M)
        if not passes or (stored_m < cap and not world.route_in_collision(legs, max(stored_m, 0.0) + _CLEARANCE_M)):
            yield Finding(row, f"{stored_m:.6g} m", f"{_clearance_m(world, legs, cap):.4f} m")


def _free_as_stored(data: SceneData) -> Mask:
    """Routes that a body passes which is nearly as thick as their stored clearance, as far as that is known."""
    return data.cached("free as stored", lambda: np.zeros(len(data["routes"]), np.bool_))


def _hit(world: CollisionWorld, legs: Floats, radius: float) -> str:
    """Where a body on its way first touches a surface, in words; empty where nowhere."""
    if len(legs) == 1:
        hit = (legs[0], legs[0]) if world.sphere_in_collision(legs[0], radius) else None
    else:
        hit = next((leg for leg in pairwise(legs) if world.segment_in_collision(*leg, radius)), None)
    return "" if hit is None else f"between {place_text(hit[0], 2)} and {place_text(hit[1], 2)}"


def _clearance_m(world: CollisionWorld, legs: Floats, cap: float) -> float:
    """Smallest distance from the legs to a surface, up to the cap, by halving; metres."""
    low, high = 0.0, cap
    if not world.route_in_collision(legs, cap):
        return cap
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if world.route_in_collision(legs, middle) else (middle, high)
    return (low + high) / 2


# Not sampled: a leg that the clearance grid proves free costs next to nothing.
@check("routes", after=_ROUTE_FAULTS)
def oracle_fails(data: SceneData, routes: Rows) -> Iterator[Finding]:
    """An agent that flies the actions, by the environment's motion and collision, succeeds within the budget."""
    space = FlightSpace(data.mesh, data.pipeline.embodiment.radius_m, data.world)
    for row, reference in _references(data, routes):
        if lack := spl_fault(fly(space, reference), reference.length_m, SUCCESS_RADIUS_M):
            yield Finding(row, lack, _EXPECTED)


@check("routes", after=(*_ROUTE_FAULTS, "oracle_fails", "unknown_target", "agent_action"))
def agent_action_fails(data: SceneData, routes: Rows) -> Iterator[Finding]:
    """The list agent_action is an agent's: flown it stops within 1 m of the anchor, the target in sight."""
    scene, paths = data.mesh, data.paths
    space = FlightSpace(scene, data.pipeline.embodiment.radius_m, data.world)
    nodes, lists = data["objects"].texts("mesh_node"), routes.column("agent_action").to_pylist()
    stops: list[tuple[int, str, tuple[float, float, float]]] = []
    for row, reference in _references(data, routes):
        # An older version wrote null lists.
        if lists[row] is None or data.target_of_route[row] < 0:
            continue
        actions = [-1 if action is None else action for action in lists[row]]
        wrong = [action for action in actions if not 0 <= action < APPROACH]
        if wrong or STOP in actions[:-1] or actions[-1:] != [STOP]:
            what = f"action {wrong[0]}" if wrong else "no Stop at its end alone"
            yield Finding(row, what, "actions 0 to 15, of which the last alone is 0 (Stop)")
            continue
        own = paths.action[paths.of(row)]
        if actions == own[own != APPROACH].tolist():
            # These have been flown by the check above, to where the Approach begins.
            end = tuple(paths.xyz[paths.of(row)][-2 if own[-2] == APPROACH else -1].tolist())
        else:
            flown = fly(space, reference._replace(actions=actions))
            if lack := spl_fault(flown, 0.0, SUCCESS_RADIUS_M):
                yield Finding(row, lack, f"a success at {SUCCESS_RADIUS_M:g} m")
                continue
            end = flown.position
        away = math.dist(end, reference.goal)
        if away > NEAR_GOAL_M + _REPLAY_M:
            yield Finding(row, f"a Stop {away:.3f} m from the anchor", f"{NEAR_GOAL_M:g} m at most")
        elif (node := nodes[data.target_of_route[row]]) in scene:
            stops.append((row, str(node), end))
    ends = np.array([end for _, _, end in stops]).reshape(-1, 3)
    for k in np.flatnonzero(~all_in_sight(scene, [node for _, node, _ in stops], ends)).tolist():
        yield Finding(stops[k][0], "a Stop from where no straight line reaches the target", "the target in sight")


def _references(data: SceneData, routes: Rows) -> Iterator[tuple[int, Reference]]:
    """Routes that can be flown, as they and their task are sound: their rows, and what an episode is made of."""
    tasks, paths = data["tasks"], data.paths
    # Instances agree in these columns: one suffices.
    task_of_route = tasks.find("nav_id", routes.column("nav_id"))
    starts, budgets = tasks.floats(*START).tolist(), tasks.ints("action_budget").tolist()
    goals, lengths_m = routes.floats("goal_x_m", "goal_y_m", "goal_z_m").tolist(), routes.floats("length_m").tolist()
    faulty = data.flagged("tasks", (*ALWAYS_AFTER, *_TASK_FAULTS))
    fit = routes.judged & paths.fit & (task_of_route >= 0)
    fit[data.route_of_task[faulty & (data.route_of_task >= 0)]] = False
    for row in np.flatnonzero(fit).tolist():
        task, actions = task_of_route[row], paths.action[paths.of(row)].tolist()
        yield row, Reference(tuple(starts[task]), tuple(goals[row]), budgets[task], lengths_m[row], actions)
