"""Task files of other benchmarks, made by their documents, for the tests of their import."""

import json
import math
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108020000009077"
    "53de0000000c4944415408d763f8cfc0000003010100c9fe92ef0000000049454e44ae426082"
)

# Whatever a JSON file may have in a field.
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=5,
)


def write(path: Path, document: object, *, ascii_only: bool = True) -> Path:
    """A JSON file; NaN is written as Python writes it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(document, ensure_ascii=ascii_only), encoding="utf-8")
    return path


def uav_on(n: int = 3) -> list[dict]:
    return [
        {
            "episode_id": str(i),
            "start_pose": {
                "start_position": [-38.41 + i, 307.40, -10.0],
                # A heading of 2i sixteenths of a turn, rounded as the files are.
                "start_quaternionr": [0, 0, round(math.sin(math.pi * i / 8), 3), round(math.cos(math.pi * i / 8), 3)],
            },
            "info": {"geodesic_distance": 91, "euclidean_distance": 57.0111}, "map_name": "BrushifyRoad_test",
            "true_name": " MonkeyBars", "object_name": "SM_PullupBar01_2", "size": " small(2.0*0.5=1.0 squares)",
            "pose": [[-56.23, 267.50, 29.62], [400.0, 0.0, 0.0]], "category": "", "used-in-train": i % 2,
            "description": "A playground structure of blue bars. ", "commonsenible": 1,
        }
        for i in range(n)
    ]  # fmt: skip


def cityavos(folder: Path, n: int = 3) -> list[dict]:
    """Missions; their pictures are put below `folder`."""
    rows = []
    for i in range(n):
        image = f"data/target_image/Scene1/Target{i}.png"
        (folder / image).parent.mkdir(parents=True, exist_ok=True)
        (folder / image).write_bytes(PNG)
        rows.append({
            "mission_id": str(i + 1), "scene_id": "1", "mission_grade": "1",
            "initial_pos": [6360, -4160, -5, 0, 0, 0.5 * i], "target_pos": [6382.97 + i, -4209.66, -5.98],
            "target_text": "A coffee shop named CENTRAL ALL-STAR", "target_image_path": image,
        })  # fmt: skip
    return rows


_AERIALVLN_STEPS = {1: (5, 0, 0), 4: (0, 0, -2), 5: (0, 0, 2), 6: (0, -5, 0), 7: (0, 5, 0)}


def aerialvln(actions: tuple[int, ...] = (1, 2, 1, 4, 7, 3, 6, 5, 0), n: int = 2) -> dict:
    """Episodes whose path is what the actions fly, in NED: forward is +x at heading 0, and turning right is +yaw."""
    episodes = []
    for i in range(n):
        heading, position = math.radians(30 * i), np.array([10.0 * i, -20.0, -15.0])
        start, path, at = heading, [], position
        for action in actions:
            path.append(at.tolist())
            x, y, z = _AERIALVLN_STEPS.get(action, (0, 0, 0))
            cos, sin = math.cos(heading), math.sin(heading)
            at = at + np.array([cos * x - sin * y, sin * x + cos * y, z])
            heading += {2: -1, 3: 1}.get(action, 0) * math.radians(15)
        episodes.append({
            "episode_id": f"A{i}", "trajectory_id": f"T{i}", "scene_id": 5,
            "instruction": {"instruction_text": "Rise, then fly to the red roof.", "instruction_tokens": [1, 2]},
            "start_position": position.tolist(), "goals": [{"position": path[-1]}], "reference_path": path,
            "start_rotation": [math.cos(start / 2), 0.0, 0.0, math.sin(start / 2)], "actions": list(actions),
        })  # fmt: skip
    return {"episodes": episodes, "instruction_vocab": {"word_list": ["roof"], "num_vocab": 1}}


_OPENFLY_FORWARD = {1: 3, 8: 6, 9: 9}


def openfly(actions: tuple[int, ...] = (9, 2, 8, 3, 1, 0), n: int = 2, drift_m: float = 0.0) -> list[dict]:
    """Trajectories; the recorded end is `drift_m` east of what the actions fly."""
    rows = []
    for i in range(n):
        yaw, at, positions, yaws = 1.57, np.array([5.0, 6.0, 30.0]), [], []
        for action in actions:
            positions.append(at.tolist())
            yaws.append(yaw)
            at = at + _OPENFLY_FORWARD.get(action, 0) * np.array([math.cos(yaw), math.sin(yaw), 0.0])
            yaw += {2: 1, 3: -1}.get(action, 0) * math.radians(30)
        positions[-1][0] += drift_m
        rows.append({
            "image_path": f"env_airsim_16/astar_data/medium_average/2025-1-9_{i}", "pos": positions, "yaw": yaws,
            "gpt_instruction": "Head for the glass tower and stop before it.", "action": list(actions),
            "index_list": [f"20250109_131812_{k}" for k in range(len(actions))],
        })  # fmt: skip
    return rows


def authors(turn_deg: float = 60) -> tuple[list[dict], dict]:
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


def put_authors(root: Path, tasks: list[dict], trajectory: dict, split: str = "IID_TRAINS") -> Path:
    partition = f"{split}/1_BaseTasks/N_Island_0_B_Train"
    write(root / "TrajectoryDATA" / partition / "42.json", trajectory)
    return write(root / "SemanticOGS" / partition / "Task.json", tasks)
