"""Scenes on their way through stages: each at its own pace, and in one process as far as that can be.

What a process has read and built of a scene serves all stages that it takes the scene through. Whether a scene's next
shards are fresh is looked at when the stage before has written all of its own.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.config.sections import Section
from aerialdojo_gen.base.environment_errors import check_memory
from aerialdojo_gen.base.errors import AerialDojoError, BudgetSpent
from aerialdojo_gen.pipeline.executors.base import TaskQueue
from aerialdojo_gen.pipeline.expectation import RuntimeEstimate
from aerialdojo_gen.pipeline.freshness import Limits, Shards, shards_of
from aerialdojo_gen.pipeline.progress import Overview, Reporter
from aerialdojo_gen.pipeline.stage import ProjectPaths, Stage
from aerialdojo_gen.pipeline.summary import StageSummary
from aerialdojo_gen.pipeline.task import Computed, Task

# A second process has to read and build a scene anew first, which takes about half of that.
_JOIN_S = 6.0


@dataclass
class _Tally:
    """What became of a stage's shards."""

    summaries: list[dict[str, Any]] = field(default_factory=list)
    tasks: int = 0
    computed: int = 0
    seconds: float = 0.0


class SceneScheduler(TaskQueue[Task]):
    """Scenes that go through the same stages, one after the other."""

    def __init__(
        self,
        stages: Sequence[Stage],
        scenes: Sequence[str],
        pipeline: Pipeline,
        roots: ProjectPaths,
        forced: Collection[str],
        limits: Limits,
        reporter: Reporter,
        expectation: RuntimeEstimate,
    ) -> None:
        super().__init__((), lambda task: task.scene)
        self._stages, self._names = stages, list(scenes)
        self._pipeline, self._roots, self._forced = pipeline, roots, forced
        self._limits, self._reporter, self._expectation = limits, reporter, expectation
        self._configs: dict[str, Section] = {}
        self._tallies = [_Tally() for _ in stages]
        # How many stages a scene has behind it, and how many shards of its next one are there, and not done.
        self._passed = dict.fromkeys(scenes, 0)
        self._shards, self._left = Counter[str](), Counter[str]()
        self._at_work: dict[tuple[str, int], Task] = {}
        self._ended: set[str] = set()
        self._spent: set[str] = set()
        self._errors: list[tuple[int, int, AerialDojoError]] = []
        self._told, self._most_at_work = 0, 0
        self._watch: Callable[[], None] = lambda: None
        ahead = self._names
        for number in range(len(stages)):
            ahead = self._enter(number, ahead)
        self._end(ahead)

    @property
    def alone(self) -> bool:
        """Whether there is never more than one task at a time."""
        ahead = {scene: passed for scene, passed in self._passed.items() if scene not in self._ended}
        in_parts = any(stage.in_parts for stage in self._stages[min(ahead.values(), default=0) :])
        return len(self) <= 1 and len(ahead) <= 1 and not (ahead and in_parts)

    @property
    def memory_mb(self) -> int:
        """What a process takes that goes through all stages."""
        return max(stage.memory_mb for stage in self._stages)

    @property
    def errors(self) -> list[AerialDojoError]:
        """What went wrong in an expected way, by stage and scene."""
        return [error for _, _, error in sorted(self._errors, key=lambda one: one[:2])]

    @property
    def of_one_stage(self) -> bool:
        """Whether the scenes go through a single stage."""
        return len(self._stages) == 1

    @property
    def label(self) -> str:
        """The stages in words."""
        return " to ".join(dict.fromkeys((self._stages[0].name, self._stages[-1].name)))

    def look(self) -> Overview:
        """Say how far the scenes are."""
        at_work = [f"{task.scene} {task.job.stage}{_part(task)}" for task in list(self._at_work.values())]
        known = self._expectation
        scenes = len(self._ended), len(self._names)
        return Overview(known.done_s, known.left_s, *scenes, at_work, self._most_at_work)

    def watched_by(self, watch: Callable[[], None]) -> None:
        """Have something called whenever a task is begun."""
        self._watch = watch

    def summaries(self) -> list[StageSummary]:
        """Return those of the stages that all scenes have got behind them since this was last asked."""
        told, self._told = self._told, min(self._passed.values(), default=len(self._stages))
        return [self._summary(number) for number in range(told, self._told)]

    def on_done(self, task: Task, outcome: Computed | AerialDojoError) -> None:
        """Hear what became of a task; the last one of a scene's stage brings those of its next."""
        scene, number = task.scene, self._passed[task.scene]
        tally, name = self._tallies[number], self._stages[number].name
        del self._at_work[scene, task.job.part]
        self._left[scene] -= 1
        if isinstance(outcome, BudgetSpent):
            self._spent.add(scene)
        elif isinstance(outcome, AerialDojoError):
            self._fail(number, scene, outcome)
        else:
            tally.summaries.append(outcome.summary)
            tally.computed += 1
            tally.seconds += outcome.seconds
            self._expectation.record(name, scene, 1.0 / self._shards[scene], outcome.seconds)
        if self._left[scene] or scene in self._ended:
            return
        self._passed[scene] += 1
        if scene in self._spent:
            self._end([scene])
            return
        # What was written, in whatever process, is to be found.
        self._roots.data.refresh()
        while self._passed[scene] < len(self._stages):
            if not self._enter(self._passed[scene], [scene]):
                return
        self._end([scene])

    def put_back(self, task: Task) -> None:
        """Take back a task whose process is gone; it is the next of its scene."""
        del self._at_work[task.scene, task.job.part]
        super().put_back(task)

    def _enter(self, number: int, scenes: list[str]) -> list[str]:
        """Look at scenes' shards of a stage; returns the scenes that have nothing to do there, and passes them on."""
        if not scenes:
            return []
        stage, tally, started = self._stages[number], self._tallies[number], time.monotonic()
        try:
            lot = self._lot(stage, scenes)
        except AerialDojoError as error:
            lot = Shards([], [], dict.fromkeys(scenes, error))
        tally.summaries += lot.fresh
        tally.tasks += len(lot.tasks)
        tally.seconds += time.monotonic() - started
        self._add(lot.tasks)
        for scene, why in lot.errors.items():
            self._fail(number, scene, why)
        shards = Counter(task.scene for task in lot.tasks)
        for scene in shards:
            self._shards[scene] = self._left[scene] = shards[scene]
        ahead = [scene for scene in scenes if scene not in shards and scene not in lot.errors]
        for scene in ahead:
            self._passed[scene] = number + 1
            self._expectation.drop(stage.name, scene)
        return ahead

    def _lot(self, stage: Stage, scenes: list[str]) -> Shards:
        """Find out what is to be computed of a stage, under one configuration for all scenes."""
        section, force = self._pipeline.section(stage.name), stage.name in self._forced
        here = (scenes, self._pipeline, self._roots, force)
        if stage.name not in self._configs:
            # What takes time to decide is not decided anew as long as nothing is to be computed.
            asked = not force and len(scenes) == len(self._names)
            for choice in stage.choices(section) if asked else ():
                lot = shards_of(stage, choice, *here, Reporter(quiet=True), self._limits)
                if lot.all_fresh:
                    self._configs[stage.name] = choice
                    return lot
            self._configs[stage.name] = stage.resolve_config(section, self._reporter.line)
        config = self._configs[stage.name]
        lot = shards_of(stage, config, *here, self._reporter, self._limits)
        if lot.tasks:
            check_memory(stage.name)
            stage.check(self._roots.data, self._names, config)
        return lot

    def _fail(self, number: int, scene: str, error: AerialDojoError) -> None:
        self._errors.append((number, self._names.index(scene), error))
        self._end([scene])

    def _end(self, scenes: Sequence[str]) -> None:
        self._ended.update(scenes)
        for scene in scenes:
            for stage in self._stages:
                self._expectation.drop(stage.name, scene)

    def _pop(self, scene: str) -> Task:
        task = super()._pop(scene)
        self._at_work[scene, task.job.part] = task
        self._most_at_work = max(self._most_at_work, len(self._at_work))
        self._watch()
        return task

    def _weight(self, scene: str) -> float:
        return sum(self._expectation.left(stage.name, scene) for stage in self._stages)

    def _worth_joining(self, scene: str) -> bool:
        stage = self._stages[self._passed[scene]]
        seconds = self._expectation.left(stage.name, scene) * len(self._scenes[scene]) / max(1, self._left[scene])
        return seconds >= _JOIN_S

    def _summary(self, number: int) -> StageSummary:
        stage, tally = self._stages[number], self._tallies[number]
        if tally.computed < tally.tasks:
            left = f"{tally.tasks - tally.computed:,} of {tally.tasks:,} shards are left"
            self._reporter.line(f"{stage.name}: the budget is spent, {left}; the same command continues from here")
        counts: Counter[str] = Counter()
        for summary in tally.summaries:
            counts.update(summary["counts"])
        return StageSummary(
            stage.name,
            sum(summary["rows_in"] for summary in tally.summaries),
            sum(summary["rows_out"] for summary in tally.summaries),
            counts,
            len(tally.summaries),
            tally.computed,
            tally.seconds,
        )


def _part(task: Task) -> str:
    return f" {task.job.part + 1}/{task.job.parts}" if task.job.parts > 1 else ""
