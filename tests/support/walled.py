"""A crate with a wall on one side of it and a roof over it, as a release with tasks that start behind either."""

from __future__ import annotations

import math
from pathlib import Path

from support.handmade import box, instance, scene, write_rows, write_scene
from support.planting import write_viewpoints

from aerialdojo_gen.scenes.model import Scene

SCENE = "U_Walled_0"
# 1 m from the crate's sides; the first is the goal.
VIEWPOINTS = [(1.5, 0.0, 0.5), (-1.5, 0.0, 0.5), (0.0, 1.5, 0.5), (0.0, -1.5, 0.5)]
# Starts: 2.5 m from the goal behind the wall, 2.7 m above it over the roof, in the open.
STARTS = {"behind": (4.0, 0.0, 0.5), "above": (1.5, 0.0, 3.2), "open": (1.5, -6.0, 0.5)}


def walled() -> Scene:
    crate = instance("crate", box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0)))
    wall = instance("wall", box((2.6, -3.0, 0.0), (2.7, 3.0, 5.0)))
    roof = instance("roof", box((-4.0, -4.0, 2.6), (2.6, 4.0, 2.7)))
    return scene(crate, wall, roof, half=12.0, ceiling=8.0, name=SCENE)


def write_walled(data: Path, *, viewpoints: bool = True) -> Path:
    """Write the release, with its viewpoints or as an older version did."""
    write_scene(data, walled(), "release/scenes")
    x, y, z = VIEWPOINTS[0]
    goal = {"goal_x_m": x, "goal_y_m": y, "goal_z_m": z, "goal_yaw_rad": math.pi}
    routes, tasks = [], []
    for nav_id, start in STARTS.items():
        euclidean_m = math.dist(start, VIEWPOINTS[0])
        own = {"scene": SCENE, "nav_id": nav_id, "setting": "base"}
        length = {"euclidean_m": euclidean_m, "length_m": euclidean_m, "detour_ratio": 1.0, "n_actions": 1}
        routes.append({**own, **goal, **length, "target_object_id": 0, "start_object_id": 1})
        named = {"task_id": f"{nav_id}s", "modality": "semantic", "target_name": "crate", "landmark": "wall"}
        known = {"family": "Urban", "scene_type": "Walled", "partition": "ID", "subset": "test"}
        placed = {f"start_{a}_m": v for a, v in zip("xyz", start, strict=True)}
        tasks.append({**own, **named, **known, **placed, "start_yaw_rad": math.pi, "direction": "west",
                      "description": "A crate.", "action_budget": 90})  # fmt: skip
    rows = {
        "release/objects": [
            {"scene": SCENE, "object_id": k, "mesh_node": node} for k, node in enumerate(("crate", "wall"))
        ],
        "release/anchors": [], "release/landmarks": [],
        "routes/train": [], "tasks/train": [], "routes/test": routes, "tasks/test": tasks,
    }  # fmt: skip
    for table, content in rows.items():
        write_rows(data, table, content, SCENE)
    if viewpoints:
        write_viewpoints(data, SCENE, [
            {"object_id": 0, "x_m": x, "y_m": y, "z_m": z, "yaw_rad": math.atan2(-y, -x)} for x, y, z in VIEWPOINTS
        ])  # fmt: skip
    return data
