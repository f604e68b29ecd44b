"""The scheduler: takes each scene through the stages independently, in one process if possible.

A process reuses what it has read and built of a scene in all stages. A scene's next shards are checked for freshness
when the stage before has written all of its own. What each stage is expected to take orders the scenes.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence

from aerialdojo_gen.base.errors import AerialDojoError, BudgetSpent
from aerialdojo_gen.pipeline.executors.base import TaskQueue
from aerialdojo_gen.pipeline.freshness import ShardFinder, Shards
from aerialdojo_gen.pipeline.progress import Overview
from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
from aerialdojo_gen.pipeline.task import Computed, StageSummary, Task
from aerialdojo_gen.store import shards as store

# Bytes of an annotation file for each of its objects, as in those of the 42 scenes.
_BYTES_PER_OBJECT = 320
_OBJECTS = 40
# Weight of the expected seconds, relative to measured ones.
_PRIOR_S = 10.0

# A second process must first read and build the scene again, which takes about half of that.
_JOIN_S = 6.0


class SceneScheduler(TaskQueue[Task]):
    """Schedules scenes through the same sequence of stages."""

    def __init__(self, stages: Sequence[Stage], finder: ShardFinder, estimate: RuntimeEstimate) -> None:
        super().__init__((), lambda task: task.scene, memory_mb=max(stage.memory_mb for stage in stages))
        self._stages, self._names = stages, list(finder.scenes)
        self._finder, self._estimate = finder, estimate
        self._totals = [StageSummary(stage.name) for stage in stages]
        self._tasks = Counter[int]()
        # How many stages a scene has behind it, and how many shards of its next one are there, and not done.
        self._passed = dict.fromkeys(finder.scenes, 0)
        self._shards, self._left = Counter[str](), Counter[str]()
        self._running: dict[tuple[str, int], Task] = {}
        self._ended: set[str] = set()
        self._spent: set[str] = set()
        self._errors: list[tuple[int, int, AerialDojoError]] = []
        self._reported, self._peak_running = 0, 0
        self.on_start: Callable[[], None] = lambda: None  # Called at the start of each task
        passed = self._names
        for number in range(len(stages)):
            passed = self._enter(number, passed)
        self._end(passed)

    @property
    def alone(self) -> bool:
        """Whether there is never more than one task at a time."""
        passed = {scene: passed for scene, passed in self._passed.items() if scene not in self._ended}
        in_parts = any(stage.parts for stage in self._stages[min(passed.values(), default=0) :])
        return len(self) <= 1 and len(passed) <= 1 and not (passed and in_parts)

    @property
    def errors(self) -> list[AerialDojoError]:
        """Expected errors, sorted by stage and scene."""
        return [error for _, _, error in sorted(self._errors, key=lambda one: one[:2])]

    @property
    def only_stage(self) -> str:
        """Name of the stage if there is a single one; else empty."""
        return self._stages[0].name if len(self._stages) == 1 else ""

    def overview(self) -> Overview:
        """Return the progress of the run."""
        running = [f"{task.scene} {task.job.stage}{_part(task)}" for task in list(self._running.values())]
        estimate = self._estimate
        scenes = len(self._ended), len(self._names)
        return Overview(estimate.done_s, estimate.left_s, *scenes, running, self._peak_running)

    def summaries(self) -> list[StageSummary]:
        """Return summaries of stages that all scenes have completed since the last call."""
        reported, self._reported = self._reported, min(self._passed.values(), default=len(self._stages))
        return [self._summary(number) for number in range(reported, self._reported)]

    def on_done(self, task: Task, outcome: Computed | AerialDojoError) -> None:
        """Record a task's result; the last task of a scene's stage queues those of the next stage."""
        scene, number = task.scene, self._passed[task.scene]
        totals = self._totals[number]
        del self._running[scene, task.job.part]
        self._left[scene] -= 1
        if isinstance(outcome, BudgetSpent):
            self._spent.add(scene)
        elif isinstance(outcome, AerialDojoError):
            self._fail(number, scene, outcome)
        else:
            totals.add(outcome.summary)
            totals.computed += 1
            totals.seconds += outcome.seconds
            self._estimate.record(totals.stage, scene, 1.0 / self._shards[scene], outcome.seconds)
        if self._left[scene] or scene in self._ended:
            return
        self._passed[scene] += 1
        if scene in self._spent:
            self._end([scene])
            return
        # Other processes may have written.
        self._finder.roots.data.refresh()
        while self._passed[scene] < len(self._stages):
            if not self._enter(self._passed[scene], [scene]):
                return
        self._end([scene])

    def requeue(self, task: Task) -> None:
        """Queue a task again whose process is gone, as the first of its scene."""
        del self._running[task.scene, task.job.part]
        super().requeue(task)

    def _enter(self, number: int, scenes: list[str]) -> list[str]:
        """Queue the stale shards of a stage; returns the scenes that have none, which have passed the stage."""
        if not scenes:
            return []
        stage, totals, started = self._stages[number], self._totals[number], time.monotonic()
        try:
            found = self._finder.find(stage, scenes)
        except AerialDojoError as error:
            found = Shards([], [], dict.fromkeys(scenes, error))
        for summary in found.fresh:
            totals.add(summary)
        self._tasks[number] += len(found.tasks)
        totals.seconds += time.monotonic() - started
        self._add(found.tasks)
        for scene, why in found.errors.items():
            self._fail(number, scene, why)
        shards = Counter(task.scene for task in found.tasks)
        for scene in shards:
            self._shards[scene] = self._left[scene] = shards[scene]
        passed = [scene for scene in scenes if scene not in shards and scene not in found.errors]
        for scene in passed:
            self._passed[scene] = number + 1
            self._estimate.drop(stage.name, scene)
        return passed

    def _fail(self, number: int, scene: str, error: AerialDojoError) -> None:
        self._errors.append((number, self._names.index(scene), error))
        self._end([scene])

    def _end(self, scenes: Sequence[str]) -> None:
        self._ended.update(scenes)
        for scene in scenes:
            for stage in self._stages:
                self._estimate.drop(stage.name, scene)

    def _pop(self, scene: str) -> Task:
        task = super()._pop(scene)
        self._running[scene, task.job.part] = task
        self._peak_running = max(self._peak_running, len(self._running))
        self.on_start()
        return task

    def _weight(self, scene: str) -> float:
        return sum(self._estimate.left(stage.name, scene) for stage in self._stages)

    def _should_join(self, scene: str) -> bool:
        stage = self._stages[self._passed[scene]]
        seconds = self._estimate.left(stage.name, scene) * len(self._scenes[scene]) / max(1, self._left[scene])
        return seconds >= _JOIN_S

    def _summary(self, number: int) -> StageSummary:
        totals, tasks = self._totals[number], self._tasks[number]
        if totals.computed < tasks:
            left = f"the budget is spent, {tasks - totals.computed:,} of {tasks:,} shards are left"
            self._finder.reporter.line(f"{totals.stage}: {left}; the same command continues from here")
        return totals


def _part(task: Task) -> str:
    return f" {task.job.part + 1}/{task.job.parts}" if task.job.parts > 1 else ""


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
