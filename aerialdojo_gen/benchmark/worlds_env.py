"""The Gymnasium environment over worlds from seeds, which are made as episodes come to them."""

from __future__ import annotations

import string
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from aerialdojo_gen.base.config.shared import TaskConfig
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.env import AerialDojoEnv
from aerialdojo_gen.benchmark.observations import GoalText
from aerialdojo_gen.benchmark.worlds import WorldMaker

_LONGEST_TEXT = 1000
_CHARACTERS = "".join(sorted({*string.printable, *"“”‘’éèüöäñç–"}))
_MAX_ACTIONS = TaskConfig().long_horizon.action_budget


class WorldsEnv(gymnasium.Env[dict[str, Any], np.int64]):
    """Episodes in worlds from seeds: `AerialDojoEnv` over one world after the other.

    While episodes go on in a world, the next one is made in another process. Worlds stay in the cache
    (``$AERIALDOJO_CACHE``, at most ``$AERIALDOJO_CACHE_GB`` gigabytes), and later environments find them there. The
    worlds are gone through in an order that the seed of `reset` draws, and again in another one when all were seen.

    Parameters
    ----------
    worlds : str or sequence of str
        Names of scene types, or globs: ``"U_*"``.
    start_seed : int
        The first seed. Seeds from 1,000 on are for training, 0 to 199 for test, 200 to 999 for validation.
    num_worlds : int
        How many seeds, of every type.
    episodes_per_world : int
        So many episodes in a row are in one world.
    knobs : mapping, optional
        Knobs of the types, by name.
    held_out : bool
        Worlds of topologies, palettes and props that no other world has.
    n_objects : int
        Most annotated objects of a world: tasks grow with the square.
    cache : Path, optional
        In place of the user's cache.
    **options
        As for `AerialDojoEnv`, without `data` and `scene`: ``modality="semantic"``, ``views=("front",)``, …

    Raises
    ------
    UsageError
        No such type, or a value makes no sense.
    AerialDojoError
        A world could not be made.
    """

    metadata = AerialDojoEnv.metadata

    def __init__(
        self,
        worlds: str | Sequence[str],
        *,
        start_seed: int = 1000,
        num_worlds: int = 1,
        episodes_per_world: int = 20,
        knobs: Mapping[str, float] | None = None,
        held_out: bool = False,
        n_objects: int = 40,
        cache: Path | None = None,
        **options: Any,
    ) -> None:
        for name in ("data", "scene"):
            if name in options:
                raise UsageError(f"{name} and worlds: name either a release or worlds")
        if episodes_per_world < 1:
            raise UsageError(f"episodes_per_world is at least 1, not {episodes_per_world}")
        self._maker = WorldMaker(
            worlds, start_seed, num_worlds, knobs=knobs, held_out=held_out, n_objects=n_objects, folder=cache
        )
        self._options, self._in_a_row = options, episodes_per_world
        self._order: list[int] = []
        self._at = self._left = 0
        try:
            self._inner = AerialDojoEnv(self._maker.root(self._maker.worlds[0]), **options)
        except BaseException:
            self._maker.close()
            raise
        self.render_mode = self._inner.render_mode
        self.action_space = self._inner.action_space
        self.observation_space: spaces.Dict = _for_all_worlds(self._inner.observation_space)

    @property
    def worlds(self) -> list[str]:
        """Names of the worlds."""
        return [world.name for world in self._maker.worlds]

    @property
    def world(self) -> str:
        """Name of the world of the episode."""
        return self._maker.worlds[self._at].name

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; as `AerialDojoEnv.reset`, and ``options={"world": NAME}`` chooses the world."""
        super().reset(seed=seed)
        options = dict(options or {})
        if seed is not None:
            self._order, self._left = [], 0
        if (named := options.pop("world", None)) is not None:
            if named not in self.worlds:
                raise UsageError(f"no world {named!r} among {self.worlds[0]} to {self.worlds[-1]}")
            self._enter(self.worlds.index(named))
        elif self._left == 0 and not options:
            self._enter(self._next(), self._order[0] if self._order else None)
            self._left = self._in_a_row
        self._left = max(self._left - 1, 0)
        return self._inner.reset(seed=int(self.np_random.integers(2**31)), options=options or None)

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Carry out an action, as `AerialDojoEnv.step`."""
        return self._inner.step(action)

    def render(self) -> Any:
        """Return the four views in one picture, as `AerialDojoEnv.render`."""
        return self._inner.render()

    def close(self) -> None:
        """Let go of the world and of what is being made; a second call does nothing."""
        self._inner.close()
        self._maker.close()

    def _next(self) -> int:
        if not self._order:
            self._order = self.np_random.permutation(len(self._maker.worlds)).tolist()
        return self._order.pop(0)

    def _enter(self, at: int, coming: int | None = None) -> None:
        """Open a world, and begin to make the one that comes after it."""
        root = self._maker.root(self._maker.worlds[at])
        if coming is not None:
            self._maker.prepare(self._maker.worlds[coming])
        self._inner.close()
        self._at, self._inner = at, AerialDojoEnv(root, **self._options)


def _for_all_worlds(space: spaces.Dict) -> spaces.Dict:
    """Widen the space of one world: texts of any world, and the most actions of a setting."""
    text = GoalText(_LONGEST_TEXT, min_length=0, charset=_CHARACTERS)
    goal_space = space["goal"]
    assert isinstance(goal_space, spaces.Dict)
    actions = spaces.Box(0, _MAX_ACTIONS, (1,), np.int32)
    goal = {name: text if isinstance(own, spaces.Text) else own for name, own in goal_space.items()}
    return spaces.Dict({**space, "step": actions, "remaining_actions": actions, "goal": spaces.Dict(goal)})


def make(data: Any = None, *, worlds: str | Sequence[str] | None = None, **options: Any) -> gymnasium.Env[Any, Any]:
    """Make ``AerialDojo-v0``: of a release, or of `worlds`."""
    if worlds is None:
        return AerialDojoEnv("data" if data is None else data, **options)
    return WorldsEnv(worlds, **options | ({} if data is None else {"data": data}))
