"""The Gymnasium environment: one released task an episode, closed loop, without a simulator server."""

from __future__ import annotations

import string
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pyarrow.compute as pc
from gymnasium import spaces
from numpy.typing import NDArray

from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.constants import MODALITIES, SUCCESS_RADIUS_M
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import as_names, unknown
from aerialdojo_gen.benchmark import tasks
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS, Sensors
from aerialdojo_gen.benchmark.flight import Flight
from aerialdojo_gen.benchmark.observations import GoalText, mosaic, observed_goal, render_views
from aerialdojo_gen.benchmark.tasks import Selection, Task, TaskSampler, check_hints, image_shape, read_tasks, select
from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.scenes.context import SEVERAL
from aerialdojo_gen.store.root import DataRoot, Where, open_root
from aerialdojo_gen.store.schemas import DIRECTIONS, VIEWS

_TEXT = ("target_name", "landmark", "description")
_NO_COPY = (
    "an environment cannot be copied: it holds an OpenGL context and a collision world; make another one with the "
    "same arguments (make_env, make_vec); reset(options={'task_id': …}) and the same actions lead to the same state"
)
_RENDERED = Sensors(depth=False, width=320, height=320)


class AerialDojoEnv(gymnasium.Env[dict[str, Any], np.int64]):
    """Search for an object in a scene, from the start pose of a released task (paper: closed-loop evaluation).

    Actions are `Discrete(16)`: Stop, moves and turns of `aerialdojo_gen.store.schemas.ACTION_NAMES`, carried out by
    their exact magnitudes. An episode is `terminated` by Stop or by a collision, and `truncated` where the last
    action of the budget is neither; ``info["reason"]`` is then ``"stop"``, ``"collision"`` or ``"budget"``, ``""``
    before. At the end, and not before, the info has also the ``task_id``, whether the episode was a ``success``, and
    the distance to the goal, ``distance_m``. A move that would leave the flight volume is refused: it is spent, and
    nothing moves. The reward is 1 for a Stop within the success radius, and 0 otherwise.

    An observation is a dict: ``step`` and ``remaining_actions`` ((1,) int32), ``refused`` (0 or 1), ``goal``
    (modality, target_name, landmark, direction, and description or image), and, where asked for, ``rgb`` and
    ``depth_m`` by view. While an episode goes on, neither it nor the info holds a pose, a distance, a route or an id
    (paper: what an agent may know).

    Parameters
    ----------
    data : DataRoot, path or str
        The data root, a directory or a URL: its release and its meshes.
    split, setting, modality, scene : str or sequence of str, optional
        Which tasks; all where absent. Scenes may be globs.
    limit : int, optional
        Draw so many of them.
    seed : int
        Of that draw.
    sensors : Sensors, optional
        What is rendered. Keywords do as well: `views`, `rgb`, `depth`, `width`, `height`, `light`.
    views, rgb, depth, width, height, light
        In place of `sensors`; ``views=()`` flies blind, tens of thousands of steps a second.
    success_radius_m : float
        How near to the goal a Stop must be.
    embodiment : Embodiment, optional
        The body.
    renderer : str
        ``"gl"``, ``"pybullet"``, or ``"auto"`` for the fastest that works here.
    tell : str or sequence of str
        ``"heading"``: the goal says which way the body faces at the start, as `heading` (an index of the eight
        directions) and `heading_deg` (clockwise from north).
    paraphrase : str
        ``"task"``: a semantic goal has the task's own description. ``"random"``: one of its target's is drawn for
        every episode, of test tasks one of those that training tasks do not have.
    render_mode : str, optional
        ``"rgb_array"``: `render` returns the four views in one picture.
    scenes_in_memory : int
        How many scenes stay open in this process, some 100 to 200 MB each: going back to one of them costs nothing,
        another one seconds.
    episodes_per_scene : int
        So many episodes in a row are drawn in one scene. Over many episodes tasks are drawn as often as with 1.
    prefetch : bool
        Read the scene that comes next in a thread, while this one is flown in; it comes beside `scenes_in_memory`.
        Tasks are the same ones with it and without.

    Raises
    ------
    UsageError
        No task fits, or a value makes no sense.
    StoreError
        There is no release in `data`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}  # noqa: RUF012 (Gymnasium's own declaration)

    def __init__(
        self,
        data: Where = "data",
        *,
        split: str | Sequence[str] = (),
        setting: str | Sequence[str] = (),
        modality: str | Sequence[str] = (),
        scene: str | Sequence[str] = (),
        limit: int | None = None,
        seed: int = 0,
        sensors: Sensors | None = None,
        views: str | Sequence[str] = VIEWS,
        rgb: bool = True,
        depth: bool = True,
        width: int = 640,
        height: int = 640,
        light: str = "scene",
        success_radius_m: float = SUCCESS_RADIUS_M,
        embodiment: Embodiment | None = None,
        renderer: str = "auto",
        tell: str | Sequence[str] = (),
        paraphrase: str = "task",
        render_mode: str | None = None,
        scenes_in_memory: int = SEVERAL,
        episodes_per_scene: int = 1,
        prefetch: bool = False,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise UsageError(f"no render mode {render_mode!r}: there is 'rgb_array'")
        for name, number in (("scenes_in_memory", scenes_in_memory), ("episodes_per_scene", episodes_per_scene)):
            if number < 1:
                raise UsageError(f"{name} is at least 1, not {number}")
        self.render_mode = render_mode
        self._data = open_root(data)
        self._sensors = sensors or Sensors(as_names(views), rgb, depth, width, height, light=light)
        self._hints = check_hints(as_names(tell))
        self._paraphrase = tasks.check_paraphrase(paraphrase)
        self._flight = Flight(
            self._data, self._sensors, success_radius_m, embodiment, renderer, self._hints, scenes_in_memory
        )
        self._begun = self._closed = False
        splits, settings, modalities, scenes = map(as_names, (split, setting, modality, scene))
        self._rows = select(self._data, Selection(splits, settings, modalities, scenes, limit, seed))
        self._draw = TaskSampler(self._rows["scene"].to_pylist(), episodes_per_scene)
        self._prefetch = prefetch
        self._index: dict[str, int] | None = None
        self._image_shape = image_shape(self._data, self._rows)
        self.action_space = spaces.Discrete(N_ACTIONS)
        self.observation_space: spaces.Dict = self._observations()

    @property
    def data(self) -> DataRoot:
        """The data root."""
        return self._data

    @property
    def scenes(self) -> list[str]:
        """Names of the scenes that have tasks to draw, sorted."""
        return sorted(pc.unique(self._rows["scene"]).to_pylist())

    def draw_from(self, scenes: Sequence[str]) -> None:
        """Draw episodes from some scenes alone; the spaces stay those of all tasks."""
        self._draw.restrict(scenes)

    def goals_in_words(self) -> list[tuple[str, str, str, str | None]]:
        """Goals in words, of all tasks to draw from: target, landmark, direction, description or None."""
        names = (*_TEXT[:2], "direction")
        words = self._rows.group_by([*names, *_TEXT[2:], "scene", "subset", "nav_id"]).aggregate([]).to_pylist()
        return list(dict.fromkeys((*(w[name] for name in names), text) for w in words for text in self._texts(w)))

    def _texts(self, row: dict[str, Any]) -> Sequence[str | None]:
        """Return the descriptions that a task may have in an episode: of an image goal, None."""
        if self._paraphrase == "task" or row["description"] is None:
            return (row["description"],)
        return tasks.texts_of_tasks(self._data, row["scene"], row["subset"])[row["nav_id"]]

    @property
    def n_tasks(self) -> int:
        """Number of tasks that episodes are drawn from."""
        return int(self._rows.num_rows)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode.

        Parameters
        ----------
        seed : int, optional
            Of the draws of tasks from now on.
        options : dict, optional
            ``{"task_id": …}`` chooses the task; it is drawn where absent.

        Returns
        -------
        observation, info : dict

        Raises
        ------
        UsageError
            There is no such task among those chosen, or no such option.
        """
        if self._closed:
            raise RuntimeError("the environment is closed: make another one")
        super().reset(seed=seed)
        if seed is not None:
            self._draw.restart()
        unknown = set(options or {}) - {"task_id"}
        if unknown:
            raise UsageError(f"reset has no option {sorted(unknown)[0]!r}: there is 'task_id'")
        at = self._find(options["task_id"]) if options else self._draw.next(self.np_random)
        task = read_tasks(self._data, self._rows.slice(at, 1))[0]
        texts = self._texts(task.row)
        if len(texts) > 1:
            task = replace(task, row=task.row | {"description": texts[int(self.np_random.integers(len(texts)))]})
        self._flight.begin(task)
        self._begun = True
        if self._prefetch and not options and (coming := self._draw.coming) is not None:
            self._flight.prefetch_scene(coming)
        return self._observe(), {"reason": ""}

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Carry out an action.

        Parameters
        ----------
        action : int
            0 to 15.

        Returns
        -------
        observation : dict
        reward : float
            1 for success, else 0.
        terminated, truncated : bool
            Ended by Stop or collision; ended by the budget.
        info : dict
            ``reason``; at the end also ``task_id``, ``success`` and ``distance_m``.

        Raises
        ------
        ValueError
            There is no such action.
        RuntimeError
            No episode is under way.
        """
        episode = self.episode
        episode.step(int(action))
        reason = episode.termination or ""
        success = episode.success(self._flight.success_radius_m)
        info: dict[str, Any] = {"reason": reason}
        if reason:
            info |= {"task_id": self.task.row["task_id"], "success": success, "distance_m": episode.distance_m}
        return self._observe(), float(success), reason in ("stop", "collision"), reason == "budget", info

    def render(self) -> NDArray[np.uint8] | None:
        """Return the four views in one picture, (2 · H, 2 · W, 3) uint8, where the render mode is ``"rgb_array"``."""
        if self.render_mode is None:
            return None
        at, flight = self.episode, self._flight
        scene = flight.space.scene
        return mosaic(render_views(scene, _RENDERED, at.position, at.yaw_rad, flight.renderer, flight.light)[0])

    def close(self) -> None:
        """Let go of the scenes, their pictures and what reads ahead; a second call does nothing."""
        if not self._closed:
            self._closed, self._begun = True, False
            self._flight.close()

    def __reduce__(self) -> str:
        """Refuse to be copied: a copy would share what draws, and what holds the scene, with this one."""
        raise TypeError(_NO_COPY)

    @property
    def episode(self) -> Episode:
        """The episode under way, with the pose and the distances: the evaluator's, not for agents."""
        return self._under_way().episode

    @property
    def task(self) -> Task:
        """The task under way with its goal: the evaluator's, not for agents."""
        return self._under_way().task

    def _under_way(self) -> Flight:
        if not self._begun:
            raise RuntimeError("no episode is under way: call reset first")
        return self._flight

    @property
    def radius_m(self) -> float:
        """Radius of the body's collision sphere, metres."""
        return self._flight.space.radius_m

    def _find(self, task_id: str) -> int:
        if self._index is None:
            self._index = {name: i for i, name in enumerate(self._rows["task_id"].to_pylist())}
        if task_id not in self._index:
            raise UsageError(unknown(f"among the {self.n_tasks:,} chosen there is no task", task_id, self._index))
        return self._index[task_id]

    def _observations(self) -> spaces.Dict:
        """Make the space over all tasks, so that it reveals nothing about the current one."""
        said = {name: {text for text in pc.unique(self._rows[name]).to_pylist() if text} for name in _TEXT}
        if self._paraphrase != "task":
            said["description"] |= {text for *_, text in self.goals_in_words() if text}
        characters = "".join(sorted(set(string.printable).union(*(text for some in said.values() for text in some))))
        goal: dict[str, spaces.Space[Any]] = {
            "modality": spaces.Discrete(len(MODALITIES)),
            "direction": spaces.Discrete(len(DIRECTIONS)),
            **{
                name: GoalText(max(map(len, said[name]), default=1), min_length=0, charset=characters)
                for name in _TEXT
            },
        }
        if self._image_shape is not None:
            goal["image"] = spaces.Box(0, 255, self._image_shape, np.uint8)
            goal["image_distance_m"] = spaces.Box(0.0, 1000.0, (1,), np.float32)
        if "heading" in self._hints:
            goal |= {"heading": spaces.Discrete(len(DIRECTIONS)), "heading_deg": spaces.Box(0, 359, (1,), np.int32)}
        s = self._sensors
        budget = int(pc.max(self._rows["action_budget"]).as_py())
        entries: dict[str, spaces.Space[Any]] = {
            "step": spaces.Box(0, budget, (1,), np.int32),
            "remaining_actions": spaces.Box(0, budget, (1,), np.int32),
            "refused": spaces.Discrete(2),
            "goal": spaces.Dict(goal),
        }
        if s.views and s.rgb:
            entries["rgb"] = spaces.Dict(dict.fromkeys(s.views, spaces.Box(0, 255, (s.height, s.width, 3), np.uint8)))
        if s.views and s.depth:
            depth = spaces.Box(0.0, s.max_depth_m, (s.height, s.width), np.float32)
            entries["depth_m"] = spaces.Dict(dict.fromkeys(s.views, depth))
        return spaces.Dict(entries)

    def _observe(self) -> dict[str, Any]:
        seen = self._flight.observe()
        observation: dict[str, Any] = {
            "step": np.array([seen.step], np.int32),
            "remaining_actions": np.array([seen.remaining_actions], np.int32),
            "refused": np.int64(seen.refused),
            "goal": observed_goal(self._flight.goal, self._image_shape),
        }
        if "rgb" in self.observation_space.spaces:
            observation["rgb"] = seen.rgb
        if "depth_m" in self.observation_space.spaces:
            observation["depth_m"] = seen.depth_m
        return observation


def make_env(data: Where = "data", **options: Any) -> AerialDojoEnv:
    """Make the environment of a release; ``gymnasium.make("AerialDojo-v0", data=data)`` without Gymnasium's checks.

    Parameters
    ----------
    data : str, Path or DataRoot
        The data directory.
    **options
        As for `AerialDojoEnv`: ``split="id_train"``, ``views=("front",)``, ``width=128``, …

    Raises
    ------
    UsageError
        No task fits, or a value makes no sense.
    StoreError
        There is no release in `data`.
    """
    return AerialDojoEnv(open_root(data).url, **options)
