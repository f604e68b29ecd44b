"""The teacher of DAgger: the planner, asked from wherever the body has come to."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.planning.difficulty import agent_actions
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.scenes.context import SceneContext
from aerialdojo_gen.scenes.model import Scene

# In the place of an action where the planner finds no way.
NO_LABEL = N_ACTIONS
# Goals' cost-to-go that are kept: those of the episodes that are flown side by side.
_FIELDS_MB = 400.0, 0.0


class Teacher:
    """Says what the reference would do at a pose.

    The cost-to-go of a goal is made once; from every pose the planner's own search follows it, so that a label is the
    first action of the route that the release would have from there.
    """

    def __init__(self, scene: Scene, config: PlanConfig | None = None, radius_m: float = 0.25) -> None:
        # Who has strayed may be nearer than any task begins, or straight before the goal.
        own = (config or PlanConfig()).model_copy(update={"min_detour_ratio": 0.0})
        self._planner = Planner(scene, own, radius_m)

    def labels(self, goals: Sequence[ArrayLike], poses: Sequence[ArrayLike]) -> NDArray[np.int64]:
        """Planner's actions (n,) for goals and poses (metres, radians, world); `NO_LABEL` where there is no way."""
        ways = self.ways(goals, poses)
        return np.array([way[0] if len(way) else NO_LABEL for way in ways], np.int64)

    def ways(self, goals: Sequence[ArrayLike], poses: Sequence[ArrayLike]) -> list[NDArray[np.int8]]:
        """Plan from poses: the actions of each route, Stop at its end; none where no way is found."""
        out = [np.zeros(0, np.int8)] * len(poses)
        keys = [np.asarray(goal, np.float64).tobytes() for goal in goals]
        for key in dict.fromkeys(keys):
            rows = [k for k, own in enumerate(keys) if own == key]
            starts = np.array([np.asarray(poses[k], np.float64) for k in rows])
            for k, route in zip(rows, self._planner.plan_target(goals[rows[0]], starts), strict=True):
                if route.outcome == "SOLVED":
                    out[k] = agent_actions(route.actions)
        return out

    def keeping(self) -> AbstractContextManager[None]:
        """Keep goals' cost-to-go until the block ends."""
        return self._planner.keeping_fields(*_FIELDS_MB)


def teacher_of(context: SceneContext, config: PlanConfig, radius_m: float) -> Teacher:
    """Return a scene's teacher, a part of its context."""
    return context.part("teacher", lambda: Teacher(context.scene, config, radius_m), config, radius_m)
