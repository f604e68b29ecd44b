"""Trajectories over several data directories, and over worlds from seeds that are made for them."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.worlds import make_worlds
from aerialdojo_gen.dataset.contents import prune_release
from aerialdojo_gen.learning import Trajectories

HOW = {"views": ("front",), "size": (24, 16), "goal": ("text", "image"), "privileged": ("pose", "goal_distance_m")}


def alike(a, b) -> bool:
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


@pytest.fixture(scope="module")
def halves(smoke, tmp_path_factory):
    """The smoke run's two scenes, a data directory each, the last one first."""
    found = [tmp_path_factory.mktemp("halves") / scene for scene in ("U_Courtyard_1", "U_Courtyard_0")]
    for half in found:
        for part in ("release", "meshes"):
            shutil.copytree(smoke / part, half / part)
        prune_release(half, [half.name])
    return found


def test_two_directories_are_read_as_the_one_that_has_both(smoke, halves):
    whole, parts = (Trajectories(data, "all", limit=6, **HOW) for data in (smoke, halves))
    assert parts.index.scenes == ("U_Courtyard_0", "U_Courtyard_1")
    assert [root.url for root in parts.index.roots.values()] == [str(path) for path in reversed(halves)]
    assert parts.fingerprint == whole.fingerprint
    assert len(parts) == len(whole) > 0
    numbers = range(0, len(whole), max(1, len(whole) // 12))
    assert {nav_id[:13] for nav_id in whole.batch(numbers)["nav_id"]} == {"U_Courtyard_0", "U_Courtyard_1"}
    batch = parts.batch(numbers)
    assert alike(batch, whole.batch(numbers))
    assert batch["rgb"].std() > 10


def test_a_directory_in_which_nothing_fits_is_left_out_and_a_scene_in_two_refused(smoke, halves):
    own = Trajectories(halves, "id_train", views=())
    assert own.index.scenes == ("U_Courtyard_0",)
    assert own.fingerprint == Trajectories(halves[1], "id_train", views=()).fingerprint
    with pytest.raises(UsageError, match="no scene 'U_Nowhere_0'"):
        Trajectories(halves, scene="U_Nowhere_0")
    with pytest.raises(UsageError, match=r"scene U_Courtyard_0 is in .* and in .*: name one"):
        Trajectories([smoke, halves[1]], "all", views=())


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "either a release or worlds"),
        ({"release": "data", "worlds": "N_*"}, "either a release or worlds"),
        ({"release": "data", "num_worlds": 2}, "num_worlds: of worlds, not of a release"),
        ({"release": []}, "at least one data directory"),
        ({"worlds": "N_Nowhere"}, "N_Nowhere"),
        ({"worlds": "N_Snowfield", "num_worlds": 0}, "at least 1 world"),
    ],
)
def test_requests_that_make_no_sense(given, said):
    with pytest.raises(UsageError, match=said):
        Trajectories(**given)


@pytest.mark.slow
def test_worlds_are_made_once_and_read_as_one(worlds_cache):
    asked = {"worlds": "U_Alley", "num_worlds": 2, "n_objects": 6, "worlds_cache": worlds_cache}
    data = Trajectories(**asked, setting="base", **HOW)
    names = ("U_Alley-1000", "U_Alley-1001")
    assert data.index.scenes == names
    made = {path: path.stat().st_mtime_ns for path in worlds_cache.glob("*/*/data/release/**/*.parquet")}
    folders = make_worlds("U_Alley", num_worlds=2, n_objects=6, folder=worlds_cache)
    assert [root.url for root in data.index.roots.values()] == [str(folder) for folder in folders]
    assert sorted(k for numbers in data.order(8, seed=2) for k in numbers) == [*range(len(data))]
    batch = data.batch(np.linspace(0, len(data) - 1, 8).astype(int))
    assert {nav_id.rpartition("-")[0] for nav_id in batch["nav_id"]} == set(names)
    assert batch["rgb"].reshape(8, -1).std(axis=1).min() > 1
    assert np.isfinite(batch["goal_distance_m"]).all()
    for name, folder in zip(names, folders, strict=True):
        alone = Trajectories(folder, setting="base", vocabulary=data.vocabulary, **HOW)
        own = [k for k in range(len(data)) if data.index.sources[data.place(k)[0]][1] == name]
        assert len(own) == len(alone)
        assert alike(data.batch(own[:5]), alone.batch(range(5)))
    assert Trajectories(**asked, setting="base", **HOW).fingerprint == data.fingerprint
    assert {path: path.stat().st_mtime_ns for path in made} == made
