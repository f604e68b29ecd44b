"""A whole scene turned about the vertical, by quarter turns: nothing is rounded."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.scenes.model import Instance, Scene


def turned(scene: Scene, turn_deg: int) -> Scene:
    """Turn a scene counter-clockwise by a multiple of 90°; the sun stays where it is."""
    for _ in range(turn_deg // 90 % 4):
        scene = _quarter(scene)
    return scene


def _quarter(scene: Scene) -> Scene:
    low, high = scene.bounds
    bounds = scene.bounds.copy()
    bounds[:, 0], bounds[:, 1] = (-high[1], -low[1]), (low[0], high[0])
    return replace(
        scene,
        bounds=bounds,
        instances=tuple(map(_thing, scene.instances)),
        backdrop=tuple(map(_thing, scene.backdrop)),
    )


def _thing(thing: Instance) -> Instance:
    parts = tuple(
        replace(part, vertices=np.column_stack([-part.vertices[:, 1], part.vertices[:, 0], part.vertices[:, 2]]))
        for part in thing.parts
    )
    anatomy = thing.anatomy
    if anatomy is not None:
        yaw, *fronts = wrap_angle_rad(np.array([anatomy.yaw_rad, *anatomy.fronts_rad]) + math.pi / 2).tolist()
        anatomy = replace(anatomy, yaw_rad=yaw, fronts_rad=tuple(fronts))
    return replace(thing, parts=parts, anatomy=anatomy)
