"""Materials and vertex colours of a scene's GLB, to glTF and back."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import (
    TEXTURE_PNG,
    decode_as_stored,
    decode_masked,
    decode_rgb,
    encode_masked,
    encode_png,
    image_size,
)
from aerialdojo_gen.scenes.model import Material

UNLIT = "KHR_materials_unlit"
_CUTOFF = 0.5
_LARGEST_TEXTURE_PX = 8192


def material_entry(material: Material, image: Callable[[bytes, str], int]) -> dict[str, Any]:
    """Describe a material as glTF does."""
    surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.9}
    extras: dict[str, Any] = {"colour": list(material.colour), "tile_m": material.tile_m}
    if material.texture is None:
        surface["baseColorFactor"] = [*(_linear(c) for c in material.colour), 1.0]
    elif material.jpeg:
        surface["baseColorTexture"] = {"index": image(material.jpeg, "image/jpeg")}
    else:
        surface["baseColorTexture"] = {"index": image(_png(material), "image/png")}
    entry: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": surface, "extras": extras}
    if material.atlas:
        extras["atlas"] = True
    if material.mask is not None:
        entry |= {"alphaMode": "MASK", "alphaCutoff": _CUTOFF}
    if material.double_sided:
        entry["doubleSided"] = True
    if material.unlit:
        entry["extensions"] = {UNLIT: {}}
    return entry


def read_material(entry: dict[str, Any], image: Callable[[int], memoryview]) -> Material:
    """Read what `material_entry` wrote."""
    texture, mask, jpeg = None, None, b""
    extras = entry["extras"]
    atlas = bool(extras.get("atlas", False))
    source = entry["pbrMetallicRoughness"].get("baseColorTexture")
    if source is not None:
        file = image(source["index"])
        # A kilobyte can declare a gigabyte of pixels: check the size before decoding.
        head, size = bytes(file[:8]), image_size(file)
        stored_as_jpeg = head.startswith(b"\xff\xd8\xff")
        if not (stored_as_jpeg or head == b"\x89PNG\r\n\x1a\n") or size is None:
            raise ValueError("texture is neither PNG nor JPEG")
        if max(size) > (_LARGEST_TEXTURE_PX if atlas else 4096):
            raise ValueError("texture is too large")
        if entry.get("alphaMode") == "MASK":
            texture, mask = decode_masked(file)
        else:
            # As stored: EXIF orientation does not apply to texture coordinates.
            texture = decode_as_stored(file) if stored_as_jpeg else decode_rgb(file)
        jpeg = bytes(file) if atlas and stored_as_jpeg else b""
        if texture is None or texture.ndim != 3 or max(texture.shape[:2]) > _LARGEST_TEXTURE_PX:
            raise ValueError("texture cannot be decoded")
    red, green, blue = extras["colour"]
    return Material(
        entry["name"], (red, green, blue), texture, float(extras["tile_m"]), mask, atlas,
        bool(entry.get("doubleSided", False)), UNLIT in entry.get("extensions", {}), jpeg,
    )  # fmt: skip


# Scenes of one catalogue share their materials; a foreign mesh's textures are large, and written once.
@lru_cache(maxsize=512)
def _kept_png(material: Material) -> bytes:
    assert material.texture is not None
    return encode_png(material.texture, TEXTURE_PNG)


def _png(material: Material) -> bytes:
    assert material.texture is not None
    if material.mask is not None:
        return encode_masked(material.texture, material.mask, TEXTURE_PNG)
    return encode_png(material.texture, TEXTURE_PNG) if material.atlas else _kept_png(material)


def linear_colours(colours: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Convert vertex colours (n, 3) to glTF's (n, 4): linear, 0-65,535."""
    out = np.full((len(colours), 4), 65535, dtype="<u2")
    out[:, :3] = _TABLE[colours]
    return out


def srgb_colours(stored: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Invert `linear_colours`, exactly."""
    return np.asarray(_INVERSE[stored[:, :3]])


def _linear(channel: int) -> float:
    """Convert an sRGB channel, 0-255, to glTF's linear factor, 0-1."""
    c = channel / 255.0
    return round(c / 12.92 if c <= 0.04045 else math.pow((c + 0.055) / 1.055, 2.4), 6)


_TABLE = np.array([round(65535 * _linear(c)) for c in range(256)], dtype="<u2")
# Of every stored value, the nearest that is one.
_INVERSE = np.searchsorted((_TABLE[1:].astype(np.float64) + _TABLE[:-1]) / 2.0, np.arange(65536)).astype(np.uint8)
