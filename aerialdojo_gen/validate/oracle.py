"""The closed loop as a check: the oracle agent, which flies the reference trajectories, succeeds at every task."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerialdojo_gen.benchmark.motion import FlightSpace
from aerialdojo_gen.benchmark.oracle import LEAST_SPL, Reference, fly, shortcoming
from aerialdojo_gen.config.agreement import SUCCESS_RADIUS_M
from aerialdojo_gen.validate.registry import ALWAYS_AFTER, Finding, check
from aerialdojo_gen.validate.rows import Rows, SceneData
from aerialdojo_gen.validate.scene_mesh import scene_mesh

# What is wrong with a row by these makes an episode fail too, and is named better by them.
_ROUTE_FAULTS = (
    "list_lengths_differ", "action_order", "route_length", "keeping_rule", "out_of_bounds", "route_without_task",
    "replay_differs", "goal_anchor", "stops_far", "route_collision", "replay_collision",
)  # fmt: skip
_TASK_FAULTS = ("telling_number", "task_start", "task_budget", "task_setting", "instances_agree")
_EXPECTED = f"a success at {SUCCESS_RADIUS_M:g} m, SPL {LEAST_SPL:g} or more"


# Not sampled: a leg that the clearance grid proves free costs next to nothing.
@check("routes", needs=("tasks", "mesh"), after=_ROUTE_FAULTS)
def oracle_fails(data: SceneData, routes: Rows) -> Iterator[Finding]:
    """An agent that flies the actions, by the environment's motion and collision, succeeds within the budget."""
    mesh, tasks, paths = scene_mesh(data), data["tasks"], data.paths
    space = FlightSpace(mesh.scene, data.pipeline.embodiment.radius_m, mesh.world)
    left_out = data.flagged("routes", (*ALWAYS_AFTER, *_ROUTE_FAULTS))
    faulty_tasks = data.flagged("tasks", (*ALWAYS_AFTER, *_TASK_FAULTS))
    left_out[data.route_of_task[faulty_tasks & (data.route_of_task >= 0)]] = True
    # Instances agree in all that matters here: one tells.
    task_of_route = tasks.find("nav_id", routes.column("nav_id"))
    start = tasks.floats("start_x_m", "start_y_m", "start_z_m", "start_yaw_rad").tolist()
    goal, budget = routes.floats("goal_x_m", "goal_y_m", "goal_z_m").tolist(), tasks.ints("action_budget").tolist()
    length_m = routes.floats("length_m").tolist()
    for k in np.flatnonzero(~left_out[paths.rows]).tolist():
        row = int(paths.rows[k])
        task = int(task_of_route[row])
        if task < 0:
            continue
        x, y, z, yaw = start[task]
        actions = paths.action[paths.of(k)].tolist()
        reference = Reference((x, y, z, yaw), tuple(goal[row]), budget[task], length_m[row], actions)
        lack = shortcoming(fly(space, reference), reference.length_m, SUCCESS_RADIUS_M)
        if lack:
            yield Finding(row, lack, _EXPECTED)
