"""Extra views of a scene, for localization and the patch classifier: near its references, with what they show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.benchmark.flight import nodes_of
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of
from aerialdojo_gen.learning.encoding import PATCH_PX, in_patches
from aerialdojo_gen.learning.index import Index, read_index
from aerialdojo_gen.learning.parts import Exploration, Part, blocked_at, pictures
from aerialdojo_gen.learning.steps import Steps
from aerialdojo_gen.planning.flight_space import FlightSpace, flight_space
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store import shards as store

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
    mesh = mesh_of(part.data, part.scene)
    poses[:, :3] = _offset_places(flight_space(*mesh, Embodiment().radius_m), poses[:, :3], draw)
    scene = open_scene(*mesh, SEVERAL).scene
    names, number = _named(part, index, scene)
    shown = np.empty((len(poses), len(part.sensors.views) * (part.size_px // PATCH_PX) ** 2), np.int16)

    def label(first: int, instance: NDArray[np.int32]) -> None:
        shown[first : first + len(instance)] = [patch_labels(one) for one in number[instance]]

    frames = pictures(part, poses, label)
    n, none = exploration.looks, np.zeros(exploration.looks, np.int64)
    return Steps(
        frames=frames, first=np.arange(n + 1), label=none,
        odometry=np.zeros((n, 4), np.float32), offset=np.zeros((n, 3), np.float32),
        pose=poses.astype(np.float32), blocked=blocked_at(part, poses),
        text=np.full((n, 2), ""), image=none - 1,
        semantic=np.zeros(n, np.bool_), images=np.zeros((0, part.size_px, part.size_px, 4), np.uint8),
        nav_id=np.full(n, ""), scene=np.full(n, part.scene), shown=shown, names=np.array(names, np.str_),
    )  # fmt: skip


def _offset_places(space: FlightSpace, places: NDArray[np.float64], draw: np.random.Generator) -> NDArray[np.float64]:
    """Move places (n, 3) by random offsets, up to the first obstacle."""
    aside = draw.normal(size=places.shape)
    aside *= (draw.uniform(0.0, _MAX_OFFSET_M, len(places)) / np.linalg.norm(aside, axis=1))[:, None]
    out = places.copy()
    for k, (here, there) in enumerate(zip(places.tolist(), (places + aside).tolist(), strict=True)):
        out[k], _, _ = space.fly(tuple(here), tuple(there))
    return out


def _named(part: Part, index: Index, scene: Scene) -> tuple[list[str], NDArray[np.int16]]:
    """Targets' names, and each instance's index into them; the last entry stands for no instance."""
    wanted = dict(zip(index.nav_id, index.goal_columns["target_name"], strict=True))
    names: dict[int, str] = {}
    for side in ("train", "test"):
        rows = store.read_stored(part.data, f"routes/{side}", part.scene, ("nav_id", "target_object_id")).to_pylist()
        names |= {row["target_object_id"]: str(wanted[row["nav_id"]]) for row in rows if row["nav_id"] in wanted}
    place = {instance.node: k for k, instance in enumerate(scene.instances)}
    number = np.full(len(scene.instances) + 1, NOTHING, np.int16)
    known = sorted(names)
    for object_id, node in nodes_of(part.data, part.scene).items():
        number[place[node]] = known.index(object_id) if object_id in names else UNNAMED
    return [names[object_id] for object_id in known], number


def patch_labels(number: NDArray[np.int16]) -> NDArray[np.int16]:
    """Label patches with the object that most of a quarter of their pixels show: (views, H, W) to (patches,)."""
    pixels = in_patches(number)
    out = np.full(len(pixels), NOTHING, np.int16)
    some = np.flatnonzero((pixels != NOTHING).any(axis=1))
    own = pixels[some]
    alike = (own[:, :, None] == own[:, None, :]).sum(axis=2) * (own != NOTHING)
    most = alike.argmax(axis=1)
    found = own[np.arange(len(own)), most]
    out[some] = np.where(alike.max(axis=1, initial=0) >= _MIN_PX, found, UNNAMED)
    return out
