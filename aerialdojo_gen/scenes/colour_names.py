"""What a person calls a colour."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import ArrayLike

# Upper ends of the hues, degrees.
_HUES = (
    (15, "red"),
    (42, "orange"),
    (68, "yellow"),
    (165, "green"),
    (195, "turquoise"),
    (255, "blue"),
    (290, "purple"),
    (335, "pink"),
    (361, "red"),
)
# Every word that a colour can have.
COLOURS = (
    "white", "black", "grey", "brown", "beige", "red", "orange", "yellow", "green", "turquoise", "blue", "purple",
    "pink",
)  # fmt: skip


def colour_name(rgb: ArrayLike) -> str:
    """Name an sRGB colour by one of about a dozen everyday words, e.g. ``"brown"``."""
    red, green, blue = (float(c) / 255.0 for c in np.asarray(rgb, dtype=np.float64))
    hue, light, saturation = colorsys.rgb_to_hls(red, green, blue)
    if light > 0.9:
        return "white"
    if light < 0.12:
        return "black"
    if saturation < 0.16:
        return "grey" if light < 0.82 else "white"
    word = next(name for end, name in _HUES if hue * 360 < end)
    if word in ("red", "orange", "yellow") and light < 0.42 and saturation < 0.75:
        return "brown"
    if word in ("orange", "yellow") and light > 0.68:
        return "beige"
    return word
