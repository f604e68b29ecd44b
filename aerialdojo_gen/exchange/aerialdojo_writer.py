"""The release in the layout that AerialDojo's authors publish: NED metres, quaternions xyzw."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import tarfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AssetError, StoreError
from aerialdojo_gen.base.pictures import REFERENCE_PNG, decode_rgb, encode_png
from aerialdojo_gen.exchange import aerialdojo_layout as layout
from aerialdojo_gen.exchange.folder import count_routes, link_or_copy
from aerialdojo_gen.exchange.frames import NED, words_of
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.backend import choose_renderer, scene_renderer
from aerialdojo_gen.scenes.context import open_scene
from aerialdojo_gen.scenes.stored import mesh_copy
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.files import sha256_of
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import DIFFICULTY_COLUMNS, SETTINGS, SPLIT_COLUMNS

Row = Mapping[str, Any]
_PICTURES = "Images"
# Between two sizes and two renderers edges and shadows' rims differ; another view or object differs by far more.
_SAME_VIEW = 12.0
# Bytes of the text of a pose and of a task, measured on the paper's scenes.
_POSE_BYTES, _TASK_BYTES = 178.0, 2009.0
# Bytes of a picture grow with this power of its edge.
_GROWTH, _OWN_PX = 0.8, 320
_OWN_PICTURES = "--picture-size 0 exports the release's own pictures"


class _Pictures:
    """Puts an object's picture beside every task file that names it: one file, linked, where the disk can.

    With a size it is drawn anew from where it was taken; without one it is the release's own.
    """

    def __init__(self, root: DataRoot, scene: str, size_px: int) -> None:
        rows = store.read_scene(root, "release/objects", scene).to_pylist()
        self.objects: dict[int, Row] = {row["object_id"]: row for row in rows}
        self.first: dict[int, Path] = {}
        self._scene_name, self._camera = scene, Camera(size_px, size_px) if size_px else None
        if not size_px:
            return
        row = store.read_scene(root, "release/scenes", scene).to_pylist()[0]
        try:
            mesh = mesh_copy(root, row["mesh_path"])
        except FileNotFoundError:
            missing = f"{root.at(row['mesh_path'])} is missing"
            raise AssetError(f"{missing}, so its pictures cannot be drawn at {size_px} px: {_OWN_PICTURES}") from None
        if sha256_of(mesh) != row["mesh_sha256"]:
            raise AssetError(f"{mesh} is not the mesh that the release was made from: {_OWN_PICTURES}")
        self._scene = open_scene(mesh, row["mesh_sha256"]).scene
        self._renderer_name = choose_renderer("auto").name

    def place(self, folder: Path, object_id: int) -> str:
        """Put a picture below a task file's folder; returns its path relative to it."""
        name, picture = (self.objects[object_id][key] for key in ("reference_image_id", "reference_image"))
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,100}", name):
            raise StoreError(f"objects of {self._scene_name}: reference_image_id {name!r} cannot name a file")
        path = folder / _PICTURES / f"{name}.png"
        if object_id not in self.first:
            if picture is None:
                raise StoreError(f"object {object_id} of {self._scene_name} has no reference image: "
                                 f"run {command('split', scene=self._scene_name)}")  # fmt: skip
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(picture if self._camera is None else self._draw(self._camera, object_id, picture))
            self.first[object_id] = path
        elif not path.exists():
            link_or_copy(self.first[object_id], path)
        return f"{_PICTURES}/{path.name}"

    def _draw(self, camera: Camera, object_id: int, picture: bytes) -> bytes:
        *place, yaw = (self.objects[object_id][f"reference_{name}"] for name in ("x_m", "y_m", "z_m", "yaw_rad"))
        pose = view_pose(place, yaw, "front")
        rgb = scene_renderer(self._scene, self._renderer_name).render(camera, pose).rgb
        if _image_difference(rgb, picture) > _SAME_VIEW:
            raise StoreError(
                f"object {object_id} of {self._scene_name} does not look as its picture does: {_OWN_PICTURES}"
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
_COORDINATES = "ProjectAirSim NED"


def scene_size(data: DataRoot, scene: str, picture_px: int) -> tuple[int, float]:
    """Reckon the files and bytes of a scene's tasks, trajectories and pictures."""
    files, size = 0, 0.0
    for subset in ("train", "test"):
        routes, poses = count_routes(data, scene, subset)
        size += poses * _POSE_BYTES + routes * _TASK_BYTES
        tasks = store.read_scene(data, f"tasks/{subset}", scene, ("setting", "reference_image_id"))
        shown = tasks.filter(pc.is_valid(tasks["reference_image_id"]))
        pictures = shown.group_by(["setting", "reference_image_id"]).aggregate([]).num_rows
        files += routes + len(layout.KINDS) * len(SETTINGS) + pictures
    # Each picture once: those of several settings are links.
    objects = store.read_scene(data, "release/objects", scene, ("reference_image",))
    stored = pc.sum(pc.binary_length(objects["reference_image"])).as_py() or 0
    return files, size + stored * ((picture_px / _OWN_PX) ** _GROWTH if picture_px else 1.0)


def begin(
    data: DataRoot, _scenes: Sequence[str], root: Path, picture_px: int, shards: bool
) -> Callable[[str], dict[str, int]]:
    """Return what writes a scene into the folder, as files or as an archive; scenes share nothing."""

    def write(scene: str) -> dict[str, int]:
        if not shards:
            return write_scene(data, scene, root, picture_px)
        counts = write_scene(data, scene, root / scene, picture_px)
        _pack_tar(root / scene, root / f"{scene}.tar")
        return counts

    return write


def _pack_tar(folder: Path, archive: Path) -> None:
    """Move a folder's files into a tar archive that depends on names and contents alone; the folder goes."""
    with tarfile.open(archive, "w", format=tarfile.PAX_FORMAT) as tar:
        for path in sorted(folder.rglob("*")):
            entry = tar.gettarinfo(path, path.relative_to(folder).as_posix())
            entry.uid = entry.gid = entry.mtime = 0
            entry.uname = entry.gname = ""
            entry.mode = 0o755 if entry.isdir() else 0o644
            with path.open("rb") if entry.isreg() else contextlib.nullcontext() as file:
                tar.addfile(entry, file)
    shutil.rmtree(folder)


def write_scene(data: DataRoot, scene: str, root: Path, picture_px: int = 0) -> dict[str, int]:
    """Write a scene's tasks, pictures and trajectories; a partition without tasks is an empty list."""
    pictures = _Pictures(data, scene, picture_px)
    counts = dict.fromkeys(("task files", "tasks", "trajectories"), 0)
    for subset in ("train", "test"):
        tasks = store.read_scene(data, f"tasks/{subset}", scene)
        routes = store.read_scene(data, f"routes/{subset}", scene)
        for setting in layout.SETTING_WORDS:
            chosen = routes.filter(pa.compute.equal(routes["setting"], setting)).sort_by("nav_id")
            own = tasks.filter(pa.compute.equal(tasks["setting"], setting)).sort_by("nav_id").to_pylist()
            partition = layout.Partition(scene, setting, store.partition(scene).upper(), subset)
            # Episodes are numbered by their places in the table.
            ends = {row["nav_id"]: (str(k), row) for k, row in enumerate(chosen.select(_ENDS).to_pylist())}
            for kind, modality in layout.KINDS.items():
                rows = [row for row in own if row["modality"] == modality]
                folder = root / kind / partition.path
                folder.mkdir(parents=True)
                lines = ",\n".join(_text(_task(row, *ends[row["nav_id"]], pictures, folder)) for row in rows)
                (folder / layout.TASK_FILE).write_text(f"[\n{lines}\n]\n" if rows else "[]\n", encoding="utf-8")
                counts["task files"] += 1
                counts["tasks"] += len(rows)
            _write_trajectories(root / layout.TRAJECTORIES / partition.path, scene, chosen, pictures.objects)
            counts["trajectories"] += chosen.num_rows
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


def _write_trajectories(folder: Path, scene: str, routes: pa.Table, objects: Mapping[int, Row]) -> None:
    folder.mkdir(parents=True)
    rows = (row for batch in routes.to_batches(max_chunksize=1024) for row in batch.to_pylist())
    for k, row in enumerate(rows):
        poses = np.column_stack([row[name] for name in ("x_m", "y_m", "z_m", "yaw_rad")])
        words = words_of(np.array(row["action"], np.int8), poses)
        positions = NED.positions_from_world(poses[:, :3]).tolist()
        quaternions = NED.quaternion_from_world_yaw(poses[:, 3]).tolist()
        document = {
            "schema_version": layout.SCHEMA_VERSION,
            "map_name": scene,
            "task_id": f"{row['start_object_id']}_{row['start_anchor_id']}__{row['target_object_id']}",
            "status": "planned",
            "goal": {"Object_name": objects[row["target_object_id"]]["mesh_node"]},
            "trajectory": [
                {"action": word, "position_ned_m": position, "quaternion_xyzw": quaternion}
                for word, position, quaternion in zip(words, positions, quaternions, strict=True)
            ],
        }
        (folder / f"{k}.json").write_text(_text(document), encoding="utf-8")
