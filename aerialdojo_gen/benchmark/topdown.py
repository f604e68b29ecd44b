"""A scene from straight above, without perspective: the ground that a flown path is drawn on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.scenes.model import Scene


class TopDown:
    """Maps of a scene, from one ray a pixel.

    Parameters
    ----------
    scene : Scene
        Its materials' mean colours are drawn, shaded by its sun.
    """

    def __init__(self, scene: Scene) -> None:
        parts = [part for instance in scene.instances for part in instance.parts]
        offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
        vertices = np.concatenate([part.vertices for part in parts])
        faces = np.concatenate([part.faces + np.int32(k) for part, k in zip(parts, offsets, strict=True)])
        colours = np.array([scene.materials[part.material].colour for part in parts], dtype=np.float64)
        self._colour = np.repeat(colours, [len(part.faces) for part in parts], axis=0)
        corners = vertices[faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
        # Seen from above, a face shows the side that faces up, whichever way it is wound.
        normal *= np.where(normal[:, 2:] < 0.0, -1.0, 1.0)
        sun = np.asarray(scene.sun) / np.linalg.norm(scene.sun)
        self._light = 0.55 + 0.45 * np.clip(normal @ sun, 0.0, 1.0)
        self._rays = TriangleRayCaster(vertices, faces)
        self._sky = np.asarray(scene.sky, dtype=np.float64)
        self._top_m = float(vertices[:, 2].max()) + 1.0

    def picture(self, low_m: NDArray[np.float64], high_m: NDArray[np.float64], width_px: int) -> NDArray[np.uint8]:
        """Draw a rectangle of the scene.

        Parameters
        ----------
        low_m, high_m : (2,) float64
            Its south-west and north-east corners, metres, world frame.
        width_px : int
            Columns; rows follow from the rectangle.

        Returns
        -------
        (H, W, 3) uint8
            sRGB; north is up.
        """
        size = high_m - low_m
        height_px = max(1, round(width_px * float(size[1] / size[0])))
        x = low_m[0] + (np.arange(width_px) + 0.5) / width_px * size[0]
        y = high_m[1] - (np.arange(height_px) + 0.5) / height_px * size[1]
        origins = np.stack([*np.meshgrid(x, y), np.full((height_px, width_px), self._top_m)], axis=-1).reshape(-1, 3)
        distance, face = self._rays.first_hit(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
        seen = face >= 0
        colour = np.broadcast_to(self._sky, origins.shape).copy()
        # Higher ground is lighter, so that roofs and streets tell apart where their colours do not.
        height = np.clip((self._top_m - distance[seen]) / 30.0, 0.0, 1.0)
        colour[seen] = self._colour[face[seen]] * (self._light[face[seen]] * (0.85 + 0.15 * height))[:, None]
        return np.rint(np.clip(colour, 0.0, 255.0)).astype(np.uint8).reshape(height_px, width_px, 3)
