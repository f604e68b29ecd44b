"""A part of the training data: trajectories of one scene, or extra views of it, and their rendering."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.flight import nodes_of
from aerialdojo_gen.benchmark.observations import clip_depth, renderer_for
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of, reference_image
from aerialdojo_gen.learning.encoding import PATCH_PX, goal_picture, in_patches, packed
from aerialdojo_gen.learning.index import Index, read_index
from aerialdojo_gen.learning.labels import blocked_at, odometry, to_body_frame
from aerialdojo_gen.learning.steps import Steps
from aerialdojo_gen.learning.words import goal_text
from aerialdojo_gen.planning.flight_space import FlightSpace, flight_space
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
    sensors: Sensors  # Whose pictures are square, as are the goals'
    renderer: str
    folder: Path  # Where to; named by what is in it
    runs: tuple[str, ...] = ()  # Whose flights are followed in place of the references
    scene: str = ""  # Empty, as are the trajectories, where it stands for what parts have in common
    nav_ids: tuple[str, ...] = ()
    dagger_round: DaggerRound | None = None  # None for the references
    exploration: Exploration | None = None  # Extra views instead of trajectories

    @property
    def label(self) -> str:
        """Name it in progress lines."""
        what = "looks" if self.exploration is not None else "references" if self.dagger_round is None else "flights"
        return f"{what} of {self.scene}"

    def __len__(self) -> int:
        return len(self.nav_ids) if self.exploration is None else self.exploration.looks

    @property
    def image_shape(self) -> tuple[int, int, int]:
        """Of a picture with its depth, and of a goal's picture."""
        return self.sensors.height, self.sensors.width, 4

    @property
    def space(self) -> FlightSpace:
        """Where the body can be in the scene."""
        return flight_space(*mesh_of(self.data, self.scene), Embodiment().radius_m)

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
        offset=to_body_frame(poses, goals).astype(np.float32), pose=poses.astype(np.float32),
        blocked=blocked_at(part.space, poses), **goals_of(part, index),
    )  # fmt: skip


def pictures(
    part: Part, poses: NDArray[np.float64], on_instances: Callable[[int, NDArray[np.int32]], None] | None = None
) -> NDArray[np.uint8]:
    """Render poses, (n, views, H, W, 4) uint8; hands on which instances they show, with the first of these poses."""
    s = part.sensors
    out = np.empty((len(poses), len(s.views), *part.image_shape), np.uint8)
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


def goals_of(part: Part, index: Index) -> dict[str, Any]:
    """Read each trajectory's goal as text and image: fields of `Steps`."""
    names = [index.goal_columns[name] for name in ("target_name", "landmark", "direction", "description")]
    text = [
        [goal_text(name, landmark, direction, more) for more in (None, description)]
        for name, landmark, direction, description in zip(*names, strict=True)
    ]
    ids = index.goal_columns["reference_image_id"]
    image_ids = sorted({*ids} - {None})
    shown = [goal_picture(reference_image(part.data, part.scene, one), part.sensors.width) for one in image_ids]
    return {
        "text": np.array(text, np.str_).reshape(len(index), 2),
        "image": np.array([-1 if one is None else image_ids.index(one) for one in ids], np.int64),
        "semantic": np.array([said is not None for said in names[3]], np.bool_),
        "images": np.array(shown, np.uint8).reshape(-1, *part.image_shape),
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


# Largest distance of a view from a reference, metres.
_MAX_OFFSET_M = 3.0
# Labels of patches without a named object: nothing nameable, or an object that must not be named.
NOTHING, UNNAMED = -1, -2
# Smallest number of a patch's pixels for an object to be its label.
_MIN_PX = PATCH_PX**2 // 4


def collect_views(part: Part, exploration: Exploration) -> Steps:
    """Render extra views of a part's scene: episodes of one step each, without goals and labels."""
    index = read_index(part.data, Selection(part.splits, (), (), (part.scene,)), exploration.target_split)
    draw = rng.generator(exploration.seed, "survey", part.scene, exploration.number)
    at = np.sort(draw.integers(int(index.steps.sum()), size=exploration.looks))
    # From references of all settings, moved until an obstacle: what a policy sees that has left the route.
    trajectory = np.searchsorted(index.first, at, side="right") - 1
    poses = np.empty((exploration.looks, 4))
    for k in np.unique(trajectory):
        rows = trajectory == k
        poses[rows] = index.poses_of(int(k))[at[rows] - index.first[k]]
    poses[:, 3] = draw.uniform(-np.pi, np.pi, exploration.looks)
    # Aside at random, up to the first obstacle.
    aside, space = draw.normal(size=(exploration.looks, 3)), part.space
    aside *= (draw.uniform(0.0, _MAX_OFFSET_M, exploration.looks) / np.linalg.norm(aside, axis=1))[:, None]
    for pose, there in zip(poses, (poses[:, :3] + aside).tolist(), strict=True):
        pose[:3], _, _ = space.fly(tuple(pose[:3].tolist()), tuple(there))
    names, number = _named(part, index)
    shown = np.empty((len(poses), len(part.sensors.views) * (part.sensors.width // PATCH_PX) ** 2), np.int16)

    def label(first: int, instance: NDArray[np.int32]) -> None:
        shown[first : first + len(instance)] = [patch_labels(one) for one in number[instance]]

    frames = pictures(part, poses, label)
    n, none = exploration.looks, np.zeros(exploration.looks, np.int64)
    return Steps(
        frames=frames, first=np.arange(n + 1), label=none,
        odometry=np.zeros((n, 4), np.float32), offset=np.zeros((n, 3), np.float32),
        pose=poses.astype(np.float32), blocked=blocked_at(space, poses),
        text=np.full((n, 2), ""), image=none - 1,
        semantic=np.zeros(n, np.bool_), images=np.zeros((0, *part.image_shape), np.uint8),
        nav_id=np.full(n, ""), scene=np.full(n, part.scene), shown=shown, names=np.array(names, np.str_),
    )  # fmt: skip


def _named(part: Part, index: Index) -> tuple[list[str], NDArray[np.int16]]:
    """Targets' names, and each instance's index into them; the last entry stands for no instance."""
    wanted = dict(zip(index.nav_id, index.goal_columns["target_name"], strict=True))
    names: dict[int, str] = {}
    for side in ("train", "test"):
        rows = store.read_stored(part.data, f"routes/{side}", part.scene, ("nav_id", "target_object_id")).to_pylist()
        names |= {row["target_object_id"]: str(wanted[row["nav_id"]]) for row in rows if row["nav_id"] in wanted}
    instances = open_scene(*mesh_of(part.data, part.scene), SEVERAL).scene.instances
    place = {instance.node: k for k, instance in enumerate(instances)}
    number = np.full(len(instances) + 1, NOTHING, np.int16)
    targets = sorted(names)
    for object_id, node in nodes_of(part.data, part.scene).items():
        number[place[node]] = targets.index(object_id) if object_id in names else UNNAMED
    return [names[object_id] for object_id in targets], number


def patch_labels(number: NDArray[np.int16]) -> NDArray[np.int16]:
    """Label patches with the object that most of a quarter of their pixels show: (views, H, W) to (patches,)."""
    pixels = in_patches(number)
    out = np.full(len(pixels), NOTHING, np.int16)
    some = np.flatnonzero((pixels != NOTHING).any(axis=1))
    own = pixels[some]
    alike = (own[:, :, None] == own[:, None, :]).sum(axis=2) * (own != NOTHING)
    most = alike.argmax(axis=1)
    label = own[np.arange(len(own)), most]
    out[some] = np.where(alike.max(axis=1, initial=0) >= _MIN_PX, label, UNNAMED)
    return out
