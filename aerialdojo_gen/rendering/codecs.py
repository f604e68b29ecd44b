"""Writers of the recordings: RGB as H.264 in MP4, depth and instance ids without loss as FFV1 in Matroska; or PNG.

Depth is stored as 16-bit grey: planar depth in whole millimetres, rounded. 0 means that nothing lies within range:
the sky, or a surface farther than 65.535 m. Instance ids are 16-bit grey too, one more than the instance's number, 0
where nothing is seen. All writers give the same bytes for the same frames.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.common.pictures import FRAME_PNG, encode_png

MAX_DEPTH_M = 65.535
RGB_CODEC, DEPTH_CODEC = "h264", "ffv1"
SUFFIX = {"rgb": "mp4", "depth": "mkv", "instance": "mkv"}
CODEC = {"rgb": RGB_CODEC, "depth": DEPTH_CODEC, "instance": DEPTH_CODEC}

# A short closed GOP without B-frames: a seek decodes 15 frames at most, and lands on the frame asked for.
_H264 = {"preset": "veryfast", "g": "15", "bf": "0", "flags": "+bitexact+cgop"}
# Every frame a key frame; a checksum a slice, so that a damaged file is noticed.
_FFV1 = {"level": "3", "slices": "4", "slicecrc": "1", "g": "1", "flags": "+bitexact"}


def to_millimetres(depth_m: NDArray[np.floating[Any]]) -> NDArray[np.uint16]:
    """Depth as it is stored.

    Parameters
    ----------
    depth_m : float array
        Planar depth, metres; inf or NaN where nothing is hit.

    Returns
    -------
    uint16 array
        Millimetres, rounded; 0 where nothing lies within `MAX_DEPTH_M`.
    """
    d = np.nan_to_num(np.asarray(depth_m), nan=0.0, posinf=0.0, neginf=0.0)
    mm = np.rint(d * 1000.0)
    return np.where((mm >= 0.0) & (mm <= 65535.0), mm, 0.0).astype(np.uint16)


def to_metres(millimetres: NDArray[np.uint16]) -> NDArray[np.float32]:
    """Depth in metres from what is stored, float32; inf where nothing lies within range."""
    return np.where(millimetres == 0, np.float32(np.inf), millimetres.astype(np.float32) / np.float32(1000.0))


class VideoWriter:
    """Write a video frame by frame; a context manager.

    Parameters
    ----------
    path : Path
        The file; its suffix plays no part.
    modality : str
        ``"rgb"`` (frames (H, W, 3) uint8, even H and W), ``"depth"`` (frames (H, W) uint16, millimetres) or
        ``"instance"`` (frames (H, W) uint16).
    width, height : int
        Pixels.
    fps : float
        Frames a second.
    crf : int
        Quality of H.264, lower is better.
    comment : str
        Stored in the file: what the reader must know of the camera.
    """

    def __init__(
        self, path: Path, modality: str, width: int, height: int, fps: float, crf: int = 23, comment: str = ""
    ) -> None:
        rgb = modality == "rgb"
        self._format = "rgb24" if rgb else "gray16le"
        # Without bitexact the Matroska muxer writes a random id into every file, and both the library's version.
        self._container = av.open(
            str(path), "w", format="mp4" if rgb else "matroska", options={"fflags": "+bitexact"}
        )
        if comment:
            self._container.metadata["comment"] = comment
        rate = Fraction(fps).limit_denominator(1000)
        options = _H264 | {"crf": str(crf)} if rgb else _FFV1
        self._stream: Any = self._container.add_stream("libx264" if rgb else "ffv1", rate=rate, options=options)
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt = "yuv420p" if rgb else "gray16le"
        # Threads would split the rate control and with it the bytes.
        self._stream.codec_context.thread_count = 1

    def write(self, frame: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
        """Append a frame."""
        picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format=self._format)
        for packet in self._stream.encode(picture):
            self._container.mux(packet)

    def close(self) -> None:
        """Write what is left and close the file."""
        for packet in self._stream.encode():
            self._container.mux(packet)
        self._container.close()

    def __enter__(self) -> VideoWriter:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the file, or only close it where the block failed."""
        if kind is None:
            self.close()
        else:
            self._container.close()


class PngWriter:
    """Write frames as loose PNG files, ``000000.png`` and on; a context manager.

    Parameters
    ----------
    folder : Path
        Made here; it must not exist.
    comment : str
        Stored beside the frames, in ``camera.json``.
    """

    def __init__(self, folder: Path, comment: str = "") -> None:
        self._folder, self._n = folder, 0
        folder.mkdir()
        (folder / "camera.json").write_text(comment or "{}", encoding="utf-8")

    def write(self, frame: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
        """Append a frame: (H, W, 3) uint8 RGB, or (H, W) uint16."""
        (self._folder / f"{self._n:06}.png").write_bytes(encode_png(frame, FRAME_PNG))
        self._n += 1

    def __enter__(self) -> PngWriter:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Do nothing: every frame is a file of its own."""
