"""Where the pictures of a trajectory's steps come from: the mesh, drawn anew, a recording, or what the disk has kept.

A kept file holds each step's pictures compressed on their own, so that one step is read without the others, and a
checksum with each: a file that is cut off or damaged is drawn again. Nothing is thrown out for something newer: who
goes through a data set in a new order every epoch would meet just that. What finds no room is drawn.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import os
import struct
import zlib
from collections import defaultdict
from dataclasses import asdict
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import RenderError, StoreError
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.observations import clip_depth, renderer_for, renderer_name
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.learning.index import Index
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.rendering.reader import Recording, read_recording
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import make_folder
from aerialdojo_gen.store.root import DataRoot

_MAGIC = b"ADPIX1\n\0"
# Offset and length of a step's bytes, and their CRC-32.
_ENTRY = struct.Struct("<QII")
# How many bytes this process writes before it counts anew what others have written.
_RECOUNT = 256 << 20


class CachedFrames:
    """Pictures of a source, kept in a folder of `base`, one for each way to make them, that grows to `most_bytes`."""

    def __init__(
        self, source: Source, index: Index, sensors: Sensors, base: Path, most_bytes: int, kind: str, renderer: str
    ) -> None:
        self._source, self._index, self._sensors = source, index, sensors
        self._base, self._most_bytes, self._kind, self._renderer = base, most_bytes, kind, renderer
        self._full = False
        self._used: int | None = None
        self._since = 0

    def frames(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        """Read what is there, draw the rest, and keep what was drawn while there is room; see `Source`."""
        out = empty_frames(self._sensors, len(steps))
        for k in np.unique(trajectories).tolist():
            rows = np.flatnonzero(trajectories == k)
            if self._read(k, steps[rows], rows, out):
                continue
            if not self._full and self._room():
                n = int(self._index.steps[k])
                whole = self._source.frames(np.full(n, k), np.arange(n))
                self._write(k, whole)
                drawn = take(whole, steps[rows])
            else:
                drawn = self._source.frames(trajectories[rows], steps[rows])
            put(out, rows, drawn)
        return out

    @property
    def _codec(self) -> pa.Codec:
        # Not kept: it cannot be sent to another process.
        return pa.Codec("lz4_raw")

    @cached_property
    def _folder(self) -> Path:
        code = [code_of(f"aerialdojo_gen.rendering.{name}").digest for name in ("gl", "world", "reader")]
        # In the process that reads: to find out which renderer works here is to draw.
        facts = [code, self._kind, renderer_name(self._renderer), asdict(self._sensors)]
        folder = self._base / hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:16]
        make_folder(folder)
        return folder

    def _path(self, k: int) -> Path:
        index = self._index
        flown = hashlib.sha256(index.start[k].tobytes() + index.routes[k].tobytes()).hexdigest()[:16]
        _, mesh_sha256 = mesh_of(*index.sources[k])
        return self._folder / mesh_sha256[:16] / f"{index.nav_id[k]}-{flown}.pix"

    def _read(self, k: int, steps: NDArray[np.int64], rows: NDArray[np.int64], out: Frames) -> bool:
        n = int(self._index.steps[k])
        try:
            with self._path(k).open("rb") as file:
                head = file.read(len(_MAGIC) + n * _ENTRY.size)
                if len(head) != len(_MAGIC) + n * _ENTRY.size or not head.startswith(_MAGIC):
                    return False
                for step, row in zip(steps.tolist(), rows.tolist(), strict=True):
                    at, length, crc = _ENTRY.unpack_from(head, len(_MAGIC) + step * _ENTRY.size)
                    file.seek(at)
                    packed = file.read(length)
                    if len(packed) != length or zlib.crc32(packed) != crc:
                        return False
                    self._unpack(packed, row, out)
        except OSError:
            return False
        return True

    def _unpack(self, packed: bytes, row: int, out: Frames) -> None:
        rest = np.frombuffer(self._codec.decompress(packed, sum(one[row].nbytes for one in out.values())), np.uint8)
        for one in out.values():
            planes, rest = np.split(rest, [one[row].nbytes])
            values = np.ascontiguousarray(planes.reshape(one.itemsize, -1).T)
            one[row] = values.view(one.dtype).reshape(one[row].shape)

    def _pack(self, frames: Frames, row: int) -> bytes:
        # The bytes of one significance together, which are alike.
        values = (np.ascontiguousarray(one[row]) for one in frames.values())
        planes = (of.view(np.uint8).reshape(-1, of.itemsize).T.tobytes() for of in values)
        return bytes(self._codec.compress(b"".join(planes), asbytes=True))

    def _write(self, k: int, frames: Frames) -> None:
        packed = [self._pack(frames, row) for row in range(int(self._index.steps[k]))]
        starts = np.cumsum([len(_MAGIC) + len(packed) * _ENTRY.size, *(len(p) for p in packed)])
        head = b"".join(_ENTRY.pack(int(at), len(p), zlib.crc32(p)) for at, p in zip(starts, packed, strict=False))
        path, size = self._path(k), int(starts[-1])
        if self._used is not None and self._used + size > self._most_bytes:
            self._full = True
            return
        make_folder(path.parent)
        temporary = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            temporary.write_bytes(b"".join([_MAGIC, head, *packed]))
            temporary.replace(path)
        except OSError:
            # A full disk ends what is kept, not the training.
            self._full = True
            with contextlib.suppress(OSError):
                temporary.unlink()
            return
        self._used = (self._used or 0) + size
        self._since += size

    def _room(self) -> bool:
        if self._used is None or self._since > _RECOUNT:
            self._used, self._since = 0, 0
            for path in self._folder.glob("*/*.pix"):
                with contextlib.suppress(OSError):
                    self._used += path.stat().st_size
        return self._used < self._most_bytes


# What the chosen views show at n poses, of "rgb" and "depth_m" those asked for: (n, views, H, W, 3) uint8, sRGB, and
# planar depth, (n, views, H, W) float32, metres, 0 where there is nothing within range.
Frames = dict[str, NDArray[Any]]


def take(frames: Frames, rows: NDArray[np.int64]) -> Frames:
    """Keep some poses, in their order."""
    return {name: seen[rows] for name, seen in frames.items()}


def put(out: Frames, rows: NDArray[np.int64], frames: Frames) -> None:
    """Give poses their rows."""
    for name, images in frames.items():
        out[name][rows] = images


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
        context = open_scene(*mesh_of(*index.sources[int(trajectories[0])]), SEVERAL)
        poses = {int(k): index.poses_of(int(k)) for k in np.unique(trajectories)}
        at = np.stack([poses[k][s] for k, s in zip(trajectories.tolist(), steps.tolist(), strict=True)])
        rgb, depth_m = renderer_for(context.scene, self._renderer).render_bodies(sensors.camera, at, sensors.views)
        images: Frames = {"rgb": rgb, "depth_m": clip_depth(depth_m, sensors)}
        return {name: images[name] for name in empty_frames(sensors, 0)}


class RecordedFrames:
    """Pictures read from recordings, made smaller; what has none is drawn."""

    def __init__(self, index: Index, sensors: Sensors, drawn: Source) -> None:
        self._index, self._sensors, self._drawn = index, sensors, drawn
        self._known: dict[str, dict[str, int]] = {}

    def has(self, trajectory: int) -> bool:
        """Whether a trajectory has a recording of all that is asked for."""
        index = self._index
        (root, scene), nav_id = index.sources[trajectory], index.nav_id[trajectory]
        if scene not in self._known:
            self._known[scene] = recorded_frames(root, scene, self._sensors)
        # The recording has a frame a pose of the reference; that of an older version may have other actions.
        frames = self._known[scene].get(nav_id, 0)
        return 0 <= frames - int(index.steps[trajectory]) <= 1

    def frames(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        """Read; see `Source`."""
        known = np.array([self.has(int(k)) for k in trajectories])
        # Frame after frame of each: a seek decodes from the key frame on.
        order = np.lexsort((steps, trajectories))
        out = empty_frames(self._sensors, len(steps))
        for rows, read in ((order[known[order]], self._read), (order[~known[order]], self._drawn.frames)):
            if len(rows):
                put(out, rows, read(trajectories[rows], steps[rows]))
        return out

    def _read(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        index, s = self._index, self._sensors
        out = empty_frames(s, len(steps))
        # Of depth the nearest value, not a mean: between two surfaces there is none.
        interpolations = {"rgb": cv2.INTER_AREA, "depth_m": cv2.INTER_NEAREST_EXACT}
        for row, (k, step) in enumerate(zip(trajectories.tolist(), steps.tolist(), strict=True)):
            root, scene = index.sources[k]
            recording = _recording(root, f"media/{scene}/{index.nav_id[k]}")
            for (v, view), name in itertools.product(enumerate(s.views), out):
                out[name][row, v] = resized(getattr(recording, name)[view][step], s, interpolations[name])
        if s.depth:
            clip_depth(out["depth_m"], s)
        return out


def recorded_frames(root: DataRoot, scene: str, sensors: Sensors) -> dict[str, int]:
    """Count the frames of recordings that have all views, one a pose, without quality flags, by ``nav_id``."""
    if not root.list("recordings", f"{scene}/*.parquet"):
        return {}
    columns = ("nav_id", "view", "modality", "sampling", "n_frames", "width", "height", "fov_deg", "ok")
    kinds = [kind for kind, on in (("rgb", sensors.rgb), ("depth", sensors.depth)) if on]
    counts: dict[str, dict[tuple[str, str], int]] = defaultdict(dict)
    for row in store.read_stored(root, "recordings", scene, columns).to_pylist():
        # Pixels of another shape would show another field of view.
        fits = row["width"] * sensors.height == row["height"] * sensors.width and row["fov_deg"] == sensors.fov_deg
        if row["ok"] and row["sampling"] == "steps" and fits:
            counts[row["nav_id"]][row["view"], row["modality"]] = row["n_frames"]
    wanted = {*itertools.product(sensors.views, kinds)}
    return {nav_id: [*frames.values()][-1] for nav_id, frames in counts.items() if wanted <= frames.keys()}


# Few are kept open: a trajectory's steps follow each other within a block.
@lru_cache(maxsize=16)
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


def resized(image: NDArray[Any], sensors: Sensors, how: int) -> NDArray[Any]:
    """Make a picture as large as the sensors' are, by an interpolation of OpenCV's."""
    if image.shape[:2] == (sensors.height, sensors.width):
        return image
    return np.asarray(cv2.resize(image, (sensors.width, sensors.height), interpolation=how))
