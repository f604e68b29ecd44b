"""The scenes that `view` shows: mesh payloads, images and routes, with a small cache."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property, lru_cache, partial
from typing import Any, TypeVar

import cv2
import numpy as np

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.pictures import GALLERY_JPEG, decode_rgb, encode_jpeg
from aerialdojo_gen.dataset.lookup import ReleasedScene
from aerialdojo_gen.geometry.cameras import Camera, look_at_pose
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.studio.view.contents import route_points, scene_index
from aerialdojo_gen.studio.web.payload import scene_payload

_T = TypeVar("_T")
# A payload takes some 20 MB, the objects with their images as much.
_MAX_OPEN = 4
_WIDTH_PX, _HEIGHT_PX, _FOV_DEG = 480, 300, 60.0
THUMB_PX = 224


class SceneData(ReleasedScene):
    """The data of one scene, computed lazily."""

    @cached_property
    def payload(self) -> bytes:
        """The mesh for the browser; AssetError if it is missing or does not match."""
        return scene_payload(self.model)

    @cached_property
    def index(self) -> dict[str, Any]:
        """What the page lists and filters."""
        return scene_index(self)

    @cached_property
    def points(self) -> bytes:
        """The points of all routes."""
        return route_points(self)

    def image(self, object_id: int) -> bytes:
        """Return the reference image of an object, PNG; UsageError if it has none."""
        image: bytes | None = self.object(object_id)["reference_image"]
        if image is None:
            raise UsageError(f"object {object_id} has no reference image")
        return image


class SceneCache:
    """The scenes of a release, opened on demand."""

    def __init__(self, root: DataRoot, names: Sequence[str]) -> None:
        self.root, self.names = root, tuple(names)
        self._load = lru_cache(_MAX_OPEN)(partial(SceneData, root))
        # Renderers belong to their thread and FCL's manager is not thread-safe; dropping a scene closes both.
        # So one thread does everything that touches a mesh.
        self._worker = ThreadPoolExecutor(1, "scenes")
        self._render_lock, self._read_lock = threading.Lock(), threading.Lock()
        self._images = lru_cache(_MAX_OPEN)(self._read_images)
        self._kept_thumb = cache(self._thumb)
        self._kept_picture = cache(lambda name: self.run(name, lambda data: _picture(data.model)))

    def require(self, name: str) -> None:
        """Raise a UsageError if there is no such scene."""
        if name not in self.names:
            raise UsageError(unknown("no scene", name, self.names, most=3))

    def run(self, name: str, what: Callable[[SceneData], _T]) -> _T:
        """Run a function on a scene; UsageError if there is none of the name."""
        self.require(name)
        return self._worker.submit(lambda: what(self._load(name))).result()

    def thumb(self, name: str, object_id: int) -> bytes:
        """Return an object's reference image as a thumbnail, JPEG; UsageError if it has none."""
        self.require(name)
        with self._read_lock:
            return self._kept_thumb(name, object_id)

    def _thumb(self, name: str, object_id: int) -> bytes:
        image = decode_rgb(self._images(name).get(object_id))
        if image is None:
            raise UsageError(f"object {object_id} of {name} has no reference image")
        scale = THUMB_PX / max(image.shape[:2])
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        return encode_jpeg(np.asarray(small, dtype=np.uint8), GALLERY_JPEG)

    def _read_images(self, name: str) -> dict[int, bytes | None]:
        table = store.read_scene(self.root, "release/objects", name, ["object_id", "reference_image"])
        return dict(zip(table["object_id"].to_pylist(), table["reference_image"].to_pylist(), strict=True))

    def picture(self, name: str) -> bytes:
        """Return a picture of a scene from the south-west, JPEG, like the initial view of its page."""
        # One at a time: the start page requests many, and other requests must not wait for all of them.
        with self._render_lock:
            return self._kept_picture(name)


def _picture(scene: Scene) -> bytes:
    from aerialdojo_gen.rendering.backend import choose_renderer, scene_renderer

    low, high = scene.bounds
    centre, size = (low + high) / 2, float(np.hypot(*(high - low)[:2]))
    eye = np.array([centre[0] - 0.2 * size, centre[1] - 0.3 * size, low[2] + 0.4 * size])
    camera = Camera(_WIDTH_PX, _HEIGHT_PX, _FOV_DEG)
    pose = look_at_pose(eye, np.array([centre[0], centre[1], low[2] + 2.0]))
    return encode_jpeg(scene_renderer(scene, choose_renderer().name).render(camera, pose).rgb, GALLERY_JPEG)
