"""What the body's cameras see, as an agent gets it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.benchmark.goal import Sensors
from aerialdojo_gen.benchmark.motion import Point
from aerialdojo_gen.geometry.cameras import view_pose
from aerialdojo_gen.rendering.world import render_world
from aerialdojo_gen.scenes.model import Scene

Pictures = dict[str, NDArray[np.uint8]]
Depths = dict[str, NDArray[np.float32]]


def look(scene: Scene, sensors: Sensors, position: Point, yaw_rad: float) -> tuple[Pictures, Depths]:
    """Render the views of a body.

    Parameters
    ----------
    scene : Scene
    sensors : Sensors
    position : tuple of float
        The body's centre, metres, world frame.
    yaw_rad : float

    Returns
    -------
    rgb : dict of str to (H, W, 3) uint8
        By view; empty without pictures.
    depth_m : dict of str to (H, W) float32
        By view, planar depth, metres, 0 where there is nothing within range; empty without depth.
    """
    rgb: Pictures = {}
    depth_m: Depths = {}
    if sensors.blind:
        return rgb, depth_m
    world = render_world(scene)
    for view in sensors.views:
        pose = view_pose(position, yaw_rad, view)
        if sensors.rgb:
            picture = world.render(sensors.camera, pose)
            rgb[view], depth = np.array(picture.rgb), picture.depth_m
        else:
            depth = world.rasterise(sensors.camera, pose)[1]
        if sensors.depth:
            depth_m[view] = np.where(depth <= sensors.max_depth_m, depth, np.float32(0.0))
    return rgb, depth_m


def mosaic(pictures: Pictures) -> NDArray[np.uint8]:
    """Lay pictures out in rows of two: (rows · H, 2 · W, 3) uint8, or the picture itself where there is one."""
    tiles = list(pictures.values())
    if len(tiles) == 1:
        return tiles[0]
    if len(tiles) % 2:
        tiles.append(np.zeros_like(tiles[0]))
    rows = [np.concatenate(tiles[i : i + 2], axis=1) for i in range(0, len(tiles), 2)]
    return np.concatenate(rows)
