"""Looks about in a scene: pictures near where its references lead, turned at random. A map is learned from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.benchmark.motion import FlightSpace, flight_space
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of
from aerialdojo_gen.common import rng
from aerialdojo_gen.config.sections import Embodiment
from aerialdojo_gen.learning.index import read_index
from aerialdojo_gen.learning.parts import Part, Survey, hindered, pictures
from aerialdojo_gen.learning.steps import Steps

# Farthest that a look is from where a reference leads, metres.
_STRAY_M = 3.0


def surveyed(part: Part, survey: Survey) -> Steps:
    """Look about in a part's scene: episodes of one step each, without goals and labels.

    From places of references of all settings the body flies off by up to 3 m to any side, as far as nothing is in its
    way, and turns: what is seen there a policy may see that has strayed.
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
    n, none = survey.looks, np.zeros(survey.looks, np.int64)
    return Steps(
        frames=pictures(part, poses), first=np.arange(n + 1), label=none,
        odometry=np.zeros((n, 4), np.float32), offset=np.zeros((n, 3), np.float32),
        pose=poses.astype(np.float32), blocked=hindered(part, poses),
        text=np.full((n, 2), ""), image=none - 1,
        semantic=np.zeros(n, np.bool_), images=np.zeros((0, part.size_px, part.size_px, 4), np.uint8),
        nav_id=np.full(n, ""), scene=np.full(n, part.scene),
    )  # fmt: skip


def _strayed(space: FlightSpace, places: NDArray[np.float64], draw: np.random.Generator) -> NDArray[np.float64]:
    """Fly off from places (n, 3), each to a side and by a length of its own, up to what is in the way."""
    aside = draw.normal(size=places.shape)
    aside *= (draw.uniform(0.0, _STRAY_M, len(places)) / np.linalg.norm(aside, axis=1))[:, None]
    out = places.copy()
    for k, (here, there) in enumerate(zip(places.tolist(), (places + aside).tolist(), strict=True)):
        out[k], _, _ = space.fly(tuple(here), tuple(there))
    return out
