"""The release as Habitat's ObjectNav-v1: json.gz, y up, forward -z, quaternions xyzw.

A scene's navigation tasks become episodes whose goals are all the objects of the target's category, as ObjectNav has
it; which of them the task means stands in ``info``.
"""

from __future__ import annotations

import gzip
import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from aerialdojo_gen.exchange.folder import count_routes
from aerialdojo_gen.exchange.frames import HABITAT, yaw_to_habitat_quaternion_xyzw
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import DIFFICULTY_COLUMNS, SPLIT_COLUMNS, SUBSETS

# Of the compressed text, measured on the paper's scenes.
_POSE_BYTES = 21.5
LOST: Mapping[str, Sequence[str]] = {
    "tasks": [
        "modality (one episode a navigation task)", "description", "reference_image_id", "image_distance_m",
        "landmark", "direction", *SPLIT_COLUMNS,
    ],
    "routes": ["min_clearance_m", "goal_yaw_rad", *DIFFICULTY_COLUMNS],
    "objects": [
        "description", "claims", "shape", "shape_held_out", "paraphrases", "mesh_node", "size_x_m", "size_y_m",
        "size_z_m", "direction", "reference_image", "box",
    ],
    "landmarks": ["all"],
}  # fmt: skip


def scene_size(data: DataRoot, scene: str, _picture_px: int) -> tuple[int, float]:
    """Reckon the files and bytes of a scene's episodes."""
    counts = [count_routes(data, scene, subset) for subset in ("train", "test")]
    return sum(routes > 0 for routes, _ in counts), sum(poses for _, poses in counts) * _POSE_BYTES


def begin(
    data: DataRoot, scenes: Sequence[str], root: Path, _picture_px: int, _shards: bool
) -> Callable[[str], dict[str, int]]:
    """Write each split's own file, which has no episodes but the categories, and return what writes a scene's."""
    columns = (store.read_scene(data, "release/objects", scene, ["category"])["category"] for scene in scenes)
    names = sorted({name for column in columns for name in column.to_pylist()})
    categories = {name: k for k, name in enumerate(names)}
    for split in SUBSETS:
        (root / split / "content").mkdir(parents=True)
        with _gzip(root / split / f"{split}.json.gz") as file:
            file.write(json.dumps({**_numbers(categories), "goals_by_category": {}, "episodes": []}).encode())
    return lambda scene: write_scene(data, scene, root, categories)


def write_scene(data: DataRoot, scene: str, root: Path, categories: Mapping[str, int]) -> dict[str, int]:
    """Write a scene's episodes, a file a subset."""
    mesh = store.read_scene(data, "release/scenes", scene, ["mesh_path"])["mesh_path"][0].as_py()
    rows = store.read_scene(data, "release/objects", scene).drop_columns("reference_image").to_pylist()
    anchors = store.read_scene(data, "release/anchors", scene).to_pylist()
    goals = defaultdict(list)
    for row in rows:
        own = [anchor for anchor in anchors if anchor["object_id"] == row["object_id"]]
        goals[f"{Path(mesh).name}_{row['category']}"].append(_goal(row, own))
    category_of = {row["object_id"]: row["category"] for row in rows}
    counts = {"episode files": 0, "episodes": 0}
    for subset in ("train", "test"):
        routes = store.read_scene(data, f"routes/{subset}", scene).sort_by("nav_id")
        if not routes.num_rows:
            continue
        split = f"{store.partition(scene)}_{subset}"
        head = {**_numbers(categories), "goals_by_category": goals}
        with _gzip(root / split / "content" / f"{scene}.json.gz") as file:
            # Streamed: the episodes of a large scene are some hundred megabytes of text.
            file.write(json.dumps(head, allow_nan=False)[:-1].encode() + b', "episodes": [')
            for k, episode in enumerate(_episodes(routes, mesh, category_of)):
                text = json.dumps({"episode_id": str(k), **episode}, allow_nan=False)
                file.write((",\n" if k else "\n").encode() + text.encode())
            file.write(b"\n]}")
        counts["episode files"] += 1
        counts["episodes"] += routes.num_rows
    return counts


def _numbers(categories: Mapping[str, int]) -> dict[str, Any]:
    names = ("category_to_task_category_id", "category_to_scene_annotation_category_id")
    return {name: dict(categories) for name in names}


@contextmanager
def _gzip(path: Path) -> Iterator[gzip.GzipFile]:
    """A gzip file without a date or a name in it, so that the same release gives the same bytes."""
    with path.open("wb") as raw, gzip.GzipFile("", "wb", 6, raw, mtime=0) as file:
        yield file


def _goal(row: Mapping[str, Any], anchors: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    views = []
    for anchor in anchors:
        rotation = yaw_to_habitat_quaternion_xyzw(anchor["yaw_rad"]).tolist()
        # Habitat's iou is the share of the view that the object covers: known where there is a picture.
        iou = row["image_fraction"] if anchor["selected"] else None
        views.append({"agent_state": {"position": _position(anchor), "rotation": rotation}, "iou": iou})
    return {
        "object_id": row["object_id"],
        "object_name": row["name"],
        "object_category": row["category"],
        "room_id": None,
        "position": _position(row),
        "view_points": views,
    }


def _position(row: Mapping[str, Any], prefix: str = "") -> list[float]:
    return HABITAT.positions_from_world([row[f"{prefix}{a}_m"] for a in "xyz"]).tolist()


def _episodes(routes: pa.Table, mesh: str, category_of: Mapping[int, str]) -> Iterator[dict[str, Any]]:
    for batch in routes.to_batches(max_chunksize=1024):
        for row in batch.to_pylist():
            positions = HABITAT.positions_from_world(np.column_stack([row["x_m"], row["y_m"], row["z_m"]])).tolist()
            rotations = yaw_to_habitat_quaternion_xyzw(row["yaw_rad"]).tolist()
            points = [
                {"position": position, "rotation": rotation, "action": action}
                for position, rotation, action in zip(positions, rotations, row["action"], strict=True)
            ]
            yield {
                "scene_id": mesh,
                "scene_dataset_config": "default",
                "start_position": positions[0],
                "start_rotation": rotations[0],
                "info": {
                    "geodesic_distance": row["length_m"],
                    "euclidean_distance": row["euclidean_m"],
                    "closest_goal_object_id": row["target_object_id"],
                    "goal_position": _position(row, "goal_"),
                    "nav_id": row["nav_id"],
                    "setting": row["setting"],
                },
                "goals": [],
                "shortest_paths": [points],
                "object_category": category_of[row["target_object_id"]],
            }
