"""The frames of a recording's videos, decoded on access."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, overload

import av
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.base.pictures import decode_as_stored


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
