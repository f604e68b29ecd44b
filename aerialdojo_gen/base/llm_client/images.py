"""Pictures for a model: JPEG for colour, grey PNG for depth, as base64."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import ASKED_JPEG, encode_jpeg, encode_png, media_type


@dataclass(frozen=True)
class Picture:
    """An encoded picture."""

    media_type: str  # ``image/jpeg`` or ``image/png``
    base64: str  # The file

    @property
    def data_url(self) -> str:
        """The picture as a data URL."""
        return f"data:{self.media_type};base64,{self.base64}"


def colour_picture(rgb: NDArray[np.uint8], size_px: int) -> Picture:
    """Encode (H, W, 3) uint8 sRGB as JPEG, scaled down to a longest side of `size_px`."""
    scaled = _at_most(rgb, size_px, cv2.INTER_AREA)
    return _picture(encode_jpeg(scaled, ASKED_JPEG))


def depth_picture(depth_m: NDArray[np.float32], max_depth_m: float, size_px: int) -> Picture:
    """Encode planar depth (H, W) in metres as grey PNG, `max_depth_m` white; scaling takes the nearest sample."""
    scaled = _at_most(depth_m, size_px, cv2.INTER_NEAREST)
    seen = np.isfinite(scaled) & (scaled > 0.0)
    grey = np.where(seen, np.clip(np.where(seen, scaled, 0.0) / max_depth_m, 0.0, 1.0), 1.0)
    return _picture(encode_png(np.rint(grey * 255.0).astype(np.uint8)))


def _at_most(image: NDArray[Any], size_px: int, interpolation: int) -> NDArray[Any]:
    height, width = image.shape[:2]
    scale = size_px / max(height, width)
    if scale >= 1.0:
        return image
    shape = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(image, shape, interpolation=interpolation))


def _picture(file: bytes) -> Picture:
    return Picture(media_type(file), base64.b64encode(file).decode("ascii"))
