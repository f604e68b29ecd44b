"""Where the pictures of a trajectory's steps come from: drawn from the scene's mesh, or read from its recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True, eq=False)
class Frames:
    """What the chosen views show at some poses."""

    rgb: NDArray[np.uint8] | None  # (n, views, H, W, 3) uint8 or None; sRGB
    depth_m: NDArray[np.float32] | None  # Planar depth, metres; 0 where there is nothing within range

    def take(self, rows: NDArray[np.int64]) -> Frames:
        """Keep some poses, in their order."""
        return Frames(
            None if self.rgb is None else self.rgb[rows], None if self.depth_m is None else self.depth_m[rows]
        )

    @classmethod
    def join(cls, parts: Sequence[Frames]) -> Frames:
        """Join poses, in their order."""
        rgb = [p.rgb for p in parts if p.rgb is not None]
        depth_m = [p.depth_m for p in parts if p.depth_m is not None]
        return cls(np.concatenate(rgb) if rgb else None, np.concatenate(depth_m) if depth_m else None)


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
        return Frames(rgb if sensors.rgb else None, clip_depth(depth_m, sensors) if sensors.depth else None)


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
        return Frames.join([frames for _, frames in parts]).take(back)

    def _read(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        index, s = self._index, self._sensors
        shape = (len(steps), len(s.views), s.height, s.width)
        rgb = np.empty((*shape, 3), np.uint8) if s.rgb else None
        depth_m = np.empty(shape, np.float32) if s.depth else None
        for row, (k, step) in enumerate(zip(trajectories.tolist(), steps.tolist(), strict=True)):
            root, scene = index.scene_of(k)
            recording = _recording(root, f"media/{scene}/{index.nav_id[k]}")
            for v, view in enumerate(s.views):
                if rgb is not None:
                    rgb[row, v] = _smaller(recording.rgb[view][step], s, cv2.INTER_AREA)
                if depth_m is not None:
                    # The nearest value, not a mean: between two surfaces there is none.
                    depth_m[row, v] = _smaller(recording.depth_m[view][step], s, cv2.INTER_NEAREST_EXACT)
        return Frames(rgb, None if depth_m is None else clip_depth(depth_m, s))


def clip_depth(depth_m: NDArray[np.float32], sensors: Sensors) -> NDArray[np.float32]:
    """Set depth to 0 where nothing is in the sensors' range; in place."""
    np.putmask(depth_m, ~(depth_m <= np.float32(sensors.max_depth_m)), np.float32(0.0))
    return depth_m


def recorded_frames(root: DataRoot, scene: str, sensors: Sensors) -> dict[str, int]:
    """Count, by ``nav_id``, the frames of recordings that have all views asked for.

    One frame a pose and no quality flags.
    """
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
