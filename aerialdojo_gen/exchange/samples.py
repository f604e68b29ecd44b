"""Trajectories with pictures, as the exports for learning write them: which, in what parts, and what a part shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.observations import renderer_name
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of, reference_image, select
from aerialdojo_gen.learning.index import Index, read_index
from aerialdojo_gen.learning.pictures import Frames, RecordedFrames, RenderedFrames, Source, resized
from aerialdojo_gen.learning.trajectories import SOURCES, recorded_alone
from aerialdojo_gen.rendering.sample import choose_trajectories
from aerialdojo_gen.store.root import DataRoot

GOALS = ("text", "image")
# What a task says in words where its goal is a picture alone: the description would say what the picture shows.
IMAGE_TASK = "Fly to the object that the goal picture shows."
_SENSORS = Sensors(("front",), width=128, height=128)
# Pixels of all views that are held at a time.
_PIXELS = 1 << 22


@dataclass(frozen=True)
class ExportOptions:
    """What is exported."""

    splits: tuple[str, ...] = ()  # As in `aerialdojo_gen.benchmark.tasks.Selection`
    settings: tuple[str, ...] = ()
    scenes: tuple[str, ...] = ()
    limit: int = 0  # Trajectories of each scene and each setting, drawn as `render` draws them; 0 for all
    seed: int = 0  # Of that draw
    sensors: Sensors = _SENSORS
    goal: tuple[str, ...] = ("text",)  # Of `GOALS`
    source: str = "render"  # As for `aerialdojo_gen.learning.trajectories.Trajectories`
    renderer: str = "auto"  # Resolved here: it may be another one in another process; empty for recordings
    jpeg_quality: int = 0  # Of the pictures in shards, 1 to 100; 0 for PNG
    runs: tuple[str, ...] = ()  # Whose successful flights are exported in place of the references

    def __post_init__(self) -> None:
        """Refuse what there is not; write out the splits and the renderer's name."""
        if self.limit < 0:
            raise UsageError(f"a limit is 0, for all, or more, not {self.limit}")
        object.__setattr__(self, "renderer", "" if self.source == "recordings" else renderer_name(self.renderer))
        object.__setattr__(self, "splits", Selection(self.splits).splits)
        check_known("no goal", self.goal, GOALS)
        check_known("no source", [self.source], SOURCES)
        if not self.goal:
            raise UsageError(f"a goal is given by {' or '.join(GOALS)}: name one")
        if not self.sensors.views or not (self.sensors.rgb or self.sensors.depth):
            raise UsageError("nothing is seen without a view: name one of front, left, right, down")
        if self.runs and self.source != "render":
            raise UsageError(f"recordings are of the references: --run goes with --source render, not {self.source}")
        if not 0 <= self.jpeg_quality <= 100:
            raise UsageError(f"a JPEG's quality is from 1 to 100, or 0 for PNG, not {self.jpeg_quality}")


@dataclass(frozen=True, eq=False)
class Part:
    """Trajectories of one scene that are written together."""

    number: int  # From 0; files are called by it
    index: Index  # Its trajectories, of one scene
    settings: list[str]  # Of every trajectory
    splits: list[str]
    tasks: NDArray[np.int64]  # (n,) int64; number of every trajectory's text
    texts: list[str]  # Its goal in words
    first_episode: int  # How many trajectories and steps all parts before it have
    first_frame: int

    @property
    def scene(self) -> str:
        """Name of its scene."""
        return self.index.scenes[0]

    @property
    def label(self) -> str:
        """Name it in messages."""
        return f"part {self.number} of {self.scene}"

    @property
    def frames(self) -> int:
        """How many steps it has, each seen in every view."""
        return int(self.index.first[-1])

    def cut(self, trajectories: int, steps: int) -> Part:
        """Keep the first trajectories, and of each the first steps: a sample to measure."""
        few = self.index.take(np.arange(min(trajectories, len(self.index))))
        return replace(self, index=replace(few, routes=[actions[:steps] for actions in few.routes]))


def plan_parts(root: DataRoot, options: ExportOptions, frames_a_part: int) -> list[Part]:
    """Choose the trajectories, and cut them into parts."""
    modalities = ("image",) if options.goal == ("image",) else ()
    selection = Selection(options.splits, options.settings, modalities, options.scenes)
    index = read_index(root, selection, runs=options.runs)
    facts = select(root, selection).select(["nav_id", "scene", "setting", "partition", "subset"]).to_pylist()
    facts_of = {row["nav_id"]: row for row in facts}
    chosen = index.take(_chosen(index, facts_of, options))
    if options.source != "recordings":
        for scene in chosen.scenes:
            mesh_of(root, scene)  # a scene without a mesh is named before the first picture
    else:
        chosen = recorded_alone(chosen, options.sensors, "--source render")
    texts = [IMAGE_TASK] * len(chosen) if modalities else chosen.goal_texts
    number = {text: k for k, text in enumerate(dict.fromkeys(texts))}
    parts: list[Part] = []
    for rows in _cuts(chosen, frames_a_part):
        own, goals = [facts_of[chosen.nav_id[k]] for k in rows], [texts[k] for k in rows]
        parts.append(Part(
            len(parts), chosen.take(rows), [row["setting"] for row in own],
            [f"{row['partition'].lower()}_{row['subset']}" for row in own],
            np.array([number[text] for text in goals], np.int64), goals, int(rows[0]), int(chosen.first[rows[0]]),
        ))  # fmt: skip
    return parts


def _chosen(index: Index, facts_of: dict[str, dict[str, str]], options: ExportOptions) -> NDArray[np.int64]:
    if not options.limit:
        return np.arange(len(index))
    taken: set[str] = set()
    for scene in index.scenes:
        rows = [facts_of[nav_id] for nav_id in index.nav_id if facts_of[nav_id]["scene"] == scene]
        taken.update(choose_trajectories(rows, options.limit, options.seed))
    return np.flatnonzero([nav_id in taken for nav_id in index.nav_id])


def _cuts(index: Index, frames_a_part: int) -> Iterator[NDArray[np.int64]]:
    begin = 0
    for k in range(1, len(index) + 1):
        whole = k == len(index) or index.first[k] - index.first[begin] >= frames_a_part
        if whole or index.scene[k] != index.scene[begin]:
            yield np.arange(begin, k)
            begin = k


class SampleFrames:
    """What the trajectories of a part see, and what their goals look like."""

    def __init__(self, root: DataRoot, part: Part, options: ExportOptions) -> None:
        self._root, self.part, self._sensors = root, part, options.sensors
        self._source: Source = RenderedFrames(part.index, options.sensors, options.renderer)
        if options.source != "render":
            self._source = RecordedFrames(part.index, options.sensors, self._source)

    def frames(self, k: int) -> Iterator[tuple[int, Frames]]:
        """Yield the pictures of trajectory k, some steps at a time, with the first of these steps."""
        s = self._sensors
        n = int(self.part.index.steps[k])
        size = max(1, _PIXELS // (len(s.views) * s.height * s.width))
        for begin in range(0, n, size):
            steps = np.arange(begin, min(begin + size, n))
            yield begin, self._source.frames(np.full(len(steps), k), steps)

    def goal(self, k: int) -> NDArray[np.uint8]:
        """Return trajectory k's goal picture, (H, W, 3) uint8, as large as the views'; black where there is none."""
        s = self._sensors
        named = self.part.index.goal_columns["reference_image_id"][k]
        if named is None:
            return np.zeros((s.height, s.width, 3), np.uint8)
        picture = reference_image(self._root, self.part.scene, named)
        shrinks = picture.shape[0] >= s.height and picture.shape[1] >= s.width
        return resized(picture, s, cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
