"""Anchors in the tool: the candidates of an object, viewpoints placed by hand, and what each of them shows."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.annotations.format import Object
from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.base.pictures import REFERENCE_PNG, encode_png
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.frames import yaw_towards
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.pipeline.stage import Job, ProjectPaths
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]
_T = TypeVar("_T")
_MAX_PICTURES = 400


@dataclass(frozen=True)
class View:
    """What a viewpoint shows."""

    png: bytes  # Front view, PNG, in the size of the reference images
    boxes: dict[str, tuple[int, int, int, int]]  # Pixel boxes (u0, v0, u1, v1) by node
    pixels: dict[str, int]  # Visible pixels by node


class AnchorService:
    """Anchors of one scene's objects; the heavy work is done by one thread, one thing after another."""

    def __init__(self, scene: Scene, pipeline: Pipeline, roots: ProjectPaths) -> None:
        self.scene, self.config, self._pictures = scene, pipeline.anchor_sample, pipeline.reference_images
        self._job = Job("anchor-sample", scene.name, 0, 1, pipeline.seed, pipeline.embodiment, roots)
        # One thread: PyBullet is not thread-safe, and the page needs CPU as well.
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="anchors")
        self._world: Future[Any] = self._worker.submit(self._build)
        self._candidates: dict[tuple[int, str], list[dict[str, Any]]] = {}
        self._kept_view = lru_cache(_MAX_PICTURES)(lambda *pose: self._run(lambda: self._render(*pose)))

    def _build(self) -> Any:
        from aerialdojo_gen.pipeline.stages.work.anchor_world import World

        return World.of(self.scene, self._job.embodiment.radius_m, self.config.margin_m)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the pictures."""
        return self._pictures.width, self._pictures.height

    def close(self) -> None:
        """Drop what is waiting to be done."""
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _run(self, work: Callable[[], _T]) -> _T:
        return self._worker.submit(work).result()

    def candidates(self, entry: Object) -> list[dict[str, Any]]:
        """Find an object's shortlist."""
        from aerialdojo_gen.pipeline.stages.work.anchor_sample import anchors_of

        key = (entry.id, entry.node)
        if key not in self._candidates:
            anchors, *_ = self._run(
                lambda: anchors_of(self._item(entry), self._world.result(), self._job, self.config)
            )
            self._candidates[key] = anchors
        return self._candidates[key]

    def place(self, entry: Object, eye_m: Floats) -> Floats:
        """Put a viewpoint, (3,) world metres, between `eye_m` and an object, at the standoff from its surface."""
        instance = self.scene[entry.node]
        away = eye_m - instance.centroid
        length = float(np.linalg.norm(away))
        if length < 1e-3:
            raise AerialDojoError("the viewpoint is at the object's centre")
        surface = Surface.of(instance)
        direction = (away / length)[None]
        place = surface.standoff(instance.centroid, direction, self.config.standoff_m)[0]
        if np.isnan(place[0]):  # an arch: its centre is an opening
            place = surface.standoff(surface.nearest_point(instance.centroid), direction, self.config.standoff_m)[0]
        return np.asarray(np.round(place, 3))

    def check_viewpoint(
        self, entry: Object, position_m: Floats, yaw_rad: float | None = None
    ) -> tuple[dict[str, Any], list[str]]:
        """Check a viewpoint against the rules for anchors; returns its row of ``anchors`` and the list of faults."""
        from aerialdojo_gen.pipeline.stages.work.anchor_choice import is_same, judge_anchor

        yaw = float(yaw_towards(position_m, self.scene[entry.node].centroid)) if yaw_rad is None else yaw_rad
        yaw = math.radians(round(math.degrees(yaw), 2))
        pose = {**dict(zip(("x_m", "y_m", "z_m"), position_m.tolist(), strict=True)), "yaw_rad": yaw}
        for row in self.candidates(entry):
            if is_same(row, pose):
                return row, []
        return self._run(
            lambda: judge_anchor(position_m, yaw, self._item(entry), self._world.result(), self._job, self.config)
        )

    def view(self, position_m: Floats, yaw_rad: float) -> View:
        """Take the front view from a place (kept for the next time)."""
        return self._kept_view(*position_m.tolist(), yaw_rad)

    def _render(self, *pose_m_rad: float) -> View:
        from aerialdojo_gen.pipeline.stages.work.reference_images import box_of, instance_map
        from aerialdojo_gen.rendering.backend import scene_renderer
        from aerialdojo_gen.rendering.casters import ray_caster

        camera = Camera(self._pictures.width, self._pictures.height, self._pictures.fov_deg)
        pose = view_pose(pose_m_rad[:3], pose_m_rad[3], "front")
        picture = scene_renderer(self.scene, self._pictures.renderer).render(camera, pose)
        rays = ray_caster(self.scene)
        node_map = instance_map(rays, camera, pose)
        visible, counts = np.unique(node_map[node_map >= 0], return_counts=True)
        return View(
            encode_png(picture.rgb, REFERENCE_PNG),
            {rays.nodes[k]: box_of(node_map == k) for k in visible},
            {rays.nodes[k]: int(n) for k, n in zip(visible, counts, strict=True)},
        )

    def _item(self, entry: Object) -> dict[str, Any]:
        x, y, z = (float(v) for v in self.scene[entry.node].centroid)
        return {"object_id": entry.id, "name": entry.name, "mesh_node": entry.node, "x_m": x, "y_m": y, "z_m": z}
