"""A part of the training data: trajectories of one scene, or extra views of it, and their rendering."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.observations import clip_depth, renderer_for
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of, reference_image
from aerialdojo_gen.learning.encoding import goal_picture, packed
from aerialdojo_gen.learning.geodesic import blocked_actions
from aerialdojo_gen.learning.index import Index, read_index
from aerialdojo_gen.learning.labels import odometry, to_body_frame
from aerialdojo_gen.learning.steps import Steps
from aerialdojo_gen.learning.words import goal_text
from aerialdojo_gen.planning.flight_space import flight_space
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot


@dataclass(frozen=True)
class DaggerRound:
    """A round of DAgger."""

    weights: Path  # Of the policy that flies
    sha256: str  # Of that file
    seed: int  # Of the draws
    round: int
    teacher_share: float  # Steps at which the teacher's action is flown


@dataclass(frozen=True)
class Exploration:
    """Extra views of a scene."""

    looks: int  # How many
    seed: int  # Of the random generator
    number: int
    target_split: str | None  # Side of the split by objects whose references are followed


@dataclass(frozen=True)
class Part:
    """Trajectories of one scene."""

    data: DataRoot
    splits: tuple[str, ...]  # Where they are found
    settings: tuple[str, ...]
    scene: str
    nav_ids: tuple[str, ...]
    sensors: Sensors
    size_px: int  # Edge of the goals' pictures
    renderer: str
    folder: Path  # Where to; named by what is in it
    dagger_round: DaggerRound | None = None  # None for the references
    exploration: Exploration | None = None  # Extra views instead of trajectories
    runs: tuple[str, ...] = ()  # Whose flights are followed in place of the references

    @property
    def label(self) -> str:
        """Name it in progress lines."""
        what = "looks" if self.exploration is not None else "references" if self.dagger_round is None else "flights"
        return f"{what} of {self.scene}"

    def __len__(self) -> int:
        """Return the number of trajectories, or of views."""
        return len(self.nav_ids) if self.exploration is None else self.exploration.looks

    def index(self) -> Index:
        """Read the trajectories."""
        found = read_index(self.data, Selection(self.splits, self.settings, (), (self.scene,)), runs=self.runs)
        wanted = set(self.nav_ids)
        return found.take(np.array([k for k, nav_id in enumerate(found.nav_id) if nav_id in wanted], np.int64))


def references(part: Part) -> Steps:
    """Replay the references and render every step."""
    index = part.index()
    flown = [index.poses_of(k) for k in range(len(index))]
    poses = np.concatenate(flown)
    goals = np.repeat(index.goal, index.steps, axis=0)
    return Steps(
        frames=pictures(part, poses), first=index.first, label=index.actions.astype(np.int64),
        odometry=np.concatenate([odometry(own) for own in flown]).astype(np.float32),
        offset=offsets(poses, goals), pose=poses.astype(np.float32), blocked=blocked_at(part, poses),
        **goals_of(part, index),
    )  # fmt: skip


def pictures(
    part: Part, poses: NDArray[np.float64], on_instances: Callable[[int, NDArray[np.int32]], None] | None = None
) -> NDArray[np.uint8]:
    """Render poses, (n, views, H, W, 4) uint8; hands on which instances they show, with the first of these poses."""
    s = part.sensors
    out = np.empty((len(poses), len(s.views), part.size_px, part.size_px, 4), np.uint8)
    if s.blind:
        return out
    context = open_scene(*mesh_of(part.data, part.scene), SEVERAL)
    renderer = renderer_for(context.scene, part.renderer)
    # In chunks, to bound memory.
    for k in range(0, len(poses), 512):
        own = out[k : k + 512]
        instance = None if on_instances is None else np.empty(own.shape[:-1], np.int32)
        rgb, depth_m = renderer.render_bodies(s.camera, poses[k : k + 512], s.views, instance)
        own[:] = packed(rgb, clip_depth(depth_m, s), s)
        if on_instances is not None and instance is not None:
            on_instances(k, instance)
    return out


def blocked_at(part: Part, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Blocked actions at poses (n, 4): (n, 16) bool."""
    space = flight_space(*mesh_of(part.data, part.scene), Embodiment().radius_m)
    collides, refused, _ = blocked_actions(space, poses)
    return collides | refused


def offsets(poses: NDArray[np.float64], goals: NDArray[np.float64]) -> NDArray[np.float32]:
    """Goals (n, 3) in the frames of bodies (n, 4): ahead, left, up, metres."""
    return to_body_frame(poses, goals).astype(np.float32)


def goals_of(part: Part, index: Index) -> dict[str, Any]:
    """Read each trajectory's goal as text and image: fields of `Steps`."""
    names = [index.goal_columns[name] for name in ("target_name", "landmark", "direction", "description")]
    text = [
        [goal_text(str(n), str(m), str(d), more) for more in (None, said)]
        for n, m, d, said in zip(*names, strict=True)
    ]
    ids = index.goal_columns["reference_image_id"]
    known = sorted({one for one in ids if one is not None})
    place = {one: k for k, one in enumerate(known)}
    shown = [goal_picture(reference_image(part.data, part.scene, one), part.size_px) for one in known]
    return {
        "text": np.array(text, np.str_).reshape(len(index), 2),
        "image": np.array([-1 if one is None else place[one] for one in ids], np.int64),
        "semantic": np.array([said is not None for said in names[3]], np.bool_),
        "images": np.array(shown, np.uint8).reshape(-1, part.size_px, part.size_px, 4),
        "nav_id": np.array(index.nav_id, np.str_),
        "scene": np.full(len(index), part.scene),
    }


def goal_poses(part: Part, index: Index) -> NDArray[np.float64]:
    """Read goals with the yaw that the references end with: (n, 4) float64, the planner's."""
    yaw: dict[str, float] = {}
    for side in ("train", "test"):
        rows = store.read_stored(part.data, f"routes/{side}", part.scene, ("nav_id", "goal_yaw_rad"))
        yaw |= dict(zip(rows["nav_id"].to_pylist(), rows["goal_yaw_rad"].to_pylist(), strict=True))
    return np.column_stack([index.goal, [yaw[nav_id] for nav_id in index.nav_id]])
