"""Videos of many trajectories one after the other, as LeRobot reads them: H.264, and depth as HEVC of 12 bits."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

# Frames are read in any order: every second one is a key frame, as in LeRobot's own videos.
KEY_EVERY = 2
QP = 20
DEPTH_CODES = 4096
# Metres, of LeRobot's logarithmic steps: code 0 is 0 m, which is "nothing within range" here.
DEPTH_MIN_M, DEPTH_SHIFT_M = 0.0, 3.5

_OPTIONS = {
    # A constant quantiser, and nothing that is decided by floating-point numbers: their sums depend on the processor.
    "rgb": ("libx264", "yuv420p", {
        "g": str(KEY_EVERY), "bf": "0", "qp": str(QP), "preset": "veryfast", "flags": "+bitexact+cgop",
        "x264-params": "aq-mode=0:mbtree=0:weightp=0:rc-lookahead=0:scenecut=0:cpu-independent=1",
    }),
    # One thread and no pool: the bytes must not depend on the machine's cores.
    "depth": ("libx265", "gray12le", {
        "g": str(KEY_EVERY), "preset": "ultrafast", "flags": "+bitexact+cgop",
        "x265-params": "lossless=1:bframes=0:pools=none:frame-threads=1:no-info=1:log-level=none",
    }),
}  # fmt: skip


class Clip:
    """Writes a video frame by frame, at even intervals; a context manager."""

    def __init__(self, path: Path, kind: str, width: int, height: int, fps: int) -> None:
        codec, pixels, options = _OPTIONS[kind]
        # Without bitexact the muxer writes the library's version into every file.
        self._container = av.open(str(path), "w", format="mp4", options={"fflags": "+bitexact"})
        stream: Any = self._container.add_stream(codec, rate=Fraction(fps), options=options)
        stream.width, stream.height, stream.pix_fmt = width, height, pixels
        stream.codec_context.thread_count = 1
        self._stream, self._format = stream, "rgb24" if kind == "rgb" else pixels

    def write(self, frame: NDArray[Any]) -> None:
        """Append a frame."""
        picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format=self._format)
        for packet in self._stream.encode(picture):
            self._container.mux(packet)

    def __enter__(self) -> Clip:
        """Return itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Finish the file, or only close it where the block failed."""
        if kind is None:
            for packet in self._stream.encode():
                self._container.mux(packet)
        self._container.close()


def depth_codes(depth_m: NDArray[np.float32], most_m: float) -> NDArray[np.uint16]:
    """Depth in metres, up to `most_m`, as LeRobot's logarithmic 12-bit codes; the error is at most half a step."""
    low, span = math.log(DEPTH_MIN_M + DEPTH_SHIFT_M), _span(most_m)
    scaled = (np.log(depth_m + np.float32(DEPTH_SHIFT_M)) - np.float32(low)) * np.float32((DEPTH_CODES - 1) / span)
    return np.rint(scaled).clip(0, DEPTH_CODES - 1).astype(np.uint16)


def depths_of_codes_m(most_m: float) -> NDArray[np.float64]:
    """Return the depths that codes stand for, (4096,) float64, metres."""
    steps = np.arange(DEPTH_CODES) * (_span(most_m) / (DEPTH_CODES - 1))
    return np.clip(np.exp(steps + math.log(DEPTH_MIN_M + DEPTH_SHIFT_M)) - DEPTH_SHIFT_M, DEPTH_MIN_M, most_m)


def _span(most_m: float) -> float:
    return math.log(most_m + DEPTH_SHIFT_M) - math.log(DEPTH_MIN_M + DEPTH_SHIFT_M)
