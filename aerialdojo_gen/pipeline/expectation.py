"""What stages are expected to take, scene by scene: which scene is begun first, and how long a run still takes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
from aerialdojo_gen.store import shards as store

# Bytes of an annotation file for each of its objects, as in those of the 42 scenes.
_BYTES_AN_OBJECT = 320
_OBJECTS = 40
# So many expected seconds are believed as much as what was measured.
_BELIEVED_S = 10.0


class RuntimeEstimate:
    """What is left of stages, in seconds of one core, by the stages' own figures and by what was done so far."""

    def __init__(self, stages: Sequence[Stage], scenes: Sequence[str], roots: ProjectPaths) -> None:
        objects = {scene: objects_of(roots, scene) for scene in scenes}
        self._expected = {
            (stage.name, scene): stage.seconds[0] + stage.seconds[1] * objects[scene]
            for stage in stages
            for scene in scenes
        }
        self._left = dict(self._expected)
        self._took: defaultdict[str, float] = defaultdict(float)
        self._for: defaultdict[str, float] = defaultdict(float)

    def record(self, stage: str, scene: str, share: float, seconds: float) -> None:
        """Hear how long a share of a scene's work took."""
        expected = self._expected[stage, scene] * share
        self._left[stage, scene] = max(0.0, self._left[stage, scene] - expected)
        self._took[stage] += seconds
        self._for[stage] += expected

    def drop(self, stage: str, scene: str) -> None:
        """Hear that nothing is to be done of a scene."""
        self._left[stage, scene] = 0.0

    def left(self, stage: str, scene: str) -> float:
        """What is left of a scene, seconds of one core."""
        return self._left[stage, scene] * self._factor(stage)

    @property
    def done_s(self) -> float:
        """What has been done, seconds of one core."""
        return sum(self._took.values())

    @property
    def left_s(self) -> float:
        """What is left in all, seconds of one core."""
        return sum(self.left(*key) for key in self._left)

    def _factor(self, stage: str) -> float:
        overall = (self.done_s + _BELIEVED_S) / (sum(self._for.values()) + _BELIEVED_S)
        return (self._took[stage] + overall * _BELIEVED_S) / (self._for[stage] + _BELIEVED_S)


def objects_of(roots: ProjectPaths, scene: str) -> float:
    """Tell about how many objects a scene has: by its table, else by the size of its annotation file."""
    try:
        return float(store.count_rows(roots.data, "objects", scene))
    except AerialDojoError:
        pass
    try:
        return (roots.annotations / f"{scene}.json").stat().st_size / _BYTES_AN_OBJECT
    except OSError:
        return _OBJECTS
