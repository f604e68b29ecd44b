"""Read recordings back as arrays, one frame at a time.

>>> recording = read_recording(Path("data/media/U_Mall_0/<nav_id>"))  # doctest: +SKIP
>>> recording.rgb["front"][12]        # (640, 640, 3) uint8, decoded now
>>> recording.depth_m["down"][12]     # (640, 640) float32, metres, inf where nothing lies within range
>>> recording.cameras["front"]["K"]   # intrinsics; pixel centres are at (column + 0.5, row + 0.5)

The files are plain ones, for any other reader: `docs/recordings.md` has examples for PyAV and OpenCV.
"""

from __future__ import annotations

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


class Video(Sequence[NDArray[Any]]):
    """The frames of a video file, or of a folder of PNG files; decoded when asked for, in any order.

    Parameters
    ----------
    path : str or Path
        What `aerialdojo_gen.rendering.codecs.VideoWriter` or `PngWriter` wrote.

    Raises
    ------
    RenderError
        The file cannot be read, or is cut off: the message names it.
    """

    def __init__(self, path: str | Path) -> None:
        path = Path(path)
        self.path = path
        self._frames: Iterator[Any] = iter(())
        self._next = -1
        self._files = sorted(path.glob("*.png")) if path.is_dir() else []
        if path.is_dir():
            self._open_folder()
            return
        try:
            with av.open(str(path)) as container:
                stream = container.streams.video[0]
                # A stream of a codec that FFmpeg does not know has none, and then no format either.
                if stream.codec_context is None or stream.format is None:
                    raise RenderError(f"{path} says nothing of its pictures: render it again")
                self.metadata = {k.lower(): v for k, v in container.metadata.items()}
                self.fps = float(stream.average_rate or 0)
                self.width, self.height = stream.width, stream.height
                self._depth = stream.format.name.startswith("gray16")
                self._pts = sorted(p.pts for p in container.demux(stream) if p.pts is not None)
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

    def _from(self, pts: int) -> Iterator[Any]:
        with av.open(str(self.path)) as container:
            stream = container.streams.video[0]
            stream.codec_context.thread_count = 1
            container.seek(pts, stream=stream, backward=True)
            for frame in container.decode(stream):
                if frame.pts is not None and frame.pts >= pts:
                    yield frame


class DepthVideo(Sequence[NDArray[np.float32]]):
    """Depth in metres, over a `Video` of millimetres.

    Attributes
    ----------
    millimetres : Video
        The stored values, (H, W) uint16; 0 where nothing lies within range.
    """

    def __init__(self, video: Video) -> None:
        self.millimetres = video

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.millimetres)

    @overload
    def __getitem__(self, k: int) -> NDArray[np.float32]: ...
    @overload
    def __getitem__(self, k: slice) -> list[NDArray[np.float32]]: ...
    def __getitem__(self, k: int | slice) -> NDArray[np.float32] | list[NDArray[np.float32]]:
        """Decode frame k: (H, W) float32, metres; inf where nothing lies within range."""
        if isinstance(k, slice):
            return [to_metres(frame) for frame in self.millimetres[k]]
        return to_metres(self.millimetres[k])


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
    rgb, depth, instance = (_videos(folder, modality) for modality in ("rgb", "depth", "instance"))
    if not rgb or rgb.keys() != depth.keys() or (instance and instance.keys() != rgb.keys()):
        raise RenderError(f"no complete recording in {folder}: run {command('render')}")
    if len({len(v) for v in (*rgb.values(), *depth.values(), *instance.values())}) != 1:
        raise RenderError(f"the videos in {folder} differ in length: render them again")
    cameras = {view: _camera(video) for view, video in rgb.items()}
    metres = {view: DepthVideo(video) for view, video in depth.items()}
    return Recording(rgb, metres, cameras, next(iter(rgb.values())).fps, instance)


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
