"""Extra views of a scene: images near its references in random directions, with the objects that they show.

Localization and the patch classifier are trained on them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.benchmark.observations import renderer_for
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of
from aerialdojo_gen.benchmark.viewpoints import nodes_of
from aerialdojo_gen.learning.encoding import PATCH_PX, in_patches, packed
from aerialdojo_gen.learning.index import Index, read_index
from aerialdojo_gen.learning.parts import Exploration, Part, blocked_at
from aerialdojo_gen.learning.pictures import clip_depth
from aerialdojo_gen.learning.steps import Steps
from aerialdojo_gen.planning.flight_space import FlightSpace, flight_space
from aerialdojo_gen.rendering.bodies import draw_bodies
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
    """Render extra views of a part's scene: episodes of one step each, without goals and labels.

    Positions are those of references of all settings, moved by up to 3 m in a random direction until an obstacle:
    what a policy sees that has left the route. Only targets of the chosen side of the split are named.
    """
    index = read_index(part.data, Selection(part.splits, (), (), (part.scene,)), exploration.target_split)
    draw = rng.generator(exploration.seed, "survey", part.scene, exploration.number)
    at = np.sort(draw.integers(int(index.steps.sum()), size=exploration.looks))
    trajectory = np.searchsorted(index.first, at, side="right") - 1
    poses = np.empty((exploration.looks, 4))
    for k in np.unique(trajectory):
        rows = trajectory == k
        poses[rows] = index.poses_of(int(k))[at[rows] - index.first[k]]
    poses[:, 3] = draw.uniform(-np.pi, np.pi, exploration.looks)
    poses[:, :3] = _offset_places(
        flight_space(*mesh_of(part.data, part.scene), Embodiment().radius_m), poses[:, :3], draw
    )
    scene = open_scene(*mesh_of(part.data, part.scene), SEVERAL).scene
    names, number = _named(part, index, scene)
    frames, shown = _render_patches(part, scene, poses, number)
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


def _render_patches(
    part: Part, scene: Scene, poses: NDArray[np.float64], number: NDArray[np.int16]
) -> tuple[NDArray[np.uint8], NDArray[np.int16]]:
    """Render poses, (n, views, H, W, 4), and label each patch with its object, (n, patches)."""
    s = part.sensors
    renderer = renderer_for(scene, part.renderer)
    frames = np.empty((len(poses), len(s.views), part.size_px, part.size_px, 4), np.uint8)
    shown = np.empty((len(poses), len(s.views) * (part.size_px // PATCH_PX) ** 2), np.int16)
    # In chunks, to bound memory.
    for begin in range(0, len(poses), 512):
        own = poses[begin : begin + 512]
        instance = np.empty((len(own), len(s.views), part.size_px, part.size_px), np.int32)
        rgb, depth_m = draw_bodies(renderer, s.camera, own, s.views, instance)
        frames[begin : begin + 512] = packed(rgb, clip_depth(depth_m, s), s)
        shown[begin : begin + 512] = [patch_labels(one) for one in number[instance]]
    return frames, shown


def patch_labels(number: NDArray[np.int16]) -> NDArray[np.int16]:
    """Label each patch with the object that most of its pixels show: (views, H, W) to (patches,).

    `UNNAMED` where that is fewer than a quarter of them, or an object that must not be named.
    """
    pixels = in_patches(number)
    out = np.full(len(pixels), NOTHING, np.int16)
    some = np.flatnonzero((pixels != NOTHING).any(axis=1))
    own = pixels[some]
    alike = (own[:, :, None] == own[:, None, :]).sum(axis=2) * (own != NOTHING)
    most = alike.argmax(axis=1)
    found = own[np.arange(len(own)), most]
    out[some] = np.where(alike.max(axis=1, initial=0) >= _MIN_PX, found, UNNAMED)
    return out
