"""Many environments at once, and rewards for getting nearer: for reinforcement learning."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.env import AerialDojoEnv, make_env
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.learning.labels import geodesic
from aerialdojo_gen.learning.words import Vocabulary, goal_text
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.schemas import DIRECTIONS


def _innermost(env: gymnasium.Env[Any, Any], what: str) -> AerialDojoEnv:
    if not isinstance(env.unwrapped, AerialDojoEnv):
        raise UsageError(f"{what}, not of {env.unwrapped}")
    return env.unwrapped


class ProgressReward(gymnasium.Wrapper[dict[str, Any], np.int64, dict[str, Any], np.int64]):
    """Adds to the reward what an action brings the body nearer to the goal, on ways that it can fly.

    The distance is `aerialdojo_gen.learning.labels.Geodesic`'s. With a discount of 1 what is added over an episode
    is the distance at the start less that at the end, times `scale`: a potential, which changes no optimal policy.

    Parameters
    ----------
    env : AerialDojoEnv
        Or wrappers around it.
    scale : float
        Reward a metre.
    action_cost : float
        Taken off for every action.
    collision_cost : float
        Taken off for a collision.
    discount : float
        The learner's, for the potential: ``discount * after - before``.

    Notes
    -----
    ``info["goal_distance_m"]`` has the distance, for curves: no agent may see it.
    """

    def __init__(
        self,
        env: gymnasium.Env[dict[str, Any], np.int64],
        scale: float = 0.1,
        action_cost: float = 0.0,
        collision_cost: float = 0.0,
        discount: float = 1.0,
    ) -> None:
        super().__init__(env)
        self._own = _innermost(env, "progress is of AerialDojo-v0's episodes")
        if not 0.0 <= discount <= 1.0:
            raise UsageError(f"a discount is from 0 to 1, not {discount}")
        self._scale, self._action_cost, self._collision_cost = scale, action_cost, collision_cost
        self._discount = discount
        self._left_m = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; see `AerialDojoEnv.reset`."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._left_m = self._goal_distance_m()
        return observation, {**info, "goal_distance_m": self._left_m}

    def step(self, action: Any) -> tuple[dict[str, Any], SupportsFloat, bool, bool, dict[str, Any]]:
        """Carry out an action; see `AerialDojoEnv.step`."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        before, after = self._left_m, self._goal_distance_m()
        # Where no way is known, in a nook that the grid does not enter, there is no progress either.
        self._left_m = after if np.isfinite(after) else before
        gained = self._scale * (before - self._discount * self._left_m) - self._action_cost
        if info["reason"] == "collision":
            gained -= self._collision_cost
        return observation, float(reward) + gained, terminated, truncated, {**info, "goal_distance_m": self._left_m}

    def _goal_distance_m(self) -> float:
        env = self._own
        geodesics = geodesic(*mesh_of(env.data, env.task.row["scene"]), env.radius_m)
        return float(geodesics.distances_m(env.task.goal, [env.episode.position])[0])


class OwnScenes(gymnasium.Wrapper[dict[str, Any], np.int64, dict[str, Any], np.int64]):
    """Draws episodes from some scenes alone; spaces stay those of all tasks, so that environments can be joined.

    Parameters
    ----------
    env : AerialDojoEnv
    scenes : sequence of str
        Names.
    """

    def __init__(self, env: gymnasium.Env[dict[str, Any], np.int64], scenes: Sequence[str]) -> None:
        super().__init__(env)
        _innermost(env, "scenes are of AerialDojo-v0's tasks").draw_from(scenes)


def make_vec(
    data: Where = "data",
    num_envs: int = 4,
    *,
    vectorization_mode: str = "async",
    scene: str | Sequence[str] = (),
    spread_scenes: bool = True,
    progress: dict[str, float] | bool = False,
    wrappers: Sequence[Callable[[gymnasium.Env[Any, Any]], gymnasium.Env[Any, Any]]] = (),
    context: str | None = None,
    **options: Any,
) -> AsyncVectorEnv | SyncVectorEnv:
    """Make a Gymnasium vector environment of ``AerialDojo-v0``.

    Parameters
    ----------
    data : str, Path or DataRoot
    num_envs : int
        How many environments.
    vectorization_mode : str
        ``"async"``: a process each; ``"sync"``: all in this one.
    scene : str or sequence of str
        Names or globs; all of the release where absent.
    spread_scenes : bool
        Share the scenes out, so that each environment keeps few meshes open; False lets each draw from all. With
        fewer scenes than environments several have the same.
    progress : bool or dict
        Wrap each in `ProgressReward`, with these parameters.
    wrappers : sequence of callable
        Applied to each environment after that, the first first.
    context : str, optional
        How processes start; spawn where absent: a fork of a process that has drawn cannot draw.
    **options
        As for `AerialDojoEnv`: ``split="id_train"``, ``views=("front",)``, ``width=128``, …

    Returns
    -------
    gymnasium.vector.AsyncVectorEnv or SyncVectorEnv

    Raises
    ------
    UsageError
        No task fits, or a value makes no sense.
    StoreError
        There is no release in `data`.
    """
    if num_envs < 1:
        raise UsageError(f"there is at least 1 environment, not {num_envs}")
    if vectorization_mode not in ("async", "sync"):
        raise UsageError(f"no vectorization mode {vectorization_mode!r}: there are 'async' and 'sync'")
    root = open_root(data)
    scenes = make_env(data, scene=scene, **{**options, "views": (), "sensors": None}).scenes
    shares = [tuple(scenes[k % len(scenes) :: num_envs]) if spread_scenes else () for k in range(num_envs)]
    shaping: Any = {} if progress is True else progress or None
    shaped = [] if shaping is None else [partial(ProgressReward, **shaping)]
    makers = [
        partial(
            _make_one, root.url, {**options, "scene": scene},
            [*([partial(OwnScenes, scenes=share)] if share else []), *shaped, *wrappers],
        )
        for share in shares
    ]  # fmt: skip
    if vectorization_mode == "sync":
        return SyncVectorEnv(makers)
    return AsyncVectorEnv(makers, context=context or "spawn")


def _make_one(data: str, options: dict[str, Any], wrappers: Sequence[Callable[..., Any]]) -> gymnasium.Env[Any, Any]:
    env: gymnasium.Env[Any, Any] = make_env(data, **options)
    for wrap in wrappers:
        env = wrap(env)
    return env


# How the views of a step become one array.
_JOIN: Mapping[str, Callable[..., Any]] = {"rgb": np.concatenate, "depth_m": np.stack}


class Flattened(gymnasium.ObservationWrapper[dict[str, Any], np.int64, dict[str, Any]]):
    """Observations of one level without texts, for learners that read arrays alone (Stable-Baselines3).

    Views stand one after the other as channels: ``rgb`` (H, W, 3 · views) uint8, ``depth_m`` (H, W, views) float32;
    ``tokens`` numbers the goal's words, ``remaining_actions`` and ``refused`` are as they are.

    Parameters
    ----------
    env : AerialDojoEnv
        Or wrappers around it.
    vocabulary : Vocabulary, optional
        Of the goal's words: that of the training set; where absent, of the tasks of this environment.
    """

    def __init__(self, env: gymnasium.Env[dict[str, Any], np.int64], vocabulary: Vocabulary | None = None) -> None:
        super().__init__(env)
        own = _innermost(env, "observations are of AerialDojo-v0")
        self.vocabulary = vocabulary or Vocabulary.of(goal_text(*said) for said in own.goals_in_words())
        seen = own.observation_space
        tokens = spaces.Box(0, len(self.vocabulary) - 1, (self.vocabulary.length,), np.int64)
        refused = spaces.Box(0, 1, (1,), np.int32)
        flat = {"tokens": tokens, "remaining_actions": seen["remaining_actions"], "refused": refused}
        for name, join in _JOIN.items():
            if name in seen.spaces:
                views: list[Any] = list(seen[name].spaces.values())  # type: ignore[attr-defined]
                low, high = (join([getattr(view, end) for view in views], axis=-1) for end in ("low", "high"))
                flat[name] = spaces.Box(low, high, dtype=views[0].dtype)
        self.observation_space = spaces.Dict(flat)

    def observation(self, observation: dict[str, Any]) -> dict[str, Any]:
        """Flatten an observation."""
        goal = observation["goal"]
        text = goal_text(goal["target_name"], goal["landmark"], DIRECTIONS[goal["direction"]], goal["description"])
        flat: dict[str, Any] = {
            "tokens": self.vocabulary.encode(text),
            "remaining_actions": observation["remaining_actions"],
            "refused": np.array([observation["refused"]], np.int32),
        }
        for name, join in _JOIN.items():
            if name in observation:
                flat[name] = join(list(observation[name].values()), axis=-1)
        return flat
