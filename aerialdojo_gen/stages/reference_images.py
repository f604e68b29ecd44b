"""`reference-images`: the picture of every object from its selected anchor, for image goals."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.config.sections import ReferenceImagesConfig
from aerialdojo_gen.errors import RenderError
from aerialdojo_gen.geometry.cameras import Camera, project, view_pose
from aerialdojo_gen.geometry.rays import RayCaster, ray_caster
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.rendering.backend import kept_renderer
from aerialdojo_gen.store.schemas import REFERENCES
from aerialdojo_gen.store.tables import from_rows

_BOX = ("box_u0_px", "box_v0_px", "box_u1_px", "box_v1_px")
_IN_FRONT_M = 0.05
# Without a filter these pictures are a tenth smaller, and a third faster to write and read. Level 9 would take half a
# percent off them, and twice the time.
_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 6, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE)


def run(job: Job, config: ReferenceImagesConfig) -> Output:
    """Take the front view from every object's selected anchor.

    Parameters
    ----------
    job : Job
        Reads ``objects`` and ``anchors``.
    config : ReferenceImagesConfig

    Returns
    -------
    Output
        ``references``, a row an object; an object without a selected anchor has no picture (``no_anchor``), one that
        its picture does not show has no box (``not_in_view``).
    """
    objects = job.read("objects").to_pylist()
    anchors = {row["object_id"]: row for row in job.read("anchors").to_pylist() if row["selected"]}
    scene = job.scene_model()
    renderer, rays = kept_renderer(scene, config.renderer), ray_caster(scene)
    index = {node: k for k, node in enumerate(rays.nodes)}
    camera = Camera(config.width, config.height, config.fov_deg)
    counts = {"no_anchor": 0, "not_in_view": 0}
    rows = []
    for item in objects:
        row: dict[str, Any] = {
            "scene": job.scene,
            "object_id": item["object_id"],
            "reference_image": None,
            **dict.fromkeys(_BOX),
            "image_fraction": None,
        }
        rows.append(row)
        anchor = anchors.get(item["object_id"])
        if anchor is None:
            counts["no_anchor"] += 1
            continue
        pose = view_pose((anchor["x_m"], anchor["y_m"], anchor["z_m"]), anchor["yaw_rad"], "front")
        row["reference_image"] = png(renderer.render(camera, pose).rgb)
        k = index[item["mesh_node"]]
        mask = instance_mask(rays, k, scene.instances[k].vertices, camera, pose)
        row["image_fraction"] = float(mask.mean())
        if mask.any():
            row |= zip(_BOX, box_of(mask), strict=True)
        else:
            counts["not_in_view"] += 1
    pictures = sum(row["reference_image"] is not None for row in rows)
    return Output({"references": from_rows(REFERENCES, rows)}, len(objects), pictures, counts)


def instance_map(rays: RayCaster, camera: Camera, world_from_camera: NDArray[np.float64]) -> NDArray[np.int32]:
    """Which instance every pixel shows.

    Parameters
    ----------
    rays : RayCaster
    camera : Camera
    world_from_camera : (4, 4) float64

    Returns
    -------
    (H, W) int32
        Index into ``rays.nodes``, -1 for the sky.
    """
    return _window(rays, camera, world_from_camera, 0, 0, camera.width, camera.height)


def instance_mask(
    rays: RayCaster, instance: int, vertices: NDArray[np.float64], camera: Camera,
    world_from_camera: NDArray[np.float64],
) -> NDArray[np.bool_]:  # fmt: skip
    """Which pixels show an instance: `instance_map` compared with it, looked at only where the instance can be.

    Parameters
    ----------
    rays : RayCaster
    instance : int
        Index into ``rays.nodes``.
    vertices : (n, 3) float64
        The instance's, metres, world frame.
    camera : Camera
    world_from_camera : (4, 4) float64

    Returns
    -------
    (H, W) bool
    """
    mask = np.zeros((camera.height, camera.width), dtype=np.bool_)
    uv, depth = project(camera, world_from_camera, vertices)
    u0, v0, u1, v1 = 0, 0, camera.width, camera.height
    # What reaches behind the camera has no box in the picture.
    if depth.min() > _IN_FRONT_M:
        (low_u, low_v), (high_u, high_v) = uv.min(axis=0), uv.max(axis=0)
        u0, v0 = max(0, math.floor(low_u) - 1), max(0, math.floor(low_v) - 1)
        u1, v1 = min(camera.width, math.ceil(high_u) + 1), min(camera.height, math.ceil(high_v) + 1)
    if u0 < u1 and v0 < v1:
        mask[v0:v1, u0:u1] = _window(rays, camera, world_from_camera, u0, v0, u1, v1) == instance
    return mask


def _window(
    rays: RayCaster, camera: Camera, world_from_camera: NDArray[np.float64], u0: int, v0: int, u1: int, v1: int
) -> NDArray[np.int32]:
    local = _local_rays(camera)[v0:v1, u0:u1]
    directions = local.reshape(-1, 3) @ world_from_camera[:3, :3].T
    return rays.first_hit(world_from_camera[:3, 3], directions)[1].reshape(local.shape[:2])


@lru_cache(maxsize=2)
def _local_rays(camera: Camera) -> NDArray[np.float64]:
    return camera.rays()


def box_of(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Smallest box around a mask's pixels: left, top, one past right, one past bottom; the mask is not empty."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def png(rgb: NDArray[np.uint8]) -> bytes:
    """Encode a picture as PNG; the same bytes for the same picture.

    Raises
    ------
    RenderError
        OpenCV cannot encode it.
    """
    done, encoded = cv2.imencode(".png", np.ascontiguousarray(rgb[..., ::-1]), _PNG)
    if not done:
        raise RenderError(f"a picture of shape {rgb.shape} does not encode as PNG")
    return encoded.tobytes()
