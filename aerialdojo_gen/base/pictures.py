"""Pictures as PNG and JPEG files in memory: encoding, decoding, size from the header, pictures for a model.

Pictures are RGB here, as everywhere in this package; OpenCV's own order of channels ends in this module. The settings
decide the bytes of what is stored, so that changing one makes new files.
"""

from __future__ import annotations

import base64
import struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import RenderError

# Without a filter reference images are a tenth smaller, and a third faster to write and read. Level 6 would take 1.4
# percent off them, and 1.4 times the time.
REFERENCE_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 5, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE)
TEXTURE_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 3)
FRAME_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 4)
SMALLEST_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 9)
# OpenCV's own, for what is read once.
PLAIN_PNG: tuple[int, ...] = ()

SCORED_JPEG, PROMPT_JPEG = 88, 90
GALLERY_JPEG, PAGE_JPEG, MAP_JPEG, REPLAY_JPEG = 82, 95, 82, 75


def encode_png(image: NDArray[np.uint8] | NDArray[np.uint16], setting: tuple[int, ...] = PLAIN_PNG) -> bytes:
    """Encode (H, W, 3) uint8 sRGB, or one channel of uint8 or uint16, as PNG; the same bytes for the same picture."""
    return _encoded(image, ".png", setting)


def encode_jpeg(image: NDArray[np.uint8], quality: int) -> bytes:
    """Encode a picture, (H, W, 3) or (H, W) uint8, as JPEG of a quality of 0 to 100; as `encode_png` otherwise."""
    return _encoded(image, ".jpg", (cv2.IMWRITE_JPEG_QUALITY, quality))


def _encoded(image: NDArray[Any], suffix: str, setting: tuple[int, ...]) -> bytes:
    done, data = False, np.zeros(0, np.uint8)
    if image.size:
        channels = np.ascontiguousarray(image[..., ::-1]) if image.ndim == 3 else image
        done, data = cv2.imencode(suffix, channels, setting)
    if not done:
        raise RenderError(f"a picture of shape {image.shape} does not encode as {suffix[1:].upper()}")
    return data.tobytes()


def decode_rgb(file: bytes | memoryview | None) -> NDArray[np.uint8] | None:
    """Decode a PNG or JPEG to sRGB, (H, W, 3) uint8; None where there is none or it cannot be decoded."""
    return _decoded(file, cv2.IMREAD_COLOR_RGB)


def decode_grey(file: bytes | memoryview | None) -> NDArray[np.uint8] | None:
    """Decode a PNG or JPEG to grey values, (H, W) uint8; None where there is none or it cannot be decoded."""
    return _decoded(file, cv2.IMREAD_GRAYSCALE)


def decode_as_stored(file: bytes | memoryview | None) -> NDArray[Any] | None:
    """Decode a picture with the channels and the depth that it has: (H, W, 3) uint8 RGB, (H, W) uint8 or uint16."""
    image = _decoded(file, cv2.IMREAD_UNCHANGED)
    return np.ascontiguousarray(image[..., ::-1]) if image is not None and image.ndim == 3 else image


def _decoded(file: bytes | memoryview | None, flags: int) -> NDArray[Any] | None:
    # OpenCV raises for no bytes at all, and says None for what is no picture.
    image = cv2.imdecode(np.frombuffer(file, dtype=np.uint8), flags) if file else None
    return None if image is None else np.ascontiguousarray(image)


def encode_masked(image: NDArray[np.uint8], mask: NDArray[np.bool_], setting: tuple[int, ...] = PLAIN_PNG) -> bytes:
    """Encode a picture (H, W, 3) that is there only where a mask (H, W) is, as PNG with alpha; see `encode_png`."""
    # OpenCV's order is blue, green, red, alpha.
    return _encoded(np.dstack([np.where(mask, 255, 0).astype(np.uint8), image]), ".png", setting)


def decode_masked(file: bytes | memoryview | None) -> tuple[NDArray[np.uint8] | None, NDArray[np.bool_] | None]:
    """Decode what `encode_masked` made: the picture (H, W, 3) and its mask (H, W); None for both where it is none."""
    image = _decoded(file, cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 3 or image.shape[2] != 4 or image.dtype != np.uint8:
        return None, None
    return np.ascontiguousarray(image[..., 2::-1]), np.asarray(image[..., 3] >= 128)


def media_type(file: bytes) -> str:
    """Name the media type of a PNG or JPEG: ``image/png`` or ``image/jpeg``."""
    return "image/jpeg" if file.startswith(b"\xff\xd8") else "image/png"


class Picture:
    """An encoded picture, as text: for pages that are one file, and for a model's service."""

    def __init__(self, file: bytes) -> None:
        self.media_type = media_type(file)
        self.base64 = base64.b64encode(file).decode("ascii")
        self.data_url = f"data:{self.media_type};base64,{self.base64}"


def colour_picture(rgb: NDArray[np.uint8], size_px: int) -> Picture:
    """Encode (H, W, 3) uint8 sRGB as JPEG, scaled down to a longest side of `size_px`."""
    return Picture(encode_jpeg(_at_most(rgb, size_px, cv2.INTER_AREA), PROMPT_JPEG))


def depth_picture(depth_m: NDArray[np.float32], max_depth_m: float, size_px: int) -> Picture:
    """Encode planar depth (H, W) in metres as grey PNG, `max_depth_m` white; scaling takes the nearest sample."""
    scaled = _at_most(depth_m, size_px, cv2.INTER_NEAREST)
    seen = np.isfinite(scaled) & (scaled > 0.0)
    grey = np.where(seen, np.clip(np.where(seen, scaled, 0.0) / max_depth_m, 0.0, 1.0), 1.0)
    return Picture(encode_png(np.rint(grey * 255.0).astype(np.uint8)))


def _at_most(image: NDArray[Any], size_px: int, interpolation: int) -> NDArray[Any]:
    height, width = image.shape[:2]
    scale = size_px / max(height, width)
    if scale >= 1.0:
        return image
    shape = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(image, shape, interpolation=interpolation))


def image_size(file: bytes | memoryview) -> tuple[int, int] | None:
    """Read an image's width and height, pixels, without decoding it; None where it is of no kind that is read."""
    if file[:8] == b"\x89PNG\r\n\x1a\n" and len(file) >= 24:
        width, height = struct.unpack(">II", file[16:24])
        return int(width), int(height)
    if file[:3] == b"\xff\xd8\xff":
        return _jpeg_size(file)
    if file[:2] == b"BM" and len(file) >= 26:
        width, height = struct.unpack("<ii", file[18:26])
        return abs(width), abs(height)
    if file[:4] == b"RIFF" and file[8:12] == b"WEBP" and len(file) >= 30:
        return _webp_size(file)
    return None


def _webp_size(file: bytes | memoryview) -> tuple[int, int] | None:
    kind = file[12:16]
    if kind == b"VP8X":
        return 1 + int.from_bytes(file[24:27], "little"), 1 + int.from_bytes(file[27:30], "little")
    if kind == b"VP8L":
        bits = int.from_bytes(file[21:25], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    width, height = struct.unpack("<HH", file[26:30])
    return width & 0x3FFF, height & 0x3FFF


def _jpeg_size(file: bytes | memoryview) -> tuple[int, int] | None:
    at = 2
    while at + 9 < len(file) and file[at] == 0xFF:
        kind = file[at + 1]
        if kind == 0xFF:
            at += 1
            continue
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">HH", file[at + 5 : at + 9])
            return int(width), int(height)
        at += 2 if 0xD0 <= kind <= 0xD9 else 2 + struct.unpack(">H", file[at + 2 : at + 4])[0]
    return None
