"""Estimated run time of stages, scene by scene: orders the scenes and gives the time left."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
from aerialdojo_gen.store import shards as store

# Bytes of an annotation file for each of its objects, as in those of the 42 scenes.
_BYTES_PER_OBJECT = 320
_OBJECTS = 40
# Weight of the expected seconds, relative to measured ones.
_PRIOR_S = 10.0


class RuntimeEstimate:
    """Seconds of one core left, from the stages' figures scaled by measured times."""

    def __init__(self, stages: Sequence[Stage], scenes: Sequence[str], roots: ProjectPaths) -> None:
        objects = {scene: objects_of(roots, scene) for scene in scenes}
        self._expected = {
            (stage.name, scene): stage.seconds[0] + stage.seconds[1] * objects[scene]
            for stage in stages
            for scene in scenes
        }
        self._left = dict(self._expected)
        self._spent_s: defaultdict[str, float] = defaultdict(float)
        self._expected_s: defaultdict[str, float] = defaultdict(float)

    def record(self, stage: str, scene: str, share: float, seconds: float) -> None:
        """Record the time of a share of a scene's work."""
        expected = self._expected[stage, scene] * share
        self._left[stage, scene] = max(0.0, self._left[stage, scene] - expected)
        self._spent_s[stage] += seconds
        self._expected_s[stage] += expected

    def drop(self, stage: str, scene: str) -> None:
        """Record that a scene has nothing left to do."""
        self._left[stage, scene] = 0.0

    def left(self, stage: str, scene: str) -> float:
        """Time left for a scene, seconds of one core."""
        return self._left[stage, scene] * self._factor(stage)

    @property
    def done_s(self) -> float:
        """Time spent, seconds of one core."""
        return sum(self._spent_s.values())

    @property
    def left_s(self) -> float:
        """Time left in total, seconds of one core."""
        return sum(self.left(*key) for key in self._left)

    def _factor(self, stage: str) -> float:
        overall = (self.done_s + _PRIOR_S) / (sum(self._expected_s.values()) + _PRIOR_S)
        return (self._spent_s[stage] + overall * _PRIOR_S) / (self._expected_s[stage] + _PRIOR_S)


def objects_of(roots: ProjectPaths, scene: str) -> float:
    """Estimate the number of objects of a scene from its table, else from the size of its annotation file."""
    try:
        return float(store.count_rows(roots.data, "objects", scene))
    except AerialDojoError:
        pass
    try:
        return (roots.annotations / f"{scene}.json").stat().st_size / _BYTES_PER_OBJECT
    except OSError:
        return _OBJECTS
