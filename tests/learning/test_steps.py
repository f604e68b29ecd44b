"""Flown episodes of several parts, as they are learned from: every step keeps its own picture, label and goal."""

import numpy as np
import pytest

from aerialdojo_gen.learning.steps import Pool, Steps, read_steps
from aerialdojo_gen.learning.words import Vocabulary

SCENES = ("U_A_0", "U_B_0")
# Steps of the episodes of each part.
LENGTHS = ((2, 3), (4,), (1, 2, 3))
WORDS = ("red", *(f"thing{number}{k}" for number, lengths in enumerate(LENGTHS) for k in range(len(lengths))))


def part(number: int, lengths: tuple[int, ...], begin: int) -> Steps:
    """A part whose every value tells of which step or episode it is, and of which part."""
    n, marks = len(lengths), begin + np.arange(sum(lengths))
    names = [f"thing{number}{k}" for k in range(n)]
    return Steps(
        frames=np.tile(marks[:, None, None, None, None], (1, 1, 2, 2, 4)).astype(np.uint8),
        first=np.concatenate([[0], np.cumsum(lengths)]),
        label=marks % 16,
        odometry=np.repeat(marks[:, None], 4, axis=1).astype(np.float32),
        offset=np.repeat(marks[:, None], 3, axis=1).astype(np.float32),
        pose=np.repeat(-marks[:, None], 4, axis=1).astype(np.float32),
        blocked=np.repeat(marks[:, None] % 2 == 0, 16, axis=1),
        text=np.array([[name, f"{name} red"] for name in names]),
        # The last episode of a part has no picture, the first none but that.
        image=np.array([*range(n - 1), -1]) if n > 1 else np.array([0]),
        semantic=np.arange(n) != 0,
        images=np.tile((10 * number + np.arange(n))[:, None, None, None], (1, 2, 2, 4)).astype(np.uint8),
        nav_id=np.array([f"nav{number}{k}" for k in range(n)]),
        scene=np.array([SCENES[(number + k) % 2] for k in range(n)]),
        shown=np.repeat((marks[:, None] % 2).astype(np.int16) - 1, 3, axis=1),
        names=np.array([f"name{number}"]),
    )


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    folder, begin, parts = tmp_path_factory.mktemp("steps"), 0, []
    for number, lengths in enumerate(LENGTHS):
        part(number, lengths, begin).write(folder / str(number))
        begin += sum(lengths)
        parts.append(read_steps(folder / str(number)))
    return Pool(parts, SCENES, Vocabulary(WORDS, 3))


def test_steps_are_numbered_through_all_parts(pool):
    lengths = [n for part in LENGTHS for n in part]
    assert (len(pool), pool.n_steps) == (len(lengths), sum(lengths))
    assert pool.lengths.tolist() == lengths
    rows = np.random.default_rng(0).permutation(pool.n_steps)
    assert pool.frames(rows)[:, 0, 0, 0, 0].tolist() == rows.tolist()
    pose, scene, blocked = pool.places(rows)
    assert pose[:, 0].tolist() == (-rows).tolist()
    assert blocked[:, 5].tolist() == (rows % 2 == 0).tolist()
    scenes = np.repeat([(number + k) % 2 for number, part in enumerate(LENGTHS) for k in range(len(part))], lengths)
    assert scene.tolist() == scenes[rows].tolist()
    # Names are numbered through too; -1 stays -1.
    of_part = np.repeat(np.arange(len(LENGTHS)), [sum(part) for part in LENGTHS])
    assert pool.shown(rows)[:, 0].tolist() == np.where(rows % 2, of_part[rows], -1).tolist()
    assert pool.names == ["name0", "name1", "name2"]


@pytest.mark.parametrize("by_image", [True, False])
def test_a_batch_has_each_episodes_own_steps_and_goal(pool, by_image):
    episodes = np.array([5, 2, 0, 4, 1, 3])
    batch = pool.batch(episodes, np.full(6, by_image))
    assert batch["mask"].sum(axis=1).tolist() == pool.lengths[episodes].tolist()
    for i, k in enumerate(episodes.tolist()):
        steps = np.arange(pool.first[k], pool.first[k + 1])
        assert batch["label"][i, : len(steps)].tolist() == (steps % 16).tolist()
        assert batch["odometry"][i, : len(steps), 0].tolist() == steps.tolist()
        assert not batch["odometry"][i, len(steps) :].any()
        number, own = divmod(int(pool.nav_id[k][3:]), 10)
        alone, last = len(LENGTHS[number]) == 1, own == len(LENGTHS[number]) - 1
        # The first of a part has no semantic instance, the last no picture unless it is alone.
        shown = (by_image or own == 0) and (alone or not last)
        assert batch["goal_by_image"][i] == shown
        assert batch["images"][i, 0, 0, 0] == (10 * number + own if shown else 0)
        assert batch["scene"][i] == (number + own) % 2
        # A description goes with the words alone: it would tell what the picture shows.
        words = [WORDS[n - 2] for n in batch["tokens"][i].tolist() if n]
        assert words == [f"thing{number}{own}", *([] if shown else ["red"])]
