"""Layout of a recording's files: one per view and modality, or all views tiled in one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.rendering.codecs import SUFFIX

# The one file of a tiled recording.
TILED = "views.mkv"


@dataclass(frozen=True)
class Place:
    """Location of the pictures of one view and modality."""

    view: str
    modality: str
    file: str  # Name of the file, or of a folder of PNG files
    stream: int = 0  # Which of the file's videos
    left_px: int = 0  # The picture's top-left pixel in the video's frame
    top_px: int = 0


def modalities(config: RenderConfig) -> tuple[str, ...]:
    """Return the recorded modalities: RGB, depth, and instance ids if configured."""
    return ("rgb", "depth", "instance") if config.instances else ("rgb", "depth")


def places(config: RenderConfig) -> list[Place]:
    """List the places of a recording, view by view."""
    found = []
    for k, view in enumerate(config.views):
        row, column = divmod(k, columns(config))
        for stream, modality in enumerate(modalities(config)):
            suffix = "" if config.frames == "png" else f".{SUFFIX[modality]}"
            if config.layout == "tiled":
                found.append(Place(view, modality, TILED, stream, column * config.width, row * config.height))
            else:
                found.append(Place(view, modality, f"{view}_{modality}{suffix}"))
    return found


def columns(config: RenderConfig) -> int:
    """Number of tiles per row: two for four views."""
    return math.ceil(math.sqrt(len(config.views)))


def tiled(pictures: Mapping[str, NDArray[Any]], config: RenderConfig) -> NDArray[Any]:
    """Lay the views' pictures side by side, `columns` a row; zeros where there is no view."""
    across = columns(config)
    down = -(-len(config.views) // across)
    first = pictures[config.views[0]]
    out = np.zeros((down * config.height, across * config.width, *first.shape[2:]), dtype=first.dtype)
    for k, view in enumerate(config.views):
        row, column = divmod(k, across)
        top, left = row * config.height, column * config.width
        out[top : top + config.height, left : left + config.width] = pictures[view]
    return out
