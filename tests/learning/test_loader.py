"""The order of epochs, and the loader: the same for any number of workers, resumable, clear when a worker dies."""

import os
import signal
import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerialdojo_gen.base.errors import MissingPackage, StoreError, UsageError
from aerialdojo_gen.learning import Loader, Trajectories
from aerialdojo_gen.learning.loader import Order

WITHOUT = "PyTorch is not installed: it is the extra 'train'"


@st.composite
def worlds(draw):
    scene = np.sort(draw(st.lists(st.integers(0, 3), min_size=1, max_size=40)))
    steps = draw(st.lists(st.integers(1, 30), min_size=len(scene), max_size=len(scene)))
    return np.array(scene), np.concatenate([[0], np.cumsum(steps)])


@settings(max_examples=80)
@given(worlds(), st.integers(1, 17), st.integers(1, 200), st.integers(1, 4), st.integers(0, 3))
def test_an_epoch_has_every_sample_once_and_goes_on_anywhere(world, size, block, streams, epoch):
    scene, first = world
    how = {"seed": 5, "epoch": epoch, "block": block, "streams": streams}
    batches = list(Order(scene, first, size, **how))
    assert sorted(n for batch in batches for n in batch) == list(range(first[-1]))
    assert [len(b) for b in batches[:-1]] == [size] * (len(batches) - 1)
    assert len(Order(scene, first, size, **how)) == len(batches)
    at = len(batches) // 2
    rest = Order(scene, first, size, start=at, **how)
    assert list(rest) == batches[at:]
    assert len(rest) == len(batches) - at
    full = list(Order(scene, first, size, drop_last=True, **how))
    assert full == [b for b in batches if len(b) == size]


def test_epochs_and_seeds_differ_and_a_worker_has_one_scene_open_as_long_as_a_block():
    """Batches of one stream change their scene once a block, not once a batch."""
    scene, first = np.repeat(np.arange(10), 100), np.arange(0, 1001 * 20, 20)
    orders = [list(Order(scene, first, 16, seed=s, epoch=e)) for s in (0, 1) for e in (0, 1)]
    assert len({str(order) for order in orders}) == 4
    assert next(iter(Order(scene, first, 100, shuffle=False))) == list(range(100))
    batches = list(Order(scene, first, 32, block=500, streams=2))
    for worker in (0, 1):
        own = [scene[np.searchsorted(first, np.array(b), side="right") - 1] for b in batches[worker::2]]
        changes = sum(int((np.diff(b) != 0).sum()) for b in own)
        switches = sum(a[-1] != b[0] for a, b in pairwise(own))
        assert changes + switches <= len(batches) * 32 / 500 + 20


@pytest.fixture(scope="module")
def data(smoke):
    return Trajectories(
        smoke, split="all", size=24, views=("front", "down"), limit=6, past=1, goal=("text", "tokens", "image")
    )


def alike(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


def test_a_loader_goes_on_within_an_epoch_and_with_the_next_which_is_another(data):
    broken, resumed = Loader(data, 16, seed=3), Loader(data, 16, seed=3)
    whole = list(Loader(data, 16, seed=3))
    assert len(whole) == len(broken)
    for k, _ in enumerate(broken):
        if k == 4:
            break
    state = broken.state_dict()
    assert (state["epoch"], state["batch"]) == (0, 5)
    resumed.load_state_dict(state)
    rest = list(resumed)
    assert len(rest) == len(whole) - 5
    assert all(alike(a, b) for a, b in zip(rest, whole[5:], strict=True))
    assert (resumed.epoch, resumed.batches_done) == (1, 0)
    later = list(resumed)
    assert resumed.epoch == 2
    assert len(later) == len(whole)
    assert [b["nav_id"] for b in later] != [b["nav_id"] for b in whole]


def test_a_state_of_another_loader_is_refused(smoke, data):
    state = Loader(data, 16).state_dict()
    other = Trajectories(smoke, split="all", size=32, limit=10)
    for loader, said, message in (
        (Loader(other, 16), state, f"its fingerprint is {data.fingerprint}, and here it is {other.fingerprint}"),
        (Loader(data, 8), state, "its batch_size is 16, and here it is 8"),
        (Loader(data, 16, block=64), state, r"its order is .*'block': 2048.*, and here it is .*'block': 64"),
        (Loader(data, 16), state | {"batch": 9999}, "no batch 9999"),
        (Loader(data, 16), {"epoch": 1}, "a loader's state has"),
    ):
        with pytest.raises(StoreError, match=message):
            loader.load_state_dict(said)


def test_without_torch_workers_name_the_extra(data, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.setitem(sys.modules, "torch.utils.data", None)
    for options in ({"workers": 2}, {"tensors": True}):
        with pytest.raises(MissingPackage, match=r"aerialdojo-gen\[train\]"):
            Loader(data, 16, **options)
    assert next(iter(Loader(data, 4)))["rgb"].shape == (4, 2, 2, 24, 24, 3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"batch_size": 0}, "batch_size is at least 1"),
        ({"workers": -1}, "0 or more workers"),
        ({"context": "thread"}, "not by 'thread'"),
        ({"streams": 0}, "streams is at least 1"),
    ],
)
def test_what_makes_no_sense_is_named(data, options, message):
    with pytest.raises(UsageError, match=message):
        Loader(data, **options)


def test_torchs_own_loader_takes_the_data_set(data):
    torch = pytest.importorskip("torch", reason=WITHOUT)
    from aerialdojo_gen.learning import collate

    batches = list(torch.utils.data.DataLoader(data, batch_sampler=data.order(16, seed=3), collate_fn=collate))
    assert all(alike(a, b) for a, b in zip(batches, Loader(data, 16, seed=3), strict=True))
    plain = next(iter(torch.utils.data.DataLoader(data, batch_size=4, shuffle=True)))
    assert plain["rgb"].shape == (4, 2, 2, 24, 24, 3)
    assert plain["action"].dtype == torch.int64
    assert len(plain["text"]) == 4


@pytest.mark.slow
@pytest.mark.kill
# PyTorch raises at the worker's end, wherever this process is: in a callback of Hypothesis Python only says so.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_spawned_worker_gives_what_this_process_gives_and_a_killed_one_ends_the_loader_with_its_cause(data):
    torch = pytest.importorskip("torch", reason=WITHOUT)
    from aerialdojo_gen.learning.loader import WorkerDied

    alone = list(Loader(data, 4, seed=3))
    loader = Loader(data, 4, seed=3, workers=1, tensors=True)
    batches = iter(loader)
    for expected in alone[:3]:
        batch = next(batches)
        assert isinstance(batch["rgb"], torch.Tensor)
        assert alike(batch, expected)
    # Nobody said how workers start: where this process has drawn they are not forked.
    assert loader._loading.multiprocessing_context.get_start_method() == "spawn"
    os.kill(loader._loading._iterator._workers[0].pid, signal.SIGKILL)
    with pytest.raises(WorkerDied, match="a worker of the loader died"):
        assert all(alike(a, b) for a, b in zip(batches, alone[3:], strict=True))
    state = loader.state_dict()
    assert 0 < state["batch"] < len(loader)
    rest = Loader(data, 4, seed=3)
    rest.load_state_dict(state)
    assert all(alike(a, b) for a, b in zip(rest, alone[state["batch"] :], strict=True))
