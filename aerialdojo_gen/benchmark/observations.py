"""What the body's cameras see, as an agent gets it, and text spaces for asynchronous vector environments."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Text
from gymnasium.vector.utils import read_from_shared_memory
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import MODALITIES
from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.benchmark.agents.goal import Goal, Sensors
from aerialdojo_gen.planning.flight_space import Point
from aerialdojo_gen.rendering.backend import choose_renderer, scene_renderer
from aerialdojo_gen.rendering.picture import Renderer
from aerialdojo_gen.scenes.light import Light
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.schemas import DIRECTIONS

Pictures = dict[str, NDArray[np.uint8]]
Depths = dict[str, NDArray[np.float32]]


# The process that has used OpenGL. A fork of it would wait for ever for threads that it does not have.
_opengl_process: list[int] = []


def observed_goal(goal: Goal, image_shape: tuple[int, ...] | None) -> dict[str, Any]:
    """Return a goal as the environment's observations hold it; a new copy each time, as callers may change it."""
    seen: dict[str, Any] = {
        "modality": np.int64(MODALITIES.index(goal.modality)),
        "target_name": goal.target_name,
        "landmark": goal.landmark,
        "direction": np.int64(DIRECTIONS.index(goal.direction)),
        "description": goal.description or "",
    }
    if goal.heading is not None:
        seen["heading"] = np.int64(DIRECTIONS.index(goal.heading.direction))
        seen["heading_deg"] = np.array([goal.heading.heading_deg], np.int32)
    if image_shape is not None:
        seen["image"] = np.zeros(image_shape, np.uint8) if goal.image is None else goal.image.copy()
        seen["image_distance_m"] = np.array([goal.image_distance_m or 0.0], np.float32)
    return seen


def renderer_for(scene: Scene, name: str, light: Light | None = None) -> Renderer:
    """Return the renderer of a scene; RenderError in a fork of a process that has used OpenGL."""
    if _opengl_process and os.getpid() not in _opengl_process:
        raise RenderError(
            "this process was forked from one that has drawn by OpenGL: start it by spawn "
            "(gymnasium.make_vec: vector_kwargs={'context': 'spawn'}), or take renderer='pybullet' in both"
        )
    renderer = scene_renderer(scene, name, light)
    if renderer.name == "gl":
        _opengl_process[:] = [os.getpid()]
    return renderer


def renderer_name(name: str) -> str:
    """Resolve a renderer's name; ``"auto"`` is the fastest that works here."""
    if name != "auto":
        return name
    chosen = choose_renderer().name
    # Choosing it has rendered a scene.
    if not _opengl_process:
        _opengl_process[:] = [os.getpid()]
    return chosen


def used_opengl() -> bool:
    """Whether this process has used OpenGL, so that a fork of it cannot."""
    return bool(_opengl_process)


def render_views(
    scene: Scene, sensors: Sensors, position: Point, yaw_rad: float, renderer: str = "auto",
    light: Light | None = None,
) -> tuple[Pictures, Depths]:  # fmt: skip
    """Render RGB (H, W, 3) uint8 and planar depth (H, W) metres of a body (world metres, radians), by view."""
    rgb: Pictures = {}
    depth_m: Depths = {}
    if sensors.blind:
        return rgb, depth_m
    pose = np.array([[*position, yaw_rad]])
    pictures, depths = renderer_for(scene, renderer, light).render_bodies(sensors.camera, pose, sensors.views)
    for v, view in enumerate(sensors.views):
        if sensors.rgb:
            rgb[view] = pictures[0, v]
        if sensors.depth:
            depth_m[view] = clip_depth(depths[0, v], sensors)
    return rgb, depth_m


def clip_depth(depth_m: NDArray[np.float32], sensors: Sensors) -> NDArray[np.float32]:
    """Set depth to 0 where nothing is in the sensors' range; in place."""
    np.putmask(depth_m, ~(depth_m <= np.float32(sensors.max_depth_m)), np.float32(0.0))
    return depth_m


def mosaic(pictures: Pictures) -> NDArray[np.uint8]:
    """Arrange images in rows of two: (rows · H, 2 · W, 3) uint8; a single image is returned as it is."""
    tiles = list(pictures.values())
    if len(tiles) == 1:
        return tiles[0]
    if len(tiles) % 2:
        tiles.append(np.zeros_like(tiles[0]))
    rows = [np.concatenate(tiles[i : i + 2], axis=1) for i in range(0, len(tiles), 2)]
    return np.concatenate(rows)


_read = read_from_shared_memory.dispatch(Text)


class GoalText(Text):
    """A text whose values live in shared memory, which asynchronous environments read once (Gymnasium 1.4)."""


class _LiveTexts(Sequence[str]):
    """Strings in shared memory, read on access; a deep copy is a tuple of the current ones."""

    def __init__(self, space: GoalText, memory: Any, n: int) -> None:
        self._space, self._memory, self._n = space, memory, n

    def _now(self) -> tuple[str, ...]:
        return tuple(str(text) for text in _read(self._space, self._memory, self._n))

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, index: Any) -> Any:
        return self._now()[index]

    def __iter__(self) -> Iterator[str]:
        return iter(self._now())

    def __repr__(self) -> str:
        return repr(self._now())

    def __deepcopy__(self, _memo: dict[int, Any]) -> tuple[str, ...]:
        return self._now()


@read_from_shared_memory.register(GoalText)
def _read_live_texts(space: GoalText, shared_memory: Any, n: int = 1) -> _LiveTexts:
    return _LiveTexts(space, shared_memory, n)
