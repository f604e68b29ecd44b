"""Looks about in a scene: pictures near where its references lead, turned at random, and what is seen on them.

A map of the scene is learned from them, and what objects look like.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.config.sections import Embodiment
from aerialdojo_gen.benchmark.observations import drawing
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of
from aerialdojo_gen.benchmark.viewpoints import nodes_of
from aerialdojo_gen.learning.encoding import PATCH_PX, in_patches, packed
from aerialdojo_gen.learning.index import Index, read_index
from aerialdojo_gen.learning.parts import Part, Survey, hindered
from aerialdojo_gen.learning.pictures import within
from aerialdojo_gen.learning.steps import Steps
from aerialdojo_gen.planning.flight_space import FlightSpace, flight_space
from aerialdojo_gen.rendering.bodies import draw_bodies
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store import shards as store

# Farthest that a look is from where a reference leads, metres.
_STRAY_M = 3.0
# What a patch shows, where it is no object that may be named: nothing that has a name, or something untold.
NOTHING, UNTOLD = -1, -2
# Pixels of a patch that an object takes at least to be what the patch shows.
_LEAST_PX = PATCH_PX**2 // 4


def surveyed(part: Part, survey: Survey) -> Steps:
    """Look about in a part's scene: episodes of one step each, without goals and labels.

    From places of references of all settings the body flies off by up to 3 m to any side, as far as nothing is in its
    way, and turns: what is seen there a policy may see that has strayed. Of the objects that are seen those are named
    that the survey's side of the split has as targets.
    """
    index = read_index(part.data, Selection(part.splits, (), (), (part.scene,)), survey.target_split)
    draw = rng.generator(survey.seed, "survey", part.scene, survey.number)
    at = np.sort(draw.integers(int(index.steps.sum()), size=survey.looks))
    trajectory = np.searchsorted(index.first, at, side="right") - 1
    poses = np.empty((survey.looks, 4))
    for k in np.unique(trajectory):
        rows = trajectory == k
        poses[rows] = index.poses_of(int(k))[at[rows] - index.first[k]]
    poses[:, 3] = draw.uniform(-np.pi, np.pi, survey.looks)
    poses[:, :3] = _strayed(flight_space(*mesh_of(part.data, part.scene), Embodiment().radius_m), poses[:, :3], draw)
    scene = open_scene(*mesh_of(part.data, part.scene), SEVERAL).scene
    names, number = _named(part, index, scene)
    frames, shown = _looked(part, scene, poses, number)
    n, none = survey.looks, np.zeros(survey.looks, np.int64)
    return Steps(
        frames=frames, first=np.arange(n + 1), label=none,
        odometry=np.zeros((n, 4), np.float32), offset=np.zeros((n, 3), np.float32),
        pose=poses.astype(np.float32), blocked=hindered(part, poses),
        text=np.full((n, 2), ""), image=none - 1,
        semantic=np.zeros(n, np.bool_), images=np.zeros((0, part.size_px, part.size_px, 4), np.uint8),
        nav_id=np.full(n, ""), scene=np.full(n, part.scene), shown=shown, names=np.array(names, np.str_),
    )  # fmt: skip


def _strayed(space: FlightSpace, places: NDArray[np.float64], draw: np.random.Generator) -> NDArray[np.float64]:
    """Fly off from places (n, 3), each to a side and by a length of its own, up to what is in the way."""
    aside = draw.normal(size=places.shape)
    aside *= (draw.uniform(0.0, _STRAY_M, len(places)) / np.linalg.norm(aside, axis=1))[:, None]
    out = places.copy()
    for k, (here, there) in enumerate(zip(places.tolist(), (places + aside).tolist(), strict=True)):
        out[k], _, _ = space.fly(tuple(here), tuple(there))
    return out


def _named(part: Part, index: Index, scene: Scene) -> tuple[list[str], NDArray[np.int16]]:
    """Targets' names, and by instance of the scene which of them it is; the last entry is that of no instance."""
    wanted = dict(zip(index.nav_id, index.told["target_name"], strict=True))
    names: dict[int, str] = {}
    for side in ("train", "test"):
        rows = store.read_stored(part.data, f"routes/{side}", part.scene, ("nav_id", "target_object_id")).to_pylist()
        names |= {row["target_object_id"]: str(wanted[row["nav_id"]]) for row in rows if row["nav_id"] in wanted}
    place = {instance.node: k for k, instance in enumerate(scene.instances)}
    number = np.full(len(scene.instances) + 1, NOTHING, np.int16)
    known = sorted(names)
    for object_id, node in nodes_of(part.data, part.scene).items():
        number[place[node]] = known.index(object_id) if object_id in names else UNTOLD
    return [names[object_id] for object_id in known], number


def _looked(
    part: Part, scene: Scene, poses: NDArray[np.float64], number: NDArray[np.int16]
) -> tuple[NDArray[np.uint8], NDArray[np.int16]]:
    """Draw what is seen at poses, (n, views, H, W, 4), and say which object each patch shows, (n, patches)."""
    s = part.sensors
    renderer = drawing(scene, part.renderer)
    frames = np.empty((len(poses), len(s.views), part.size_px, part.size_px, 4), np.uint8)
    shown = np.empty((len(poses), len(s.views) * (part.size_px // PATCH_PX) ** 2), np.int16)
    # In pieces: floats take as much again.
    for begin in range(0, len(poses), 512):
        own = poses[begin : begin + 512]
        instance = np.empty((len(own), len(s.views), part.size_px, part.size_px), np.int32)
        rgb, depth_m = draw_bodies(renderer, s.camera, own, s.views, instance)
        frames[begin : begin + 512] = packed(rgb, within(depth_m, s), s)
        shown[begin : begin + 512] = [patches_of(one) for one in number[instance]]
    return frames, shown


def patches_of(number: NDArray[np.int16]) -> NDArray[np.int16]:
    """Say which object most pixels of each patch show: (views, H, W) to (patches,).

    At least a quarter of them; where fewer do, or where it is one that may not be named, that is not told.
    """
    pixels = in_patches(number)
    out = np.full(len(pixels), NOTHING, np.int16)
    some = np.flatnonzero((pixels != NOTHING).any(axis=1))
    own = pixels[some]
    alike = (own[:, :, None] == own[:, None, :]).sum(axis=2) * (own != NOTHING)
    most = alike.argmax(axis=1)
    found = own[np.arange(len(own)), most]
    out[some] = np.where(alike.max(axis=1, initial=0) >= _LEAST_PX, found, UNTOLD)
    return out
