"""Task files as AerialDojo's authors publish them, in a tree like theirs."""

import math
from pathlib import Path

from support import task_files


def document(turn_deg: float = 60) -> tuple[list[dict], dict]:
    """A task and its trajectory with the values of the authors' own test of their recorder."""
    tasks = [
        {
            "episode_id": "42",
            "map_name": "N_Island_0",
            "task": "base_task",
            "used-in-train": 1,
            "description": "A stone tower",
            "Landmark": "wooden pier",
            "goal_object_name": "TowerActor",
            "start_pose": {"start_position": [0, 0, -3], "start_quaternion_xyzw": [0, 0, 0, 1]},
        }
    ]
    half = math.radians(turn_deg) / 2
    turned = [0, 0, math.sin(half), math.cos(half)]
    trajectory = {
        "schema_version": "hybrid_astar_trajectory_v6",
        "map_name": "N_Island_0",
        "task_id": "planner_42",
        "goal": {"Object_name": "TowerActor"},
        "trajectory": [
            {"action": "start", "position_ned_m": [0, 0, -3], "quaternion_xyzw": [0, 0, 0, 1]},
            {"action": "forward", "position_ned_m": [1, 0, -3], "quaternion_xyzw": [0, 0, 0, 1]},
            {"action": "rotr", "position_ned_m": [1, 0, -3], "quaternion_xyzw": turned},
        ],
    }
    return tasks, trajectory


def put(root: Path, tasks: list[dict], trajectory: dict, split: str = "IID_TRAINS") -> Path:
    partition = f"{split}/1_BaseTasks/N_Island_0_B_Train"
    task_files.write(root / "TrajectoryDATA" / partition / "42.json", trajectory)
    return task_files.write(root / "SemanticOGS" / partition / "Task.json", tasks)
