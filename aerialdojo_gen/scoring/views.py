"""Take the pictures that scorers look at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.rendering.raycast import RayRenderer, pixel_rays
from aerialdojo_gen.scoring.base import AnchorView

Floats = NDArray[np.float64]


def take_view(
    renderer: RayRenderer,
    alone: TriangleRayCaster,
    own_instance: int,
    camera: Camera,
    position_m: Floats,
    yaw_rad: float,
    *,
    shown: float,
    elevation_deg: float,
    clearance_m: float,
) -> AnchorView:
    """Take the front view of an object from a candidate anchor.

    Parameters
    ----------
    renderer : RayRenderer
        Of the scene; every machine gives the same instance mask.
    alone : TriangleRayCaster
        The object by itself.
    own_instance : int
        The object's index in the scene.
    camera : Camera
    position_m : (3,) float64
        The body's centre, metres, world frame.
    yaw_rad : float
        Counter-clockwise from +x.
    shown, elevation_deg, clearance_m : float
        See `AnchorView`.

    Returns
    -------
    AnchorView
    """
    pose = view_pose(position_m, yaw_rad, "front")
    picture = renderer.render(camera, pose)
    assert picture.instance is not None
    visible = picture.instance == own_instance
    # Whether the object is behind what is nearer: where it is seen there is nothing to ask.
    hidden = np.flatnonzero(~visible & (picture.instance >= 0))
    silhouette = visible.copy()
    directions = pixel_rays(camera)[0][hidden] @ pose[:3, :3].T
    if len(hidden):
        silhouette.flat[hidden] = alone.first_hit(position_m, directions)[1] >= 0
    return AnchorView(picture.rgb, visible, silhouette, picture.instance < 0, shown, elevation_deg, clearance_m)
