"""Read recordings back as arrays, one frame at a time.

>>> recording = read_recording(Path("data/media/U_Mall_0/<nav_id>"))  # doctest: +SKIP
>>> recording.rgb["front"][12]        # (640, 640, 3) uint8, decoded now
>>> recording.depth_m["down"][12]     # (640, 640) float32, metres, inf where nothing lies within range
>>> recording.cameras["front"]["K"]   # intrinsics; pixel centres are at (column + 0.5, row + 0.5)

The files are plain ones, for any other reader: `docs/recordings.md` has examples for PyAV and OpenCV.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import av
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.common.advice import command
from aerialdojo_gen.common.bounded import loads_json
from aerialdojo_gen.common.pictures import decode_as_stored
from aerialdojo_gen.errors import Malformed, RenderError
from aerialdojo_gen.rendering.codecs import SUFFIX, to_metres
from aerialdojo_gen.rendering.placement import TILED


class Video(Sequence[NDArray[Any]]):
    """The frames of a video file, or of a folder of PNG files; decoded when asked for, in any order.

    Parameters
    ----------
    path : str or Path
        What `aerialdojo_gen.rendering.codecs.VideoWriter` or `PngWriter` wrote.
    stream : int
        Which of the file's videos.

    Raises
    ------
    RenderError
        The file cannot be read, or is cut off: the message names it.
    """

    def __init__(self, path: str | Path, stream: int = 0) -> None:
        path = Path(path)
        self.path, self._stream = path, stream
        self._frames: Iterator[Any] = iter(())
        self._next = -1
        self._last: tuple[int, NDArray[Any]] | None = None
        self._files = sorted(path.glob("*.png")) if path.is_dir() else []
        if path.is_dir():
            self._open_folder()
            return
        try:
            with av.open(str(path)) as container:
                own = container.streams.video[stream]
                # A stream of a codec that FFmpeg does not know has none, and then no format either.
                if own.codec_context is None or own.format is None:
                    raise RenderError(f"{path} says nothing of its pictures: render it again")
                self.metadata = {k.lower(): v for k, v in container.metadata.items()}
                self.fps = float(own.average_rate or 0)
                self.width, self.height = own.width, own.height
                self._depth = own.format.name.startswith("gray16")
                self._pts = sorted(p.pts for p in container.demux(own) if p.pts is not None)
        except (av.FFmpegError, OSError, IndexError, UnicodeDecodeError) as error:
            raise RenderError(f"{path} is no video that can be read ({error}): render it again") from None

    def _open_folder(self) -> None:
        """Take what a video's header says from a folder: `fps` is not known there."""
        camera = self.path / "camera.json"
        if not self._files or not camera.is_file():
            raise RenderError(f"{self.path} holds no frames: render it again")
        # What is not UTF-8 is no JSON either, and `read_recording` says so.
        self.metadata = {"comment": camera.read_text(encoding="utf-8", errors="surrogateescape")}
        self.fps = 0.0
        self._pts = list(range(len(self._files)))
        self.height, self.width = self._png(0).shape[:2]

    def _png(self, k: int) -> NDArray[Any]:
        image = decode_as_stored(self._files[k].read_bytes())
        if image is None:
            raise RenderError(f"{self._files[k]} is no picture that can be read: render it again")
        return image

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._pts)

    @overload
    def __getitem__(self, k: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, k: slice) -> list[NDArray[Any]]: ...
    def __getitem__(self, k: int | slice) -> NDArray[Any] | list[NDArray[Any]]:
        """Decode frame k: (H, W, 3) uint8 of a picture, (H, W) uint16 millimetres of depth."""
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        if not -len(self) <= k < len(self):
            raise IndexError(f"{self.path.name} has {len(self)} frames, not {k}")
        k %= len(self)
        if self._files:
            return self._png(k)
        if k != self._next:
            self._frames = self._from(self._pts[k])
        try:
            frame = next(self._frames)
        except (StopIteration, av.FFmpegError) as error:
            self._next = -1
            raise RenderError(f"{self.path}: frame {k} does not decode ({error}): render it again") from None
        self._next = k + 1
        array = frame.to_ndarray() if self._depth else frame.to_ndarray(format="rgb24")
        return np.asarray(array)

    def kept(self, k: int) -> NDArray[Any]:
        """Decode frame k, or return it where it was the last one asked for here; not to be written to."""
        if self._last is None or self._last[0] != k:
            self._last = (k, self[k])
        return self._last[1]

    def _from(self, pts: int) -> Iterator[Any]:
        with av.open(str(self.path)) as container:
            stream = container.streams.video[self._stream]
            stream.codec_context.thread_count = 1
            container.seek(pts, stream=stream, backward=True)
            for frame in container.decode(stream):
                if frame.pts is not None and frame.pts >= pts:
                    yield frame


class Tile(Video):
    """One view of a tiled video, decoded with the others: the views of a frame are decoded once.

    Parameters
    ----------
    whole : Video
        The same for all views of a file.
    camera : dict
        What the file says of the view: ``left_px``, ``top_px``, ``width`` and ``height`` among it.

    Raises
    ------
    RenderError
        The view lies beyond the video's frame.
    """

    def __init__(self, whole: Video, camera: dict[str, Any]) -> None:
        self.path, self.fps, self._pts = whole.path, whole.fps, whole._pts
        self.metadata = {"comment": json.dumps(camera)}
        self._whole = whole
        box = [camera.get(name) for name in ("left_px", "top_px", "width", "height")]
        if not all(isinstance(edge, int) and 0 <= edge < 1 << 16 for edge in box):
            raise RenderError(f"{whole.path} does not say where its views lie: render it again")
        self._left, self._top, self.width, self.height = (int(edge) for edge in box if edge is not None)
        if self._left + self.width > whole.width or self._top + self.height > whole.height:
            raise RenderError(f"{whole.path} says that a view lies beyond its frames: render it again")

    @overload
    def __getitem__(self, k: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, k: slice) -> list[NDArray[Any]]: ...
    def __getitem__(self, k: int | slice) -> NDArray[Any] | list[NDArray[Any]]:
        """Decode frame k: (H, W, 3) uint8 of a picture, (H, W) uint16 of depth in the file's units."""
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        frame = self._whole.kept(k)
        return frame[self._top : self._top + self.height, self._left : self._left + self.width].copy()


class DepthVideo(Sequence[NDArray[np.float32]]):
    """Depth in metres, over a `Video` of what is stored.

    Attributes
    ----------
    stored : Video
        The stored values, (H, W) uint16; 0 where nothing lies within range.
    step : float
        0 where these are millimetres, else the share by which they grow (`codecs.to_stored`).
    """

    def __init__(self, video: Video, step: float = 0.0) -> None:
        self.stored, self.step = video, step

    @property
    def millimetres(self) -> Video:
        """The stored values, where they are millimetres.

        Raises
        ------
        RenderError
            They are not.
        """
        if self.step:
            raise RenderError(f"{self.stored.path} stores no millimetres, but steps of {self.step:g} of the depth")
        return self.stored

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.stored)

    @overload
    def __getitem__(self, k: int) -> NDArray[np.float32]: ...
    @overload
    def __getitem__(self, k: slice) -> list[NDArray[np.float32]]: ...
    def __getitem__(self, k: int | slice) -> NDArray[np.float32] | list[NDArray[np.float32]]:
        """Decode frame k: (H, W) float32, metres; inf where nothing lies within range."""
        if isinstance(k, slice):
            return [to_metres(frame, self.step) for frame in self.stored[k]]
        return to_metres(self.stored[k], self.step)


@dataclass(frozen=True)
class Recording:
    """All videos of one trajectory.

    Attributes
    ----------
    rgb : dict of str to Video
        By view; frames are (H, W, 3) uint8.
    depth_m : dict of str to DepthVideo
        By view; frames are (H, W) float32, planar depth in metres, inf where nothing lies within range.
    cameras : dict of str to dict
        By view: ``K`` (3 x 3, pixels), ``body_from_camera`` (4 x 4; body x forward, y left, z up), ``fov_deg``,
        ``pixel_centre``.
    fps : float
        Frames a second; 0 for PNG files, whose frames' times stand in the table ``frames``.
    instance : dict of str to Video
        By view, where they were recorded; frames are (H, W) uint16: number of the node in the scene's mesh, plus 1.
    """

    rgb: dict[str, Video]
    depth_m: dict[str, DepthVideo]
    cameras: dict[str, dict[str, Any]]
    fps: float
    instance: dict[str, Video]

    def __len__(self) -> int:
        """Return the number of frames, the same in every video."""
        return len(next(iter(self.rgb.values())))


def read_recording(folder: str | Path) -> Recording:
    """Open a recording.

    Parameters
    ----------
    folder : str or Path
        ``<data>/media/<scene>/<nav_id>``.

    Returns
    -------
    Recording
        Nothing is decoded yet.

    Raises
    ------
    RenderError
        There is no recording, a video is missing or damaged, or the videos differ in length.
    """
    folder = Path(folder)
    if (folder / TILED).is_file():
        return _tiled(folder / TILED)
    rgb, depth, instance = (_videos(folder, modality) for modality in ("rgb", "depth", "instance"))
    if not rgb or rgb.keys() != depth.keys() or (instance and instance.keys() != rgb.keys()):
        raise RenderError(f"no complete recording in {folder}: run {command('render')}")
    if len({len(v) for v in (*rgb.values(), *depth.values(), *instance.values())}) != 1:
        raise RenderError(f"the videos in {folder} differ in length: render them again")
    cameras = {view: _camera(video) for view, video in rgb.items()}
    metres = {view: DepthVideo(video, _step(_camera(video), video)) for view, video in depth.items()}
    return Recording(rgb, metres, cameras, next(iter(rgb.values())).fps, instance)


def open_view(path: str | Path, view: str, modality: str) -> Video:
    """Open the video of one view, whichever way its file holds it.

    Parameters
    ----------
    path : str or Path
        As a row of `recordings` names it.
    view, modality : str
        As that row has them.

    Returns
    -------
    Video

    Raises
    ------
    RenderError
        The file cannot be read, or has no such view.
    """
    path = Path(path)
    if path.name != TILED:
        return Video(path)
    found = _tiles(path)[0].get(modality, {}).get(view)
    if found is None:
        raise RenderError(f"{path} has no {modality} of the view {view}: render it again")
    return found


def _tiles(path: Path) -> tuple[dict[str, dict[str, Video]], dict[str, dict[str, Any]]]:
    """Open the views of a tiled file, by modality and view, and return their cameras."""
    first = Video(path)
    said = _camera(first)
    cameras, names = said.get("tiles"), said.get("streams")
    if not (
        isinstance(cameras, dict) and cameras and all(isinstance(c, dict) for c in cameras.values())
        and isinstance(names, list) and names[:2] == ["rgb", "depth"] and names[2:] in ([], ["instance"])
    ):  # fmt: skip
        raise RenderError(f"{path} does not say which views it holds: render it again")
    wholes = {name: first if k == 0 else Video(path, k) for k, name in enumerate(names)}
    if len({len(whole) for whole in wholes.values()}) != 1:
        raise RenderError(f"the videos in {path} differ in length: render them again")
    tiles = {name: {view: Tile(whole, camera) for view, camera in cameras.items()} for name, whole in wholes.items()}
    return {name: dict(views) for name, views in tiles.items()}, cameras


def _tiled(path: Path) -> Recording:
    videos, cameras = _tiles(path)
    depth = {view: DepthVideo(video, _step(cameras[view], video)) for view, video in videos["depth"].items()}
    fps = next(iter(videos["rgb"].values())).fps
    return Recording(videos["rgb"], depth, cameras, fps, videos.get("instance", {}))


def _step(camera: dict[str, Any], video: Video) -> float:
    """Return the step of stored depth; recordings from before there was a choice say nothing: millimetres."""
    step = camera.get("depth_step", 0.0)
    if type(step) not in (int, float) or not 0.0 <= step <= 0.1:
        raise RenderError(f"{video.path}: what it says of its camera has no depth_step from 0 to 0.1")
    return float(step)


def _camera(video: Video) -> dict[str, Any]:
    try:
        camera = loads_json(video.metadata.get("comment", "{}"))
    except Malformed as error:
        raise RenderError(f"{video.path}: what it says of its camera {error}: render it again") from None
    if not isinstance(camera, dict):
        raise RenderError(f"{video.path}: what it says of its camera is no object: render it again")
    return camera


def _videos(folder: Path, modality: str) -> dict[str, Video]:
    paths = [
        *folder.glob(f"*_{modality}.{SUFFIX[modality]}"),
        *(p for p in folder.glob(f"*_{modality}") if p.is_dir()),
    ]
    return {p.stem.removesuffix(f"_{modality}"): Video(p) for p in sorted(paths)}
