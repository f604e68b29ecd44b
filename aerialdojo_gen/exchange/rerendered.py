"""Reference pictures drawn anew at another size, for formats that want one: the same view of the same mesh."""

from __future__ import annotations

import hashlib

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError, StoreError
from aerialdojo_gen.base.pictures import REFERENCE_PNG, decode_rgb, encode_png
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.backend import choose_renderer, scene_renderer
from aerialdojo_gen.scenes.context import open_scene
from aerialdojo_gen.scenes.stored import mesh_copy
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot

# Between two sizes and two renderers edges and shadows' rims differ; another view or object differs by far more.
_SAME_VIEW = 12.0


class Redrawn:
    """Draws a scene's reference pictures from where they were taken, at another size than the release has them."""

    def __init__(self, root: DataRoot, scene: str, size_px: int) -> None:
        row = store.read_scene(root, "release/scenes", scene).to_pylist()[0]
        keep = "--picture-size 0 exports the release's own pictures"
        try:
            mesh = mesh_copy(root, row["mesh_path"])
        except FileNotFoundError:
            missing = root.at(row["mesh_path"])
            raise AssetError(
                f"{missing} is missing, so its pictures cannot be drawn at {size_px} px: {keep}"
            ) from None
        if hashlib.sha256(mesh.read_bytes()).hexdigest() != row["mesh_sha256"]:
            raise AssetError(f"{mesh} is not the mesh that the release was made from: {keep}")
        self._scene_name = scene
        rows = store.read_scene(root, "release/objects", scene).to_pylist()
        self._poses = {
            r["object_id"]: [r[f"reference_{name}"] for name in ("x_m", "y_m", "z_m", "yaw_rad")] for r in rows
        }
        self._pictures = {r["object_id"]: r["reference_image"] for r in rows}
        self._camera = Camera(size_px, size_px)
        self._scene = open_scene(mesh, row["mesh_sha256"]).scene
        self._renderer_name = choose_renderer("auto").name

    def picture(self, object_id: int) -> bytes:
        """Draw an object's picture."""
        x, y, z, yaw = self._poses[object_id]
        pose = view_pose((x, y, z), yaw, "front")
        rgb = scene_renderer(self._scene, self._renderer_name).render(self._camera, pose).rgb
        if _difference(rgb, self._pictures[object_id]) > _SAME_VIEW:
            raise StoreError(
                f"object {object_id} of {self._scene_name} does not look as its picture does: "
                "--picture-size 0 exports the release's own pictures"
            )
        return encode_png(rgb, REFERENCE_PNG)


def _difference(rgb: NDArray[np.uint8], picture: bytes) -> float:
    """Mean absolute difference to a PNG, in steps of 255, both at 64 x 64 pixels."""
    released = decode_rgb(picture)
    if released is None:
        return float("inf")
    small = [cv2.resize(image, (64, 64), interpolation=cv2.INTER_AREA) for image in (rgb, released)]
    return float(np.abs(small[0].astype(np.float32) - small[1].astype(np.float32)).mean())
