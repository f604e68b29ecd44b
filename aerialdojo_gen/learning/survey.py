"""Looks about in a scene: pictures from where its references lead, turned at random. A map is learned from them."""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.common import rng
from aerialdojo_gen.learning.collect import Part, Survey, pictures
from aerialdojo_gen.learning.index import read_index
from aerialdojo_gen.learning.steps import Steps


def surveyed(part: Part, survey: Survey) -> Steps:
    """Look about in a part's scene: episodes of one step each, without goals and labels.

    The places are those of references of all settings: a body that turns where it is touches nothing, so that every
    look is one that a policy may have.
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
    n, none = survey.looks, np.zeros(survey.looks, np.int64)
    return Steps(
        frames=pictures(part, poses), first=np.arange(n + 1), label=none, previous=none,
        odometry=np.zeros((n, 4), np.float32), offset=np.zeros((n, 3), np.float32),
        pose=poses.astype(np.float32), tokens=np.zeros((n, 2, part.length), np.int64), image=none - 1,
        semantic=np.zeros(n, np.bool_), images=np.zeros((0, part.size_px, part.size_px, 4), np.uint8),
        nav_id=np.full(n, ""), scene=np.full(n, part.scene),
    )  # fmt: skip
