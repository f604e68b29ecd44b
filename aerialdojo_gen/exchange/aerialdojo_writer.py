"""The release in the layout that AerialDojo's authors publish: NED metres, quaternions xyzw."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AssetError, StoreError
from aerialdojo_gen.base.pictures import REFERENCE_PNG, decode_rgb, encode_png
from aerialdojo_gen.exchange import aerialdojo_layout as layout
from aerialdojo_gen.exchange.folder import link_or_copy
from aerialdojo_gen.exchange.frames import NED, words_of
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.backend import choose_renderer, scene_renderer
from aerialdojo_gen.scenes.context import open_scene
from aerialdojo_gen.scenes.stored import mesh_copy
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import DIFFICULTY_COLUMNS, SPLIT_COLUMNS

# Between two sizes and two renderers edges and shadows' rims differ; another view or object differs by far more.
_SAME_VIEW = 12.0


class RerenderedImages:
    """Draws a scene's reference pictures from where they were taken, at another size than the release has them."""

    def __init__(self, root: DataRoot, scene: str, size_px: int) -> None:
        row = store.read_scene(root, "release/scenes", scene).to_pylist()[0]
        keep = "--picture-size 0 exports the release's own pictures"
        try:
            mesh = mesh_copy(root, row["mesh_path"])
        except FileNotFoundError:
            missing = f"{root.at(row['mesh_path'])} is missing"
            raise AssetError(f"{missing}, so its pictures cannot be drawn at {size_px} px: {keep}") from None
        if hashlib.sha256(mesh.read_bytes()).hexdigest() != row["mesh_sha256"]:
            raise AssetError(f"{mesh} is not the mesh that the release was made from: {keep}")
        self._scene_name = scene
        rows = store.read_scene(root, "release/objects", scene).to_pylist()
        self._poses = {
            r["object_id"]: [r[f"reference_{name}"] for name in ("x_m", "y_m", "z_m", "yaw_rad")] for r in rows
        }
        self._pictures = {r["object_id"]: r["reference_image"] for r in rows}
        self._camera = Camera(size_px, size_px)
        self._scene = open_scene(mesh, row["mesh_sha256"]).scene
        self._renderer_name = choose_renderer("auto").name

    def picture(self, object_id: int) -> bytes:
        """Draw an object's picture."""
        x, y, z, yaw = self._poses[object_id]
        pose = view_pose((x, y, z), yaw, "front")
        rgb = scene_renderer(self._scene, self._renderer_name).render(self._camera, pose).rgb
        if _image_difference(rgb, self._pictures[object_id]) > _SAME_VIEW:
            raise StoreError(
                f"object {object_id} of {self._scene_name} does not look as its picture does: "
                "--picture-size 0 exports the release's own pictures"
            )
        return encode_png(rgb, REFERENCE_PNG)


def _image_difference(rgb: NDArray[np.uint8], picture: bytes) -> float:
    """Mean absolute difference to a PNG, in steps of 255, both at a quarter of the first one, at most 64 x 64."""
    released = decode_rgb(picture)
    if released is None:
        return float("inf")
    side = min(64, len(rgb) // 4)  # Pixels of their own size show what thin things a small picture misses.
    small = [cv2.resize(image, (side, side), interpolation=cv2.INTER_AREA) for image in (rgb, released)]
    return float(np.abs(small[0].astype(np.float32) - small[1].astype(np.float32)).mean())


Floats = NDArray[np.float64]
Row = Mapping[str, Any]

# What the layout has no field for; sizes of actions are in the poses, trajectory_id is the nav_id.
LOST: Mapping[str, Sequence[str]] = {
    "tasks": ["image_distance_m", *SPLIT_COLUMNS],
    "routes": ["goal_yaw_rad", "min_clearance_m", *DIFFICULTY_COLUMNS],
    "objects": [
        "x_m", "y_m", "z_m", "size_x_m", "size_y_m", "size_z_m", "landmark_id",
        "box_u0_px", "box_v0_px", "box_u1_px", "box_v1_px", "image_fraction",
        "reference_x_m", "reference_y_m", "reference_z_m", "reference_yaw_rad", "step_back_m", "tells_shown",
        "tells_missing", "claims", "shape", "shape_held_out", "paraphrases", "all of those that no task names",
    ],
    "landmarks": ["all but the names"],
    "anchors": ["all but the start's number"],
    "viewpoints": ["all"],
    "scenes": ["all but the name"],
}  # fmt: skip

_ENDS = ["nav_id", "start_object_id", "target_object_id", "goal_x_m", "goal_y_m", "goal_z_m", "length_m",
         "euclidean_m", "detour_ratio"]  # fmt: skip
_PICTURES = "Images"
_COORDINATES = "ProjectAirSim NED"


def write_scene(data: DataRoot, scene: str, root: Path, picture_px: int = 0) -> dict[str, int]:
    """Write a scene's tasks, pictures and trajectories; a partition without tasks is an empty list."""
    objects = {row["object_id"]: row for row in store.read_scene(data, "release/objects", scene).to_pylist()}
    draw = RerenderedImages(data, scene, picture_px) if picture_px else None
    pictures = _Pictures(scene, objects, draw)
    counts = dict.fromkeys(("task files", "tasks", "trajectories"), 0)
    for subset in ("train", "test"):
        tasks = store.read_scene(data, f"tasks/{subset}", scene)
        routes = store.read_scene(data, f"routes/{subset}", scene)
        for setting in layout.SETTING_WORDS:
            chosen = routes.filter(pa.compute.equal(routes["setting"], setting)).sort_by("nav_id")
            episodes = {nav_id: str(k) for k, nav_id in enumerate(chosen["nav_id"].to_pylist())}
            mine = tasks.filter(pa.compute.equal(tasks["setting"], setting)).sort_by("nav_id").to_pylist()
            partition = layout.partition_of(scene, setting, store.partition(scene).upper(), subset)
            ends = {row["nav_id"]: row for row in chosen.select(_ENDS).to_pylist()}
            for kind, modality in layout.KINDS.items():
                rows = [row for row in mine if row["modality"] == modality]
                folder = root / kind / partition.path
                folder.mkdir(parents=True)
                tasks_of = (
                    _task(row, episodes[row["nav_id"]], ends[row["nav_id"]], pictures, folder) for row in rows
                )
                lines = ",\n".join(map(_text, tasks_of))
                (folder / layout.TASK_FILE).write_text(f"[\n{lines}\n]\n" if rows else "[]\n", encoding="utf-8")
                counts["task files"] += 1
                counts["tasks"] += len(rows)
            counts["trajectories"] += _write_trajectories(root, partition, chosen, episodes, objects)
    return counts | {"pictures": len(pictures.first)}


def _task(row: Row, episode: str, ends: Row, pictures: _Pictures, folder: Path) -> dict[str, Any]:
    start = NED.positions_from_world([row[f"start_{a}_m"] for a in "xyz"])
    goal = NED.positions_from_world([ends[f"goal_{a}_m"] for a in "xyz"])
    quaternion = NED.quaternion_from_world_yaw(row["start_yaw_rad"]).tolist()
    start_object, target = (pictures.objects[ends[f"{end}_object_id"]] for end in ("start", "target"))
    record = {
        "episode_id": episode,
        # By it their replay finds a trajectory, where actors have several.
        "trajectory_id": row["nav_id"],
        "map_name": row["scene"],
        "coordinate_system": _COORDINATES,
        "task": layout.SETTING_WORDS[row["setting"]][2],
        "used-in-train": int(row["subset"] == "train"),
        "start_true_name": start_object["name"],
        "goal_true_name": row["target_name"],
        "start_object_name": start_object["mesh_node"],
        "goal_object_name": target["mesh_node"],
    }
    # An image task has no description, not an empty one: their loader takes the landmark for one that is absent.
    if row["modality"] == "semantic":
        record["description"] = row["description"]
    record |= {"category": target["category"], "Landmark": row["landmark"], "Direction": row["direction"]}
    if row["modality"] == "image":
        record["image"] = pictures.place(folder, ends["target_object_id"])
    # The same numbers besides under the name that their evaluator reads.
    attitude = {"start_quaternion_xyzw": quaternion, "start_quaternionr": quaternion}
    record["start_pose"] = {"start_position": start.tolist(), **attitude}
    record["goal_pose"] = {"goal_position": goal.tolist()}
    record["info"] = {theirs: ends[ours] for theirs, ours in layout.INFO.items()}
    return record


def _text(record: Mapping[str, Any]) -> str:
    return json.dumps(record, ensure_ascii=False, allow_nan=False)


class _Pictures:
    """Puts an object's picture beside every task file that names it: one file, linked, where the disk can."""

    def __init__(self, scene: str, objects: Mapping[int, Row], draw: RerenderedImages | None) -> None:
        self.objects = objects
        self._scene, self._draw = scene, draw
        self.first: dict[int, Path] = {}

    def place(self, folder: Path, object_id: int) -> str:
        """Put a picture below a task file's folder; returns its path relative to it."""
        name = self.objects[object_id]["reference_image_id"]
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,100}", name):
            raise StoreError(f"objects of {self._scene}: reference_image_id {name!r} cannot name a file")
        path = folder / _PICTURES / f"{name}.png"
        if object_id not in self.first:
            picture = self.objects[object_id]["reference_image"]
            if picture is None:
                raise StoreError(f"object {object_id} of {self._scene} has no reference image: "
                                 f"run {command('split', scene=self._scene)}")  # fmt: skip
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(self._draw.picture(object_id) if self._draw else picture)
            self.first[object_id] = path
        elif not path.exists():
            link_or_copy(self.first[object_id], path)
        return f"{_PICTURES}/{path.name}"


def _write_trajectories(
    root: Path, partition: layout.Partition, routes: pa.Table, episodes: Mapping[str, str], objects: Mapping[int, Row]
) -> int:
    folder = root / layout.TRAJECTORIES / partition.path
    folder.mkdir(parents=True)
    for row, poses, actions in _poses(routes):
        positions = NED.positions_from_world(poses[:, :3]).tolist()
        quaternions = NED.quaternion_from_world_yaw(poses[:, 3]).tolist()
        document = {
            "schema_version": layout.SCHEMA_VERSION,
            "map_name": partition.scene,
            "task_id": f"{row['start_object_id']}_{row['start_anchor_id']}__{row['target_object_id']}",
            "status": "planned",
            "goal": {"Object_name": objects[row["target_object_id"]]["mesh_node"]},
            "trajectory": [
                {"action": word, "position_ned_m": position, "quaternion_xyzw": quaternion}
                for word, position, quaternion in zip(words_of(actions, poses), positions, quaternions, strict=True)
            ],
        }
        (folder / f"{episodes[row['nav_id']]}.json").write_text(_text(document), encoding="utf-8")
    return routes.num_rows


def _poses(routes: pa.Table) -> Iterator[tuple[dict[str, Any], Floats, NDArray[np.int8]]]:
    """The routes, each with its poses, (n, 4), and actions, (n,)."""
    lists = {name: routes[name].combine_chunks() for name in ("x_m", "y_m", "z_m", "yaw_rad", "action")}
    flat = {name: column.flatten().to_numpy() for name, column in lists.items()}
    bounds = np.concatenate([[0], np.cumsum(lists["action"].value_lengths().to_numpy())])
    columns = ["nav_id", "start_object_id", "start_anchor_id", "target_object_id"]
    for k, row in enumerate(routes.select(columns).to_pylist()):
        part = slice(bounds[k], bounds[k + 1])
        poses = np.column_stack([flat[name][part] for name in ("x_m", "y_m", "z_m", "yaw_rad")])
        yield row, poses, flat["action"][part]
