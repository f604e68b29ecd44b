"""Which task comes next: several in a row of one scene, and the next scene known ahead."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import UsageError


class TaskDraw:
    """Draws tasks with replacement, every one equally often, in blocks of one scene.

    The first of a block is drawn from all tasks, and with it its scene; the others from that scene's.
    """

    def __init__(self, scenes: Sequence[str], in_a_row: int = 1) -> None:
        self._scenes = scenes
        self._in_a_row = in_a_row
        self._by_scene: dict[str, NDArray[np.int64]] = {
            scene: np.array([i for i, own in enumerate(scenes) if own == scene]) for scene in sorted(set(scenes))
        }
        self._all: NDArray[np.int64] = np.arange(len(scenes))
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget what was drawn ahead: what comes depends on the generator alone."""
        self._scene, self._left = "", 0
        self._ahead: int | None = None

    def restrict(self, scenes: Sequence[str]) -> None:
        """Draw from some scenes alone; UsageError where they have no task."""
        own = [self._by_scene[scene] for scene in sorted(set(scenes)) if scene in self._by_scene]
        if not own:
            raise UsageError(f"no task of the selection is in {', '.join(scenes)}")
        self._all = np.sort(np.concatenate(own))
        self.begin_anew()

    @property
    def coming(self) -> str | None:
        """The scene of the next block; None before the first draw."""
        return None if self._ahead is None else self._scenes[self._ahead]

    def next(self, draw: np.random.Generator) -> int:
        """Draw the next task: its number."""
        if self._left:
            self._left -= 1
            own = self._by_scene[self._scene]
            return int(own[draw.integers(len(own))])
        at = self._any(draw) if self._ahead is None else self._ahead
        self._scene, self._left = self._scenes[at], self._in_a_row - 1
        # Always, so that reading ahead changes no draw.
        self._ahead = self._any(draw)
        return at

    def _any(self, draw: np.random.Generator) -> int:
        return int(self._all[draw.integers(len(self._all))])
