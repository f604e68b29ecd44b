"""Tasks flown one after the other: scene, episode, observations, and whether a target is in sight (SR-view).

The paper's rule knows one viewpoint of a target, its goal anchor: who stops before another side of the object has
failed, and who stops behind a wall has not. SR-view is an explicit Stop, without collision, within the budget, at
most the success radius from any valid viewpoint of the target, and with the target in sight: a straight line from the
body's centre reaches a point of its surface before any other surface. A goal is a viewpoint of its target too.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from threading import Thread

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.constants import SUCCESS_RADIUS_M
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Rules, Sensors
from aerialdojo_gen.benchmark.observations import render_views
from aerialdojo_gen.benchmark.tasks import NO_TARGET, Task, check_hints, goal_of, mesh_of
from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.planning.flight_space import FlightSpace, Point, flight_space, prefetch_flight_space
from aerialdojo_gen.rendering.casters import in_sight
from aerialdojo_gen.scenes.context import SEVERAL, hold_scenes, release_scene
from aerialdojo_gen.scenes.light import Light, chosen_light
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, Where, open_root

Floats = NDArray[np.float64]

_NONE = np.empty((0, 3))
_TABLE = "release/viewpoints"
_COLUMNS = ("object_id", "x_m", "y_m", "z_m")


@dataclass(frozen=True)
class View:
    """A body's distance to a target's viewpoints, and the target's visibility."""

    viewpoint_distance_m: float  # To the nearest valid viewpoint of the target, its goal included, metres
    target_in_sight: bool  # A straight line reaches the target unobstructed


def viewpoints_content(root: DataRoot, scene: str) -> list[str]:
    """Content digests of a scene's viewpoints; empty if an older release has none."""
    return store.content(root, _TABLE, scene) if store.shards(root, _TABLE, scene) else []


def no_viewpoints_message(scenes: Sequence[str], of: int) -> str:
    """Name the scenes whose episodes get no SR-view."""
    which = "the release has" if len(scenes) == of else f"{', '.join(scenes)}: the release has"
    return f"{which} no viewpoints/, which an older version did not write: SR-view stays empty"


@lru_cache(maxsize=64)
def viewpoints_of(root: DataRoot, scene: str) -> dict[int, Floats] | None:
    """Read the valid viewpoints of objects, (n, 3) world metres by ``object_id``; None in a release without."""
    if not store.shards(root, _TABLE, scene):
        return None
    table = store.read_scene(root, _TABLE, scene, _COLUMNS)
    ids = table["object_id"].to_numpy()
    xyz = np.column_stack([table[column].to_numpy() for column in _COLUMNS[1:]])
    return {int(k): xyz[ids == k] for k in np.unique(ids)}


@lru_cache(maxsize=64)
def nodes_of(root: DataRoot, scene: str) -> dict[int, str]:
    """Mesh nodes of a scene's objects, by ``object_id``."""
    table = store.read_scene(root, "release/objects", scene, ("object_id", "mesh_node"))
    return dict(zip(table["object_id"].to_pylist(), table["mesh_node"].to_pylist(), strict=True))


def view_of(scene: Scene, node: str, viewpoints: Floats, goal: Point, position: Point) -> View:
    """Distance to the nearest viewpoint, world metres, and whether the target is in sight from a position."""
    nearest = math.dist(position, goal)
    if len(viewpoints):
        nearest = min(nearest, float(np.linalg.norm(viewpoints - np.array(position), axis=1).min()))
    return View(nearest, in_sight(scene, node, position))


class Flight:
    """Flies tasks: the evaluator's side. An agent gets only the `goal` and what `observe` returns."""

    task: Task  # Current, from `begin` on; so are the following
    goal: Goal
    episode: Episode
    space: FlightSpace
    light: Light

    def __init__(
        self, data: Where, sensors: Sensors, success_radius_m: float = SUCCESS_RADIUS_M,
        embodiment: Embodiment | None = None, renderer: str = "auto", hints: Sequence[str] = (),
        scenes_in_memory: int = SEVERAL,
    ) -> None:  # fmt: skip
        self._scenes_in_memory = scenes_in_memory
        self._opened: set[str] = set()
        self._reader: Thread | None = None
        if scenes_in_memory > SEVERAL:
            hold_scenes(self, scenes_in_memory)
        self._data = open_root(data)
        self._body = embodiment or Embodiment()
        self.renderer = renderer
        self._hints = check_hints(hints)
        self.sensors = sensors
        self.success_radius_m = success_radius_m

    def begin(self, task: Task) -> Episode:
        """Begin the episode of a task."""
        row = task.row
        body, budget = self._body, row["action_budget"]
        rules = Rules(budget, self.success_radius_m, body.radius_m, body.wheelbase_m, self.sensors)
        self.task = task
        self.goal = goal_of(self._data, task, rules, self._hints)
        mesh, sha256 = mesh_of(self._data, row["scene"])
        if self._reader is not None and self._reader.name == sha256:
            self._reader.join()
        self.space = flight_space(mesh, sha256, body.radius_m, self._scenes_in_memory)
        self._opened.add(sha256)
        self.light = chosen_light(self.space.scene.light, self.sensors.light, 0, row["task_id"])
        self.episode = Episode(self.space, task.start, task.goal, budget)
        return self.episode

    def prefetch_scene(self, scene: str) -> None:
        """Read a scene in a thread while flying in another; does nothing while one is being read."""
        mesh, sha256 = mesh_of(self._data, scene)
        if self._reader is not None and self._reader.is_alive():
            return

        def read() -> None:
            # Errors are raised when it is opened.
            with contextlib.suppress(Exception):
                prefetch_flight_space(mesh, sha256, self._body.radius_m)

        self._opened.add(sha256)
        self._reader = Thread(target=read, name=sha256, daemon=True)
        self._reader.start()

    def close(self) -> None:
        """Release the scenes that were opened; a second call does nothing."""
        if self._reader is not None:
            self._reader.join()
            self._reader = None
        hold_scenes(self, 0)
        while self._opened:
            release_scene(self._opened.pop())
        self.__dict__.pop("space", None)

    def view(self) -> View | None:
        """Return the body's distance to viewpoints and the target's visibility; None without viewpoints."""
        task, scene = self.task, self.task.row["scene"]
        viewpoints = viewpoints_of(self._data, scene)
        if viewpoints is None or task.target_id == NO_TARGET:
            return None
        node = nodes_of(self._data, scene).get(task.target_id)
        if node is None:
            raise StoreError(
                f"object {task.target_id} of {scene} is not in {self._data}/release: "
                f"run {command('split', scene=scene)}"
            )
        own = viewpoints.get(task.target_id, _NONE)
        return view_of(self.space.scene, node, own, task.goal, self.episode.position)

    def observe(self) -> Observation:
        """Return the agent's observation before its next action."""
        episode = self.episode
        rgb, depth_m = render_views(
            self.space.scene, self.sensors, episode.position, episode.yaw_rad, self.renderer, self.light
        )
        return Observation(episode.n_actions, episode.remaining_actions, episode.refused, rgb, depth_m)
