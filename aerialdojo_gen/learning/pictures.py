"""Where the pictures of a trajectory's steps come from: drawn from the scene's mesh, or read from its recording."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import RenderError, StoreError
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.observations import renderer_for
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.learning.index import Index
from aerialdojo_gen.rendering.bodies import draw_bodies
from aerialdojo_gen.rendering.reader import Recording, read_recording
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

# Recordings that are kept open: a trajectory's steps follow each other within a block.
_OPEN = 16


# What the chosen views show at n poses, of "rgb" and "depth_m" those asked for: (n, views, H, W, 3) uint8, sRGB, and
# planar depth, (n, views, H, W) float32, metres, 0 where there is nothing within range.
Frames = dict[str, NDArray[Any]]


def take(frames: Frames, rows: NDArray[np.int64]) -> Frames:
    """Keep some poses, in their order."""
    return {name: seen[rows] for name, seen in frames.items()}


def join(parts: Sequence[Frames]) -> Frames:
    """Join poses, in their order."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def empty_frames(sensors: Sensors, n: int) -> Frames:
    """Make room for what sensors see at n poses."""
    shape = (n, len(sensors.views), sensors.height, sensors.width)
    rgb = {"rgb": np.empty((*shape, 3), np.uint8)} if sensors.rgb else {}
    return rgb | ({"depth_m": np.empty(shape, np.float32)} if sensors.depth else {})


class Source(Protocol):
    """Where pictures come from."""

    def frames(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        """Return what is seen at steps of trajectories of one scene, row by row."""
        ...


class RenderedFrames:
    """Pictures drawn when they are asked for, as the environment and `render` draw them."""

    def __init__(self, index: Index, sensors: Sensors, renderer: str) -> None:
        self._index, self._sensors, self._renderer = index, sensors, renderer

    def frames(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        """Draw; see `Source`."""
        index, sensors = self._index, self._sensors
        context = open_scene(*mesh_of(*index.scene_of(int(trajectories[0]))), SEVERAL)
        poses = {int(k): index.poses_of(int(k)) for k in np.unique(trajectories)}
        at = np.stack([poses[k][s] for k, s in zip(trajectories.tolist(), steps.tolist(), strict=True)])
        rgb, depth_m = draw_bodies(renderer_for(context.scene, self._renderer), sensors.camera, at, sensors.views)
        seen = {"rgb": rgb} if sensors.rgb else {}
        return seen | ({"depth_m": clip_depth(depth_m, sensors)} if sensors.depth else {})


class RecordedFrames:
    """Pictures read from recordings, made smaller; what has none is drawn."""

    def __init__(self, index: Index, sensors: Sensors, drawn: Source) -> None:
        self._index, self._sensors, self._drawn = index, sensors, drawn
        self._known: dict[str, dict[str, int]] = {}

    def has(self, trajectory: int) -> bool:
        """Whether a trajectory has a recording of all that is asked for."""
        index = self._index
        (root, scene), nav_id = index.scene_of(trajectory), index.nav_id[trajectory]
        if scene not in self._known:
            self._known[scene] = recorded_frames(root, scene, self._sensors)
        # The recording has a frame a pose of the reference; that of an older version may have other actions.
        frames = self._known[scene].get(nav_id, 0)
        return 0 <= frames - int(index.steps[trajectory]) <= 1

    def frames(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        """Read; see `Source`."""
        known = np.array([self.has(int(k)) for k in trajectories])
        parts: list[tuple[NDArray[np.int64], Frames]] = []
        if not known.all():
            rows = np.flatnonzero(~known)
            parts.append((rows, self._drawn.frames(trajectories[rows], steps[rows])))
        if known.any():
            # Frame after frame of each: a seek decodes from the key frame on.
            rows = np.flatnonzero(known)
            rows = rows[np.lexsort((steps[rows], trajectories[rows]))]
            parts.append((rows, self._read(trajectories[rows], steps[rows])))
        back = np.argsort(np.concatenate([rows for rows, _ in parts]))
        return take(join([frames for _, frames in parts]), back)

    def _read(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        index, s = self._index, self._sensors
        out = empty_frames(s, len(steps))
        for row, (k, step) in enumerate(zip(trajectories.tolist(), steps.tolist(), strict=True)):
            root, scene = index.scene_of(k)
            recording = _recording(root, f"media/{scene}/{index.nav_id[k]}")
            for v, view in enumerate(s.views):
                if s.rgb:
                    out["rgb"][row, v] = _smaller(recording.rgb[view][step], s, cv2.INTER_AREA)
                if s.depth:
                    # The nearest value, not a mean: between two surfaces there is none.
                    depth_m = recording.depth_m[view][step]
                    out["depth_m"][row, v] = _smaller(depth_m, s, cv2.INTER_NEAREST_EXACT)
        if s.depth:
            clip_depth(out["depth_m"], s)
        return out


def clip_depth(depth_m: NDArray[np.float32], sensors: Sensors) -> NDArray[np.float32]:
    """Set depth to 0 where nothing is in the sensors' range; in place."""
    np.putmask(depth_m, ~(depth_m <= np.float32(sensors.max_depth_m)), np.float32(0.0))
    return depth_m


def recorded_frames(root: DataRoot, scene: str, sensors: Sensors) -> dict[str, int]:
    """Count the frames of recordings that have all views, one a pose, without quality flags, by ``nav_id``."""
    if not root.list("recordings", f"{scene}/*.parquet"):
        return {}
    columns = ("nav_id", "view", "modality", "sampling", "n_frames", "width", "height", "fov_deg", "ok")
    rows = store.read_stored(root, "recordings", scene, columns).to_pylist()
    wanted = {
        (view, kind) for view in sensors.views for kind, on in (("rgb", sensors.rgb), ("depth", sensors.depth)) if on
    }
    seen: dict[str, set[tuple[str, str]]] = {}
    frames: dict[str, int] = {}
    for row in rows:
        # Pixels of another shape would show another field of view.
        fits = row["width"] * sensors.height == row["height"] * sensors.width and row["fov_deg"] == sensors.fov_deg
        if row["ok"] and row["sampling"] == "steps" and fits:
            seen.setdefault(row["nav_id"], set()).add((row["view"], row["modality"]))
            frames[row["nav_id"]] = row["n_frames"]
    return {nav_id: frames[nav_id] for nav_id, kinds in seen.items() if wanted <= kinds}


@lru_cache(maxsize=_OPEN)
def _recording(root: DataRoot, folder: str) -> Recording:
    try:
        recording = read_recording(root.local_copy(folder))
    except FileNotFoundError:
        raise StoreError(
            f"{root.at(folder)} is missing, though recordings name it: run {command('render')}"
        ) from None
    for view, camera in recording.cameras.items():
        offset = np.array(camera.get("body_from_camera", np.eye(4)), np.float64)[:3, 3]
        if offset.any():
            raise RenderError(f"{folder} has the camera {view} beside the body's centre: choose source='render'")
    return recording


def _smaller(image: NDArray[Any], sensors: Sensors, how: int) -> NDArray[Any]:
    if image.shape[:2] == (sensors.height, sensors.width):
        return image
    return np.asarray(cv2.resize(image, (sensors.width, sensors.height), interpolation=how))
