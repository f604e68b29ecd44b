"""Textures of foreign meshes: decoded, limited in size, deduplicated by content."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import image_size
from aerialdojo_gen.imports.raw import GREY, RawSurface

# Maximum side of a texture; maximum pixels of all textures of a file.
TEXTURE_PX = 8192
TEXELS = 8192 * 8192
# Limits on decoding: pixels per side, and pixels per image.
_MAX_SIDE_PX, _MAX_DECODED = 16384, 20000 * 10000
# Alpha below this is transparent, unless the file has its own cutoff.
CUTOFF = 0.5
# Blended textures are cut out if at least this share is nearly transparent; else they are glass, drawn opaque.
_HOLES, _GONE = 0.05, 0.1


@dataclass(frozen=True)
class SourceMaterial:
    """A file's material before its texture is decoded."""

    name: str  # Its name, for messages
    factor: tuple[float, float, float] = (GREY[0] / 255, GREY[1] / 255, GREY[2] / 255)  # (r, g, b) of float
    image: bytes | None = None  # The texture's file
    missing: str = ""  # Name of a missing texture file; else empty
    alpha: str = "opaque"  # Alpha mode: ``"opaque"``, ``"mask"`` or ``"blend"``
    cutoff: float = CUTOFF  # Of ``"mask"``
    mask: bytes | None = None  # A file whose brightness is the texture's alpha
    double_sided: bool = False
    unlit: bool = False


def decode_surfaces(
    materials: Sequence[SourceMaterial], texture_px: int = TEXTURE_PX
) -> tuple[tuple[RawSurface, ...], list[int]]:
    """Decode the materials of a file; returns the distinct surfaces and the index of each material's."""
    decoded: dict[bytes, tuple[NDArray[Any] | None, str]] = {}
    made = [_surface(material, decoded) for material in materials]
    made = _limit_sizes(made, texture_px)
    names: dict[str, set[str]] = {}
    for s in made:
        names.setdefault(s.digest, set()).add(s.name)
    # A picture of several materials is kept once, without a name: it is unknown which of them it shows.
    made = [s if s.texture is None or len(names[s.digest]) == 1 else replace(s, name="") for s in made]
    surfaces = {(s.digest, s.name): s for s in reversed(made)}
    order = sorted(surfaces)
    return tuple(surfaces[key] for key in order), [order.index((s.digest, s.name)) for s in made]


def _surface(material: SourceMaterial, decoded: dict[bytes, tuple[NDArray[Any] | None, str]]) -> RawSurface:
    red, green, blue = (round(255 * min(max(c, 0.0), 1.0)) for c in material.factor)
    name = material.name or "a material"
    plain = RawSurface(
        material.name, (red, green, blue), double_sided=material.double_sided, unlit=material.unlit,
        notes=(f"{name}: texture {material.missing} is missing: drawn in its colour",) if material.missing else (),
    )  # fmt: skip
    if material.image is None:
        return plain
    if material.image not in decoded:
        decoded[material.image] = _decode(material.image)
    image, fault = decoded[material.image]
    if image is None:
        return replace(plain, notes=(f"{name}: its texture {fault}: drawn in its colour",))
    rgb, alpha = _channels(image)
    white = min(red, green, blue) == 255
    if not white:
        # Colour factors multiply linear light, not sRGB values.
        scale = _srgb_to_linear(np.array([red, green, blue]) / 255.0)
        levels = _srgb_to_linear(np.arange(256) / 255.0)[:, None] * scale
        table = np.rint(255 * _linear_to_srgb(levels)).astype(np.uint8)
        rgb = np.stack([table[:, k][rgb[..., k]] for k in range(3)], axis=2)
    if material.mask is not None:
        other, _ = _decode(material.mask)
        if other is not None:
            grey = _channels(other)[0].max(axis=2)
            alpha = cv2.resize(grey, (rgb.shape[1], rgb.shape[0]), interpolation=cv2.INTER_AREA).astype(np.uint8)
    mask = _mask(alpha, material)
    opaque = rgb.reshape(-1, 3) if mask is None or not mask.any() else rgb[mask]
    red, green, blue = (int(c) for c in opaque.mean(axis=0, dtype=np.float64).round())
    is_jpeg = material.image[:3] == b"\xff\xd8\xff" and image.ndim == 3
    jpeg = material.image if white and mask is None and is_jpeg else b""
    return replace(plain, colour=(red, green, blue), texture=rgb, mask=mask, jpeg=jpeg)


def _mask(alpha: NDArray[np.uint8] | None, material: SourceMaterial) -> NDArray[np.bool_] | None:
    if alpha is None or material.alpha == "opaque":
        return None
    if material.alpha == "blend" and float((alpha < 255 * _GONE).mean()) < _HOLES:
        return None
    mask = np.asarray(alpha >= 255 * material.cutoff)
    return None if mask.all() else mask


def _decode(file: bytes) -> tuple[NDArray[Any] | None, str]:
    """Decode an image file to RGB(A); or return what is wrong with it."""
    size = image_size(file)
    if file[:12] == b"\xabKTX 20\xbb\r\n\x1a\n":
        return None, "is in KTX2, which is not read (export it as PNG or JPEG)"
    if size is None:
        return None, "is not PNG, JPEG, BMP or WebP"
    if max(size) > _MAX_SIDE_PX or size[0] * size[1] > _MAX_DECODED:
        return None, f"has {size[0]} x {size[1]} pixels, the maximum side is {_MAX_SIDE_PX}"
    image = cv2.imdecode(np.frombuffer(file, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype not in (np.uint8, np.uint16):
        return None, "cannot be decoded"
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA if image.shape[2] == 4 else cv2.COLOR_BGR2RGB)
    return np.ascontiguousarray(image), ""


def _channels(image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8] | None]:
    if image.ndim == 2:
        return np.repeat(image[..., None], 3, axis=2), None
    if image.shape[2] == 4:
        return np.ascontiguousarray(image[..., :3]), np.ascontiguousarray(image[..., 3])
    return image, None


def _limit_sizes(made: list[RawSurface], texture_px: int) -> list[RawSurface]:
    """Reduce textures until each one, and all together, are within the limits."""
    different = {s.digest: s for s in made if s.texture is not None}
    sides = {s.digest: s.texture.shape[:2] for s in made if s.texture is not None}
    size = {d: _fit_size(shape, texture_px) for d, shape in sides.items()}
    while sum(h * w for h, w in size.values()) > TEXELS:
        largest = max(max(shape) for shape in size.values())
        size = {d: _fit_size(shape, max(1, largest // 2)) for d, shape in size.items()}
    resized = {d: _resize(s, size[d]) for d, s in different.items() if size[d] != sides[d]}
    return [resized.get(s.digest, s) for s in made]


def _fit_size(shape: tuple[int, ...], most: int) -> tuple[int, ...]:
    longest = max(shape)
    return shape if longest <= most else tuple(max(1, round(side * most / longest)) for side in shape)


def _resize(surface: RawSurface, size: tuple[int, ...]) -> RawSurface:
    assert surface.texture is not None
    height, width = surface.texture.shape[:2]
    smaller = cv2.resize(surface.texture, size[::-1], interpolation=cv2.INTER_AREA)
    mask = surface.mask
    if mask is not None:
        mask = cv2.resize(mask.astype(np.float32), size[::-1], interpolation=cv2.INTER_AREA) >= CUTOFF
    kept = f"its texture of {width} x {height} pixels is kept at {size[1]} x {size[0]}"
    notes = (*surface.notes, f"{surface.name or 'a material'}: {kept}")
    return replace(surface, texture=np.asarray(smaller, dtype=np.uint8), mask=mask, jpeg=b"", notes=notes)


def _srgb_to_linear(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _linear_to_srgb(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055)


def to_srgb(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert linear light, 0-1, to sRGB, 0-1."""
    return _linear_to_srgb(np.clip(linear, 0.0, 1.0))
