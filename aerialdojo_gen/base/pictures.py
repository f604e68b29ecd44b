"""Pictures as PNG and JPEG files in memory: how each kind is encoded, and how they are decoded.

Pictures are RGB here, as everywhere in this package; OpenCV's own order of channels ends in this module. The settings
decide the bytes of what is stored, so that changing one makes new files.
"""

from __future__ import annotations

import base64
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import RenderError

# Without a filter reference images are a tenth smaller, and a third faster to write and read. Level 9 would take half
# a percent off them, and twice the time.
REFERENCE_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 6, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE)
TEXTURE_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 3)
FRAME_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 4)
SMALLEST_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 9)
# OpenCV's own, for what is read once.
PLAIN_PNG: tuple[int, ...] = ()

SCORED_JPEG, ASKED_JPEG = 88, 90
GALLERY_JPEG, PAGE_JPEG, MAP_JPEG, REPLAY_JPEG = 82, 95, 82, 75

_JPEG_START = b"\xff\xd8"


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


def data_url(file: bytes) -> str:
    """Write a PNG or JPEG as a data URL, for pages that are one file."""
    return f"data:{media_type(file)};base64,{base64.b64encode(file).decode('ascii')}"


def media_type(file: bytes) -> str:
    """Name the media type of a PNG or JPEG: ``image/png`` or ``image/jpeg``."""
    return "image/jpeg" if file.startswith(_JPEG_START) else "image/png"
