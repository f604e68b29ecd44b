"""Writers of the recordings: RGB as H.264 in MP4, depth and instance ids without loss as FFV1 in Matroska; or PNG.

Depth is stored as 16-bit grey: planar depth in whole millimetres, or in relative steps. 0 means out of range: the
sky, or a surface farther than 65.535 m. Instance ids are 16-bit grey too, one more than the instance's number, 0 for
none. All writers give the same bytes for the same frames.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.base.pictures import FRAME_PNG, encode_png
from aerialdojo_gen.geometry.arrays import Bytes, Int32s, Singles

MAX_DEPTH_M = 65.535
RGB_CODEC, DEPTH_CODEC = "h264", "ffv1"
SUFFIX = {"rgb": "mp4", "depth": "mkv", "instance": "mkv"}
CODEC = {"rgb": RGB_CODEC, "depth": DEPTH_CODEC, "instance": DEPTH_CODEC}

# A short closed GOP without B-frames: a seek decodes 15 frames at most, and is exact.
_H264 = {"g": "15", "bf": "0", "flags": "+bitexact+cgop"}
# Every frame a key frame; a checksum per slice detects damaged files.
_FFV1 = {"level": "3", "slices": "4", "slicecrc": "1", "g": "1", "flags": "+bitexact"}

# 16 and 128, plus half a unit for rounding.
_Y_OFFSET, _UV_OFFSET = (16 << 16) + (1 << 15), (128 << 18) + (1 << 17)


def to_stored(depth_m: NDArray[np.floating[Any]], step: float = 0.0) -> NDArray[np.uint16]:
    """Planar depth in metres as stored uint16: millimetres, or nearest of `stored_depths_m(step)`; 0 for no hit."""
    depth = np.ascontiguousarray(depth_m)
    out = np.empty(depth.shape, dtype=np.uint16)
    _round(depth.reshape(-1), depth.dtype.type(1000.0), out.reshape(-1))
    return _steps(step)[out] if step else out


@njit(cache=True)
def _round(depth_m: NDArray[Any], millimetres_a_metre: Any, out: NDArray[np.uint16]) -> None:
    for k in range(len(depth_m)):
        mm = np.rint(depth_m[k] * millimetres_a_metre)
        # False for NaN too.
        out[k] = np.uint16(mm) if 0.0 <= mm <= 65535.0 else np.uint16(0)


def to_metres(stored: NDArray[np.uint16], step: float = 0.0) -> Singles:
    """Depth in metres from stored values, float32; inf for out of range."""
    if step:
        return stored_depths_m(step)[stored]
    return np.where(stored == 0, np.float32(np.inf), stored.astype(np.float32) / np.float32(1000.0))


@lru_cache
def stored_depths_m(step: float) -> Singles:
    """Depths of the stored values of a relative step, (65536,) m: 0.1 * (1 + step) ** (value - 1); inf for 0."""
    values = np.arange(1 << 16, dtype=np.float64)
    with np.errstate(over="ignore"):
        metres = (0.1 * (1.0 + step) ** (values - 1.0)).astype(np.float32)
    metres[0] = np.inf
    return metres


@lru_cache
def _steps(step: float) -> NDArray[np.uint16]:
    """List the stored values of depths in whole millimetres."""
    metres = np.maximum(np.arange(1 << 16, dtype=np.float64) / 1000.0, 0.1)
    values = np.rint(np.log(metres / 0.1) / np.log1p(step)).astype(np.uint16) + np.uint16(1)
    values[0] = 0
    return values


class VideoWriter(AbstractContextManager["VideoWriter"]):
    """Write video streams (H.264 RGB, 16-bit depth, instance ids) into one file, by frames; a context manager."""

    def __init__(
        self, path: Path, modalities: Sequence[str], width: int, height: int, fps: float, crf: int = 23,
        preset: str = "ultrafast", comment: str = "",
    ) -> None:  # fmt: skip
        # Without bitexact the Matroska muxer writes a random id, and both muxers the library's version.
        form = "mp4" if list(modalities) == ["rgb"] else "matroska"
        self._container = av.open(str(path), "w", format=form, options={"fflags": "+bitexact"})
        if comment:
            self._container.metadata["comment"] = comment
        rate = Fraction(fps).limit_denominator(1000)
        h264 = _H264 | {"crf": str(crf), "preset": preset}
        self._streams: dict[str, Any] = {}
        for modality in modalities:
            rgb = modality == "rgb"
            stream: Any = self._container.add_stream(
                "libx264" if rgb else "ffv1", rate=rate, options=h264 if rgb else _FFV1
            )
            stream.width, stream.height = width, height
            stream.pix_fmt = "yuv420p" if rgb else "gray16le"
            # Threads would split the rate control and with it the bytes.
            stream.codec_context.thread_count = 1
            self._streams[modality] = stream

    def write(self, frames: Mapping[str, Bytes | NDArray[np.uint16]]) -> None:
        """Append a frame to every stream, by modality."""
        for modality, stream in self._streams.items():
            for packet in stream.encode(_frame(modality, frames[modality])):
                self._container.mux(packet)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Flush the encoders, unless the block failed, and close the file."""
        if kind is None:
            for stream in self._streams.values():
                for packet in stream.encode():
                    self._container.mux(packet)
        self._container.close()


def _frame(modality: str, picture: Bytes | NDArray[np.uint16]) -> Any:
    """Copy a picture into a frame of its codec's format; ValueError where it does not fit one."""
    height, width = picture.shape[:2]
    if modality == "rgb":
        if picture.dtype != np.uint8 or picture.shape[2:] != (3,) or height % 2 or width % 2:
            raise ValueError(f"a picture is (H, W, 3) uint8, H and W even, not {picture.shape} {picture.dtype}")
        frame = av.VideoFrame(width, height, "yuv420p")
        # One load per pixel and no lookup table, so that the compiler vectorises.
        rgba = cv2.cvtColor(picture, cv2.COLOR_RGB2RGBA).view(np.int32)[..., 0]
        _to_yuv(rgba, *(_plane(frame, k, np.uint8) for k in range(3)))
        return frame
    if picture.dtype != np.uint16 or picture.ndim != 2:
        raise ValueError(f"depth and instance ids are (H, W) uint16, not {picture.shape} {picture.dtype}")
    frame = av.VideoFrame(width, height, "gray16le")
    _plane(frame, 0, np.uint16)[:] = picture
    return frame


def _plane(frame: Any, k: int, dtype: type[np.uint8] | type[np.uint16]) -> NDArray[Any]:
    """Return a frame's own memory of one plane, without the lines' padding."""
    plane = frame.planes[k]
    return np.frombuffer(plane, dtype).reshape(plane.height, -1)[:, : plane.width]


@njit(cache=True, error_model="numpy")
def _to_yuv(rgba: Int32s, y: Bytes, u: Bytes, v: Bytes) -> None:
    """Convert by BT.601, limited range, chroma the mean of four pixels, in integers: the same on every machine."""
    for r in range(rgba.shape[0]):
        for c in range(rgba.shape[1]):
            p = np.int32(rgba[r, c])
            red, green, blue = p & 255, (p >> 8) & 255, (p >> 16) & 255
            y[r, c] = np.uint8(
                (np.int32(16829) * red + np.int32(33039) * green + np.int32(6416) * blue + np.int32(_Y_OFFSET)) >> 16
            )
    for r in range(rgba.shape[0] // 2):
        for c in range(rgba.shape[1] // 2):
            a, b = np.int32(rgba[2 * r, 2 * c]), np.int32(rgba[2 * r, 2 * c + 1])
            d, e = np.int32(rgba[2 * r + 1, 2 * c]), np.int32(rgba[2 * r + 1, 2 * c + 1])
            red = (a & 255) + (b & 255) + (d & 255) + (e & 255)
            green = ((a >> 8) & 255) + ((b >> 8) & 255) + ((d >> 8) & 255) + ((e >> 8) & 255)
            blue = ((a >> 16) & 255) + ((b >> 16) & 255) + ((d >> 16) & 255) + ((e >> 16) & 255)
            # Four pixels' sum, so two bits more.
            u[r, c] = np.uint8(
                (np.int32(28784) * blue - np.int32(9714) * red - np.int32(19070) * green + np.int32(_UV_OFFSET)) >> 18
            )
            v[r, c] = np.uint8(
                (np.int32(28784) * red - np.int32(24103) * green - np.int32(4681) * blue + np.int32(_UV_OFFSET)) >> 18
            )


class PngWriter:
    """Write frames as loose PNG files, ``000000.png`` and on."""

    def __init__(self, folder: Path, modality: str, comment: str = "") -> None:
        self._folder, self._modality, self._n = folder, modality, 0
        folder.mkdir()
        (folder / "camera.json").write_text(comment or "{}", encoding="utf-8")

    def write(self, frames: Mapping[str, Bytes | NDArray[np.uint16]]) -> None:
        """Append the modality's frame: (H, W, 3) uint8 RGB, or (H, W) uint16."""
        (self._folder / f"{self._n:06}.png").write_bytes(encode_png(frames[self._modality], FRAME_PNG))
        self._n += 1
