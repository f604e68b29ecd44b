"""The closed loop as a check: the oracle agent, which flies the reference trajectories, succeeds at every task.

So do the references as an agent can fly them (`agent_action`), which besides end where the target is seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from aerialdojo_gen.base.constants import NEAR_GOAL_M, SUCCESS_RADIUS_M
from aerialdojo_gen.dataset.episode import MIN_SPL, Reference, fly, spl_fault
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import ALWAYS_AFTER, START, Mask, Rows, SceneData
from aerialdojo_gen.planning.flight_space import FlightSpace
from aerialdojo_gen.rendering.casters import all_in_sight
from aerialdojo_gen.store.schemas import APPROACH, STOP

# These faults make an episode fail too, and are reported by their own checks.
_ROUTE_FAULTS = (
    "list_lengths_differ", "action_order", "route_length", "keeping_rule", "out_of_bounds", "route_without_task",
    "replay_differs", "goal_anchor", "stops_far", "route_collision", "replay_collision",
)  # fmt: skip
_TASK_FAULTS = ("telling_number", "task_start", "task_budget", "task_setting", "instances_agree")
_EXPECTED = f"a success at {SUCCESS_RADIUS_M:g} m, SPL {MIN_SPL:g} or more"
# A stored position is the replay's to this much; it may make of the metre a little more.
_REPLAY_M = 1e-5


# Not sampled: a leg that the clearance grid proves free costs next to nothing.
@check("routes", needs=("tasks", "mesh"), after=_ROUTE_FAULTS)
def oracle_fails(data: SceneData, routes: Rows) -> Iterator[Finding]:
    """An agent that flies the actions, by the environment's motion and collision, succeeds within the budget."""
    space = FlightSpace(data.mesh, data.pipeline.embodiment.radius_m, data.world)
    left_out = _left_out(data, _ROUTE_FAULTS)
    for row, reference in _references(data, routes):
        if left_out[row]:
            continue
        if lack := spl_fault(fly(space, reference), reference.length_m, SUCCESS_RADIUS_M):
            yield Finding(row, lack, _EXPECTED)


@check(
    "routes",
    needs=("tasks", "objects", "mesh"),
    after=(*_ROUTE_FAULTS, "oracle_fails", "unknown_target", "agent_action"),
)
def agent_action_fails(data: SceneData, routes: Rows) -> Iterator[Finding]:
    """The list agent_action is an agent's: flown it stops within 1 m of the anchor, the target in sight."""
    scene, paths = data.mesh, data.paths
    space = FlightSpace(scene, data.pipeline.embodiment.radius_m, data.world)
    nodes, lists = data["objects"].texts("mesh_node"), routes.column("agent_action").to_pylist()
    # An older version wrote null lists.
    left_out = _left_out(data, (*_ROUTE_FAULTS, "oracle_fails", "unknown_target")) | ~routes.valid("agent_action")
    stops: list[tuple[int, str, tuple[float, float, float]]] = []
    for row, reference in _references(data, routes):
        if left_out[row] or data.target_of_route[row] < 0:
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
    """Routes that can be flown, as they have poses and a task: their rows, and what an episode is made of."""
    tasks, paths = data["tasks"], data.paths
    # Instances agree in these columns: one suffices.
    task_of_route = tasks.find("nav_id", routes.column("nav_id"))
    starts, budgets = tasks.floats(*START).tolist(), tasks.ints("action_budget").tolist()
    goals, lengths_m = routes.floats("goal_x_m", "goal_y_m", "goal_z_m").tolist(), routes.floats("length_m").tolist()
    for row in np.flatnonzero(paths.fit & (task_of_route >= 0)).tolist():
        task, actions = task_of_route[row], paths.action[paths.of(row)].tolist()
        yield row, Reference(tuple(starts[task]), tuple(goals[row]), budgets[task], lengths_m[row], actions)


def _left_out(data: SceneData, faults: tuple[str, ...]) -> Mask:
    """Routes that are not flown because of another fault of them or their task."""
    left_out = data.flagged("routes", (*ALWAYS_AFTER, *faults))
    faulty_tasks = data.flagged("tasks", (*ALWAYS_AFTER, *_TASK_FAULTS))
    left_out[data.route_of_task[faulty_tasks & (data.route_of_task >= 0)]] = True
    return left_out
