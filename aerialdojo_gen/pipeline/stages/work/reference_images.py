"""`reference-images`: the picture of every object from its selected anchor or from behind it, for image goals."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import ReferenceImagesConfig
from aerialdojo_gen.base.pictures import REFERENCE_PNG, encode_png
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.portable import product
from aerialdojo_gen.geometry.rays import RayCaster, TriangleRayCaster, instance_caster
from aerialdojo_gen.pipeline.scoring.views import box_px, boxed, part_shares, pixels_by_face
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.rendering.backend import scene_renderer
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.rendering.raycast import pixel_rays
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.store.schemas import REFERENCES
from aerialdojo_gen.store.tables import from_rows

_BOX = ("box_u0_px", "box_v0_px", "box_u1_px", "box_v1_px")
_POSE = ("reference_x_m", "reference_y_m", "reference_z_m", "reference_yaw_rad")
# A patch of 7 x 7 pixels in a picture of 320 x 320.
MIN_SHARE = 0.0005
# A rasteriser's edges are within a pixel of those that rays see; what it leaves out altogether is larger than that.
_NEAR_PX, _EVERY_PX = 2, 4
# Of the pixels, one in so many rows and columns is tested for the part that it shows.
_SOME_PX = 3


def run(job: Job, config: ReferenceImagesConfig) -> Output:
    """Take the front view from every object's selected anchor, or from further back along its viewing axis.

    How far back an object fits the picture is the anchor's to say (`step_back_m` of the table ``anchors``); the
    configuration says how far back it may be taken. An identifying part counts as shown where it has
    `MIN_SHARE` of the picture's pixels.
    """
    objects = job.read("objects").to_pylist()
    anchors = {row["object_id"]: row for row in job.read("anchors").to_pylist() if row["selected"]}
    scene = job.scene_model()
    renderer, rays = scene_renderer(scene, config.renderer), ray_caster(scene)
    index = {node: k for k, node in enumerate(rays.nodes)}
    camera = Camera(config.width, config.height, config.fov_deg)
    counts = {"no_anchor": 0, "not_in_view": 0}
    rows = []
    for item in objects:
        row: dict[str, Any] = {
            "scene": job.scene,
            "object_id": item["object_id"],
            "reference_image": None,
            "parts_shown": [],
            **dict.fromkeys((*_POSE, "step_back_m", *_BOX, "image_fraction", "tells_shown", "tells_missing")),
        }
        rows.append(row)
        anchor = anchors.get(item["object_id"])
        if anchor is None:
            counts["no_anchor"] += 1
            continue
        yaw, back = anchor["yaw_rad"], min(anchor["step_back_m"], config.step_back_m)
        place = (anchor["x_m"], anchor["y_m"], anchor["z_m"])
        eye = (place[0] - back * math.cos(yaw), place[1] - back * math.sin(yaw), place[2])
        pose = view_pose(eye, yaw, "front")
        row |= zip((*_POSE, "step_back_m"), (*eye, yaw, back), strict=True)
        picture = renderer.render(camera, pose, instances=renderer.name == "gl")
        row["reference_image"] = encode_png(picture.rgb, REFERENCE_PNG)
        k = index[item["mesh_node"]]
        thing = scene.instances[k]
        mask = instance_mask(rays, k, thing.vertices, camera, pose, picture.instance)
        row["image_fraction"] = float(mask.mean())
        if mask.any():
            row |= zip(_BOX, box_of(mask), strict=True)
        else:
            counts["not_in_view"] += 1
        if thing.anatomy is None:
            continue
        alone = instance_caster(thing)
        at_anchor = view_pose(place, yaw, "front")
        row["parts_shown"] = _parts_shown(rays, alone, k, thing, camera, pose, mask, at_anchor)
        missing = missing_parts(thing, camera, pose, mask, alone)
        if thing.anatomy.identifying_parts:
            row["tells_shown"] = 1.0 - len(missing) / len(thing.anatomy.identifying_parts)
            row["tells_missing"] = ", ".join(missing) or None
    pictures = sum(row["reference_image"] is not None for row in rows)
    return Output({"references": from_rows(REFERENCES, rows)}, len(objects), pictures, counts)


def _parts_shown(
    rays: RayCaster, alone: TriangleRayCaster, k: int, thing: Instance, camera: Camera, pose: NDArray[np.float64],
    mask: NDArray[np.bool_], at_anchor: NDArray[np.float64],
) -> list[str]:  # fmt: skip
    """Names of the parts that the picture shows, and the view from the anchor, too."""
    assert thing.anatomy is not None
    some = np.zeros_like(mask)
    some[::_SOME_PX, ::_SOME_PX] = True
    seen = pixels_by_face(alone, len(thing.faces), camera, pose, mask & some)
    if not np.allclose(pose, at_anchor):
        pixels = np.flatnonzero(boxed(camera, at_anchor, thing.vertices) & some)
        directions = product(pixel_rays(camera)[0][pixels], at_anchor[:3, :3].T)
        own = np.zeros_like(mask)
        own.flat[pixels] = rays.first_hit(at_anchor[:3, 3], directions)[1] == k
        seen = np.stack([seen, pixels_by_face(alone, len(thing.faces), camera, at_anchor, own)])
    least = MIN_SHARE * mask.size / _SOME_PX**2
    names = sorted(thing.anatomy.runs)
    return [name for name in names if (seen[..., thing.faces_of(name)].sum(axis=-1) >= least).all()]


def missing_parts(
    instance: Instance, camera: Camera, world_from_camera: NDArray[np.float64], mask: NDArray[np.bool_],
    alone: TriangleRayCaster,
) -> list[str]:  # fmt: skip
    """Names of the identifying parts with less than `MIN_SHARE` of a picture's pixels; mask is (H, W) bool."""
    names = () if instance.anatomy is None else instance.anatomy.identifying_parts
    if not names:
        return []
    parts = [instance.faces_of(name) for name in names]
    shares = part_shares(alone, instance, parts, camera, world_from_camera, mask, MIN_SHARE)
    return [name for name, share in zip(names, shares, strict=True) if share < MIN_SHARE]


def instance_map(rays: RayCaster, camera: Camera, world_from_camera: NDArray[np.float64]) -> NDArray[np.int32]:
    """Index (H, W) of the instance that every pixel shows, -1 for the sky."""
    return _window(rays, camera, world_from_camera, 0, 0, camera.width, camera.height)


def instance_mask(
    rays: RayCaster, instance: int, vertices: NDArray[np.float64], camera: Camera,
    world_from_camera: NDArray[np.float64], drawn: NDArray[np.int32] | None = None,
) -> NDArray[np.bool_]:  # fmt: skip
    """Pixels (H, W) that show an instance; with a drawn id map rays are cast only where it may be wrong."""
    mask = np.zeros((camera.height, camera.width), dtype=np.bool_)
    u0, v0, u1, v1 = box_px(camera, world_from_camera, vertices)
    if u0 < u1 and v0 < v1:
        if drawn is None:
            mask[v0:v1, u0:u1] = _window(rays, camera, world_from_camera, u0, v0, u1, v1) == instance
        else:
            local = _rays_of(camera, u0, v0, u1, v1)
            mask[v0:v1, u0:u1] = _mended(rays, instance, drawn[v0:v1, u0:u1], world_from_camera, local)
    return mask


def _mended(
    rays: RayCaster, instance: int, drawn: NDArray[np.int32], world_from_camera: NDArray[np.float64],
    local: NDArray[np.float64],
) -> NDArray[np.bool_]:  # fmt: skip
    """Cast rays where a drawn map may be wrong about an instance, and wider where it is."""
    mask = drawn == instance
    shown = mask.astype(np.uint8)
    near = np.ones((2 * _NEAR_PX + 1, 2 * _NEAR_PX + 1), np.uint8)
    to_check = cv2.dilate(shown, near) != cv2.erode(shown, near)
    to_check[::_EVERY_PX, ::_EVERY_PX] = True
    cast = np.zeros_like(mask)
    while to_check.any():
        cast |= to_check
        directions = product(local[to_check], world_from_camera[:3, :3].T)
        hit = rays.first_hit(world_from_camera[:3, 3], directions)[1] == instance
        wrong = np.zeros_like(shown)
        wrong[to_check] = hit != mask[to_check]
        mask[to_check] = hit
        to_check = (cv2.dilate(wrong, near) > 0) & ~cast
    return mask


def _window(
    rays: RayCaster, camera: Camera, world_from_camera: NDArray[np.float64], u0: int, v0: int, u1: int, v1: int
) -> NDArray[np.int32]:
    local = _rays_of(camera, u0, v0, u1, v1)
    directions = product(local.reshape(-1, 3), world_from_camera[:3, :3].T)
    return rays.first_hit(world_from_camera[:3, 3], directions)[1].reshape(local.shape[:2])


def _rays_of(camera: Camera, u0: int, v0: int, u1: int, v1: int) -> NDArray[np.float64]:
    return pixel_rays(camera)[0].reshape(camera.height, camera.width, 3)[v0:v1, u0:u1]


def box_of(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Smallest box around a mask's pixels: left, top, one past right, one past bottom; the mask is not empty."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
