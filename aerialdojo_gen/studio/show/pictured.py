"""Everything that the figure and the page of a task need."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import Any

import cv2
import numpy as np
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.pictures import decode_rgb
from aerialdojo_gen.benchmark.agents.goal import Goal, Rules
from aerialdojo_gen.benchmark.llm.prompt import goal_text
from aerialdojo_gen.dataset.lookup import TaskRecord
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.motion import sampled
from aerialdojo_gen.rendering.orthographic import OrthographicPictures, orthographic_pictures
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import is_outside

SIZE_PX = 320


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame at a pose of the route."""

    step: int  # Index of the pose
    action: str  # The action taken there
    rgb: NDArray[np.uint8]  # (SIZE_PX, SIZE_PX, 3) uint8; front view, sRGB
    recorded: bool  # Whether it comes from a recording


def frames_along(task: TaskRecord, poses: NDArray[np.float64], count: int) -> list[Frame]:
    """Return front views at evenly spaced poses (K + 1, 4) of a route, including start and goal."""
    if count == 0:
        return []
    steps = sorted({round(k) for k in np.linspace(0, len(poses) - 1, count)})
    pictures = _recorded(task, steps)
    recorded = pictures is not None
    if pictures is None:
        pictures = _rendered(task, poses[steps])
    return [
        Frame(step, schemas.ACTION_NAMES[task.route["action"][step]], picture, recorded)
        for step, picture in zip(steps, pictures, strict=True)
    ]


def _rendered(task: TaskRecord, poses: NDArray[np.float64]) -> list[NDArray[np.uint8]]:
    from aerialdojo_gen.rendering.backend import open_renderer

    camera = Camera(SIZE_PX, SIZE_PX, 90.0)
    with open_renderer(task.scene.model) as world:
        return [world.render(camera, view_pose(pose[:3], pose[3], "front")).rgb for pose in poses]


def _recorded(task: TaskRecord, steps: list[int]) -> list[NDArray[np.uint8]] | None:
    """Return recorded frames at the poses; None if the task was not recorded."""
    root, scene = task.scene.root, task.scene.name
    if not store.shards(root, "recordings", scene):
        return None
    rows = store.read_scene(root, "recordings", scene)
    rows = rows.filter(pc.equal(rows["nav_id"], task.nav_id)).to_pylist()
    path = next((row["path"] for row in rows if (row["view"], row["modality"]) == ("front", "rgb")), None)
    if path is None:
        return None
    from aerialdojo_gen.rendering.reader import open_view

    frames = store.read_scene(root, "frames", scene, ["nav_id", "frame", "step"])
    frames = frames.filter(pc.equal(frames["nav_id"], task.nav_id)).sort_by([("frame", "descending")])
    first = dict(zip(frames["step"].to_pylist(), frames["frame"].to_pylist(), strict=True))
    if any(step not in first for step in steps):
        return None
    if is_outside(root, path):
        raise StoreError(f"recordings: path {path!r} points outside {root}")
    try:
        video = open_view(root.local_copy(path), "front", "rgb")
    except FileNotFoundError:
        raise StoreError(f"the recording {root.at(path)} is missing: run {command('render')}") from None
    return [
        np.asarray(cv2.resize(video[first[step]], (SIZE_PX, SIZE_PX), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        for step in steps
    ]


Floats = NDArray[np.float64]
_GOAL_FIELDS = ("modality", "target_name", "landmark", "direction", "description")


@dataclass(frozen=True, eq=False)
class PicturedTask:
    """A task, ready to be drawn."""

    task: TaskRecord
    instance: dict[str, Any]  # The row of `tasks` that is shown
    target: dict[str, Any]  # Rows of `objects` and `landmarks`
    start_object: dict[str, Any]
    landmark: dict[str, Any]
    poses: Floats  # (K + 1, 4) float64; x, y, z and yaw of every pose
    way: Floats  # (n, 3) float64; points every half metre of the route at most, metres, world frame
    along_m: Floats  # (n,) float64; distance flown to each of them
    clearance_m: Floats  # (n,) float64; FCL's distance from each to the nearest surface
    below_m: Floats  # (n,) float64; height of the surface under each, NaN where there is none
    reference: NDArray[np.uint8] | None  # (H, W, 3) uint8 or None; the target's reference image
    frames: list[Frame]
    pictures: OrthographicPictures

    @property
    def title(self) -> str:
        """Return the title: what to find."""
        row = self.instance
        return f"{row['target_name']}, {row['direction']} of the {row['landmark']}"

    @property
    def place(self) -> str:
        """Return the subtitle: task, scene and setting."""
        row, gap = self.instance, "   ·   "
        kind = f"{row['setting'].replace('_', ' ')}, {row['modality']} goal, {self.task.route['split']}"
        return gap.join([row["task_id"], f"{row['family']}, {row['scene_type']}", kind])

    @property
    def goal(self) -> str:
        """The goal text that an agent gets."""
        row = self.instance
        kind, name, landmark, direction, more = (row[key] for key in _GOAL_FIELDS)
        image = self.reference if kind == "image" else None
        rules, distance_m = Rules(row["action_budget"]), row["image_distance_m"]
        return goal_text(Goal(kind, name, landmark, direction, more, image, rules, image_distance_m=distance_m))

    @property
    def terminal_goal(self) -> str:
        """The goal for a terminal: for image goals, the image's id and the description of the semantic task."""
        row = self.instance
        if row["modality"] != "image" or self.reference is None:
            return self.goal
        height, width = self.reference.shape[:2]
        lines = [
            f"{self.goal.removesuffix(':')}: reference image {row['reference_image_id']}, {width} x {height} pixels"
        ]
        twin = next((other for other in self.task.instances if other["modality"] == "semantic"), None)
        if twin is not None:
            lines.append(f"In words, which {twin['task_id']} gives in its place: {twin['description']}")
        return "\n".join(lines)

    @property
    def facts(self) -> list[tuple[str, str]]:
        """Measures of the route, as name and value."""
        route = self.task.route
        return [
            ("length L", f"{route['length_m']:.2f} m"),
            ("straight d_E", f"{route['euclidean_m']:.2f} m"),
            ("detour κ = L / d_E", f"{route['detour_ratio']:.3f}"),
            ("least clearance", f"{route['min_clearance_m']:.2f} m"),
            ("actions", f"{route['n_actions']} of {self.instance['action_budget']}"),
            ("starts at", f"{self.start_object['name']}, anchor {route['start_anchor_id']}"),
            ("height", f"{self.poses[:, 2].min():.1f} to {self.poses[:, 2].max():.1f} m"),
        ]

    @property
    def actions(self) -> list[tuple[str, int]]:
        """The reference actions, run-length encoded."""
        return [(schemas.ACTION_NAMES[a], len(list(run))) for a, run in groupby(self.task.route["action"])]


def picture_task(task: TaskRecord, modality: str = "semantic", frames: int = 5) -> PicturedTask:
    """Collect what is drawn of a task."""
    scene, route = task.scene, task.route
    rows = sorted(task.instances, key=lambda row: row["modality"] != modality)
    target = scene.object(route["target_object_id"])
    poses = np.column_stack([route["x_m"], route["y_m"], route["z_m"], route["yaw_rad"]])
    moved = np.concatenate([[True], np.any(np.diff(poses[:, :3], axis=0) != 0.0, axis=1)])
    way, _ = sampled(poses[moved, :3])
    pictures = orthographic_pictures(scene.model)
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    return PicturedTask(
        task=task,
        instance=rows[0],
        target=target,
        start_object=scene.object(route["start_object_id"]),
        landmark=scene.landmark(target["landmark_id"]),
        poses=poses,
        way=way,
        along_m=np.concatenate([[0.0], np.cumsum(steps)]),
        clearance_m=scene.clearance(way),
        below_m=pictures.surface_below(way),
        reference=decode_rgb(target["reference_image"]),
        frames=frames_along(task, poses, frames),
        pictures=pictures,
    )
