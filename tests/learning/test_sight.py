"""What objects look like: learned before the rest and apart from it, and put to use where a place is not known."""

import numpy as np
import pytest
from support.trainings import assert_same_training, history, kill_at_first_checkpoint

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Rules
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.learning.index import read_index
from aerialdojo_gen.learning.recipe import load_recipe
from aerialdojo_gen.store.root import open_root

torch = pytest.importorskip("torch", reason="PyTorch is not installed: it is the extra 'train'")

from aerialdojo_gen.learning import checkpoints  # noqa: E402 - it needs torch
from aerialdojo_gen.learning.localization import UNIT_M  # noqa: E402
from aerialdojo_gen.learning.policy import Policy, network_of  # noqa: E402
from aerialdojo_gen.learning.search import Search  # noqa: E402
from aerialdojo_gen.learning.training import train  # noqa: E402

TEXT = """
name = "sight"
[data]
limit = 8
size_px = 32
validation_share = 0.0
settings = []
views = ["front", "left"]
looks = 150
[model]
channels = [16, 16, 32]
features = 32
word_features = 16
hidden = 32
[train]
epochs = 1
batch_steps = 64
looks = 16
checkpoint_s = 1e-3
[sight]
epochs = %d
batch_looks = 16
learning_rate = 1e-2
[dagger]
rounds = 0
"""


@pytest.fixture(scope="module")
def trained(smoke, cache, tmp_path_factory):
    """A training by its number of epochs of sight."""
    known = {}

    def make(epochs):
        if epochs not in known:
            folder = tmp_path_factory.mktemp(f"sight-{epochs}")
            (folder / "own.toml").write_text(TEXT % epochs)
            done = train(smoke, load_recipe(folder / "own.toml"), out=folder / "out", cache=cache, workers=1)
            known[epochs] = done.policy
        return known[epochs]

    return make


def test_patches_are_told_by_the_names_of_what_they_show(smoke, trained):
    rows = [row for row in history(trained(12).parent) if row["phase"] == -1]
    assert [row["epoch"] for row in rows] == list(range(12))
    assert rows[-1]["accuracy"] > max(0.6, rows[0]["accuracy"] + 0.1)
    _, about, _ = checkpoints.read(trained(12))
    index = read_index(open_root(smoke), Selection(("id_train",)))
    said = " ".join(index.goal_columns["target_name"]).lower().split()
    assert about.named
    assert set(about.named) <= set(said)


def test_what_is_seen_is_learned_apart_from_all_else(trained):
    """With it and without it the map and the choice are the same, to the bit."""
    without, with_it = (checkpoints.read(trained(epochs))[0] for epochs in (0, 12))
    assert not any(".sight." in name for name in without)
    assert {name for name in with_it if ".sight." not in name} == set(without)
    assert all(torch.equal(with_it[name], tensor) for name, tensor in without.items())


@pytest.mark.nightly
def test_killed_while_it_learns_to_see_it_goes_on_and_ends_the_same(smoke, cache, trained, tmp_path):
    file, out = tmp_path / "own.toml", tmp_path / "out"
    file.write_text(TEXT % 12)
    kill_at_first_checkpoint(file, smoke, out, cache)
    assert checkpoints.read(out / "checkpoint.safetensors")[2]["phase"] == -1
    assert not (out / "sight.safetensors").exists()
    done = train(smoke, load_recipe(file), out=out, cache=cache, workers=1)
    assert_same_training(trained(12), done.policy)


class CountedSearch(Search):
    """The search, with its calls counted."""

    looked = led = 0

    def observe(self, log_chances, pictures, odometry):
        CountedSearch.looked += 1
        assert np.allclose(np.exp(log_chances).sum(axis=1), 1.0, atol=1e-4)
        super().observe(log_chances, pictures, odometry)

    def towards(self, odometry, remaining):
        CountedSearch.led += 1
        return super().towards(odometry, remaining)


@pytest.mark.parametrize("lost", [True, False])
def test_the_search_leads_where_the_place_is_not_known_and_nowhere_else(smoke, trained, tmp_path, monkeypatch, lost):
    monkeypatch.setattr("aerialdojo_gen.learning.policy.Search", CountedSearch)
    monkeypatch.setattr("aerialdojo_gen.learning.policy.LOST_NATS", -1.0 if lost else np.inf)
    monkeypatch.setattr(CountedSearch, "looked", 0)
    monkeypatch.setattr(CountedSearch, "led", 0)
    chosen = Selection(("id_train",), limit=4)
    evaluation = Evaluation("lost", "policy", {"weights": str(trained(12))}, chosen)
    evaluate(smoke, evaluation, out=tmp_path, workers=1)
    rows = read_run(tmp_path, "lost").to_pylist()
    assert rows
    if lost:
        assert CountedSearch.led == CountedSearch.looked >= len(rows)
    else:
        assert CountedSearch.led == 0
        assert CountedSearch.looked == 0
        assert any(row["n_actions"] > 1 for row in rows)


def test_who_finds_out_late_that_it_is_lost_searches_what_it_saw_before(trained, monkeypatch):
    monkeypatch.setattr("aerialdojo_gen.learning.policy.Search", CountedSearch)
    monkeypatch.setattr("aerialdojo_gen.learning.policy.LOST_NATS", np.inf)
    monkeypatch.setattr(CountedSearch, "looked", 0)
    policy = Policy(str(trained(12)))
    goal = Goal("semantic", "red van", "clock tower", "north", "A red van.", None, Rules(90, sensors=policy.sensors))
    policy.reset(goal)
    draw = np.random.default_rng(0)
    for step in range(7):
        if step == 5:
            assert CountedSearch.looked == 0
            monkeypatch.setattr("aerialdojo_gen.learning.policy.LOST_NATS", -1.0)
        rgb = {view: draw.integers(0, 256, (32, 32, 3), np.uint8) for view in policy.sensors.views}
        depth_m = {view: draw.uniform(1.0, 20.0, (32, 32)).astype(np.float32) for view in policy.sensors.views}
        assert 0 <= policy.act(Observation(step, 90 - step, rgb=rgb, depth_m=depth_m)) < 16
    # The five of before, and one at each step since.
    assert CountedSearch.looked == 7


def test_a_guess_that_is_led_is_where_it_was_led_to(trained):
    tensors, about, _ = checkpoints.read(trained(0))
    network = network_of(about, tensors, "weights").eval()
    with torch.no_grad():
        seen, goal = torch.randn(2, 3, 64), torch.randn(2, 32)
        guess, _ = network.whereabouts(seen, goal, torch.zeros(2, 3, 4), network.blank(2))
        assert ((guess.scene_nats >= 0.0) & (guess.scene_nats <= np.log(max(guess.scene.shape[-1], 2)))).all()
        away_m = torch.tensor([3.0, -4.0, 1.0]).expand(2, 3, 3)
        led = guess.with_goal_offset(away_m)
        assert torch.allclose(led.offset * UNIT_M, away_m)
        one, two = (network.choose(seen, one).logits for one in (guess, led))
        assert not torch.allclose(one, two)


def test_weights_that_lack_words_for_what_they_see_are_refused(trained, tmp_path):
    tensors, about, state = checkpoints.read(trained(12))
    path = tmp_path / "changed.safetensors"
    checkpoints.write(path, tensors, type(about)(**{**vars(about), "named": about.named[:-1]}), state)
    tensors, about, _ = checkpoints.read(path)
    with pytest.raises(StoreError, match=r"\d+ words to search for, for weights of \d+"):
        network_of(about, tensors, str(path))
