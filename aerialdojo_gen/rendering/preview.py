"""Single pictures of a scene, and sheets of them: for people who build scenes and look at results."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.geometry.cameras import Camera, look_at_pose
from aerialdojo_gen.rendering.backend import kept_renderer
from aerialdojo_gen.scenes.model import Scene


def look_at(
    scene: Scene, eye: ArrayLike, target: ArrayLike, width: int = 640, height: int = 480, fov_deg: float = 60.0
) -> NDArray[np.uint8]:
    """Take a picture of a scene from `eye` to `target`, world metres; (height, width, 3) uint8 sRGB."""
    camera = Camera(width, height, fov_deg)
    return kept_renderer(scene, "auto").render(camera, look_at_pose(eye, target)).rgb


def contact_sheet(
    images: Sequence[NDArray[np.uint8]], labels: Sequence[str] = (), columns: int = 4
) -> NDArray[np.uint8]:
    """Put pictures, (H, W, 3) uint8, side by side under their labels."""
    if not images or (labels and len(labels) != len(images)):
        raise ValueError(f"a sheet of {len(images)} pictures with {len(labels)} labels")
    height, width = max(i.shape[0] for i in images), max(i.shape[1] for i in images)
    head = 20 if labels else 0
    columns = min(columns, len(images))
    rows = -(-len(images) // columns)
    sheet = np.full((rows * (height + head + 4) + 4, columns * (width + 4) + 4, 3), 255, dtype=np.uint8)
    for k, image in enumerate(images):
        top, left = 4 + k // columns * (height + head + 4), 4 + k % columns * (width + 4)
        if labels:
            cell = np.full((head, width, 3), 255, dtype=np.uint8)
            cv2.putText(cell, labels[k], (3, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (30, 30, 30), 1, cv2.LINE_AA)
            sheet[top : top + head, left : left + width] = cell
        sheet[top + head : top + head + image.shape[0], left : left + image.shape[1]] = image
    return sheet
