"""Small tileable textures, drawn by numpy from a base colour.

A generator takes its base colour, (3,) float64 sRGB 0-255, and returns an image (H, W, 3) float64; row 0 is the top.
What a tile measures in metres is `tile_m` in materials.toml; the docstrings give the size each pattern was drawn for.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.scenes.noise import balanced
from aerialdojo_gen.scenes.textures_built import BUILT
from aerialdojo_gen.scenes.textures_natural import NATURAL

TEXTURES = {**NATURAL, **BUILT}


@lru_cache(maxsize=256)
def make_texture(name: str, colour: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Draw one of `TEXTURES` in a base colour: (H, W, 3) uint8 sRGB, 64 to 256 pixels a side, seamless, read-only."""
    base = np.array(colour, dtype=np.float64)
    image = TEXTURES[name](base)
    if name in NATURAL:
        image = balanced(image, base)
    out = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    out.flags.writeable = False
    return out
