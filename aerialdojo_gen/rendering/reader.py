"""Read recordings back as arrays, one frame at a time.

>>> recording = read_recording(Path("data/media/U_Mall_0/<nav_id>"))  # doctest: +SKIP
>>> recording.rgb["front"][12]        # (640, 640, 3) uint8, decoded now
>>> recording.depth_m["down"][12]     # (640, 640) float32, metres, inf where nothing lies within range
>>> recording.cameras["front"]["K"]   # intrinsics; pixel centres are at (column + 0.5, row + 0.5)

Other readers work too: `docs/recordings.md` has examples for PyAV and OpenCV.
"""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import av
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import Malformed, RenderError
from aerialdojo_gen.base.pictures import decode_as_stored
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.geometry.arrays import Singles
from aerialdojo_gen.rendering.codecs import SUFFIX, to_metres
from aerialdojo_gen.rendering.placement import TILED


class Frames(Sequence[NDArray[Any]]):
    """Frames that are decoded on access, in any order."""

    path: Path

    @overload
    def __getitem__(self, k: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, k: slice) -> list[NDArray[Any]]: ...
    def __getitem__(self, k: int | slice) -> NDArray[Any] | list[NDArray[Any]]:
        """Decode frame k, or those of a slice."""
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        if not -len(self) <= k < len(self):
            raise IndexError(f"{self.path.name} has {len(self)} frames, not {k}")
        return self._decode(k % len(self))

    @abstractmethod
    def _decode(self, k: int) -> NDArray[Any]:
        """Decode frame k, not negative."""


class Video(Frames):
    """The frames of a video file, or of a folder of PNG files."""

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
                # A stream of an unknown codec has neither.
                if own.codec_context is None or own.format is None:
                    raise RenderError(f"{path} has an unknown codec: render it again")
                self.metadata = {k.lower(): v for k, v in container.metadata.items()}
                self.fps = float(own.average_rate or 0)
                self.width, self.height = own.width, own.height
                self._depth = own.format.name.startswith("gray16")
                self._pts = sorted(p.pts for p in container.demux(own) if p.pts is not None)
        except (av.FFmpegError, OSError, IndexError, UnicodeDecodeError) as error:
            raise RenderError(f"{path} is no readable video ({error}): render it again") from None

    def _open_folder(self) -> None:
        """Read a folder's metadata as of a video's header; `fps` is unknown there."""
        camera = self.path / "camera.json"
        if not self._files or not camera.is_file():
            raise RenderError(f"{self.path} holds no frames: render it again")
        # What is not UTF-8 is no JSON either: `read_recording` rejects it.
        self.metadata = {"comment": camera.read_text(encoding="utf-8", errors="surrogateescape")}
        self.fps = 0.0
        self._pts = list(range(len(self._files)))
        self.height, self.width = self._png(0).shape[:2]

    def _png(self, k: int) -> NDArray[Any]:
        image = decode_as_stored(self._files[k].read_bytes())
        if image is None:
            raise RenderError(f"{self._files[k]} is no readable picture: render it again")
        return image

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._pts)

    def _decode(self, k: int) -> NDArray[Any]:
        """Decode frame k: (H, W, 3) uint8 of a picture, (H, W) uint16 of depth in the file's units."""
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

    def cached(self, k: int) -> NDArray[Any]:
        """Decode frame k, or return it if it was the last one decoded here; read-only."""
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
    """One view of a tiled video; the views of a frame are decoded once."""

    def __init__(self, whole: Video, camera: dict[str, Any]) -> None:
        self.path, self.fps, self._pts = whole.path, whole.fps, whole._pts
        self.metadata = {"comment": json.dumps(camera)}
        self._parent = whole
        box = [camera.get(name) for name in ("left_px", "top_px", "width", "height")]
        if not all(isinstance(edge, int) and 0 <= edge < 1 << 16 for edge in box):
            raise RenderError(f"{whole.path} lacks the positions of its views: render it again")
        self._left, self._top, self.width, self.height = (int(edge) for edge in box if edge is not None)
        if self._left + self.width > whole.width or self._top + self.height > whole.height:
            raise RenderError(f"{whole.path} places a view outside its frames: render it again")

    def _decode(self, k: int) -> NDArray[Any]:
        frame = self._parent.cached(k)
        return frame[self._top : self._top + self.height, self._left : self._left + self.width].copy()


class DepthVideo(Frames):
    """Depth in metres, over a `Video` of the stored values.

    Attributes
    ----------
    stored : Video
        The stored values, (H, W) uint16; 0 where nothing lies within range.
    step : float
        0 where these are millimetres, else the share by which they grow (`codecs.to_stored`).
    """

    def __init__(self, video: Video, step: float = 0.0) -> None:
        self.path, self.stored = video.path, video
        self.step = step  # 0 where the stored values are millimetres, else the share by which they grow

    @property
    def millimetres(self) -> Video:
        """The stored values, where they are millimetres; RenderError where they are not."""
        if self.step:
            raise RenderError(f"{self.path} stores relative steps of {self.step:g}, not millimetres")
        return self.stored

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.stored)

    def _decode(self, k: int) -> Singles:
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
        videos = _tiles(folder / TILED)
    else:
        videos = {modality: _videos(folder, modality) for modality in SUFFIX}
        rgb, depth, instance = videos.values()
        if not rgb or rgb.keys() != depth.keys() or (instance and instance.keys() != rgb.keys()):
            raise RenderError(f"no complete recording in {folder}: run {command('render')}")
        if len({len(v) for v in (*rgb.values(), *depth.values(), *instance.values())}) != 1:
            raise RenderError(f"the videos in {folder} differ in length: render them again")
    cameras = {view: _camera(video) for view, video in videos["rgb"].items()}
    depth_m = {view: DepthVideo(video, _step(video)) for view, video in videos["depth"].items()}
    fps = next(iter(videos["rgb"].values())).fps
    return Recording(videos["rgb"], depth_m, cameras, fps, videos.get("instance", {}))


def open_view(path: str | Path, view: str, modality: str) -> Video:
    """Open the video of one view and modality in a file that a row of `recordings` names."""
    path = Path(path)
    if path.name != TILED:
        return Video(path)
    found = _tiles(path).get(modality, {}).get(view)
    if found is None:
        raise RenderError(f"{path} has no {modality} of the view {view}: render it again")
    return found


def _tiles(path: Path) -> dict[str, dict[str, Video]]:
    """Open the views of a tiled file, by modality and view."""
    first = Video(path)
    metadata = _camera(first)
    cameras, names = metadata.get("tiles"), metadata.get("streams")
    if not (
        isinstance(cameras, dict) and cameras and all(isinstance(c, dict) for c in cameras.values())
        and isinstance(names, list) and names[:2] == ["rgb", "depth"] and names[2:] in ([], ["instance"])
    ):  # fmt: skip
        raise RenderError(f"{path} has no list of its views: render it again")
    videos = {name: first if k == 0 else Video(path, k) for k, name in enumerate(names)}
    if len({len(whole) for whole in videos.values()}) != 1:
        raise RenderError(f"the videos in {path} differ in length: render them again")
    return {name: {view: Tile(whole, camera) for view, camera in cameras.items()} for name, whole in videos.items()}


def _step(video: Video) -> float:
    """Return the step of stored depth; old recordings have none: millimetres."""
    step = _camera(video).get("depth_step", 0.0)
    if type(step) not in (int, float) or not 0.0 <= step <= 0.1:
        raise RenderError(f"{video.path}: its camera comment has no depth_step from 0 to 0.1")
    return float(step)


def _camera(video: Video) -> dict[str, Any]:
    try:
        camera = loads_json(video.metadata.get("comment", "{}"))
    except Malformed as error:
        raise RenderError(f"{video.path}: its camera comment {error}: render it again") from None
    if not isinstance(camera, dict):
        raise RenderError(f"{video.path}: its camera comment is no JSON object: render it again")
    return camera


def _videos(folder: Path, modality: str) -> dict[str, Video]:
    paths = [
        *folder.glob(f"*_{modality}.{SUFFIX[modality]}"),
        *(p for p in folder.glob(f"*_{modality}") if p.is_dir()),
    ]
    return {p.stem.removesuffix(f"_{modality}"): Video(p) for p in sorted(paths)}
