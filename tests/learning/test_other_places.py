"""Policies in places that they have no map of: what objects look like, and weights that are taken elsewhere."""

import json
from collections import Counter
from functools import partial

import numpy as np
import pytest
from support.trainings import (
    assert_same_training,
    history,
    kill_at_first_checkpoint,
    network,
    recipe_of,
    rewritten,
    train_here,
)
from typer.testing import CliRunner

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Rules
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.scoring import score
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.learning.index import read_index
from aerialdojo_gen.learning.policy import Policy, read_weights
from aerialdojo_gen.learning.search import Search
from aerialdojo_gen.store.files import file_digest
from aerialdojo_gen.store.root import open_root

torch = pytest.importorskip("torch", reason="PyTorch is not installed: it is the extra 'train'")

from aerialdojo_gen.learning.network import UNIT_M  # noqa: E402 - it needs torch

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
epochs = 3
batch_steps = 64
learning_rate = 4e-3
warmup_batches = 0
looks = 16
checkpoint_s = 1e-3
[sight]
epochs = 12
batch_looks = 16
learning_rate = 1e-2
[dagger]
rounds = 0
"""
BOTH = ("before", "after")
recipe = partial(recipe_of, TEXT)
# A rate at which no weight changes that is not 0.
STILL = {"learning_rate": 1e-30, "epochs": 1}
ELSEWHERE = recipe(data={"split": "ood_train", "looks": 20}, train=STILL, sight=STILL)


@pytest.fixture(scope="module")
def learned(smoke, cache, tmp_path_factory):
    """Weights of the ID scene."""
    return train_here(smoke, recipe(), tmp_path_factory.mktemp("id"), cache).policy


@pytest.fixture(scope="module")
def sightless(smoke, cache, tmp_path_factory):
    """The same, which never learned what objects look like."""
    return train_here(smoke, recipe(sight={"epochs": 0}), tmp_path_factory.mktemp("sightless"), cache).policy


@pytest.fixture(scope="module")
def adapted(smoke, cache, learned, tmp_path_factory):
    """The same, taken to the OOD scene by a training that changes nothing."""
    return train_here(smoke, ELSEWHERE, tmp_path_factory.mktemp("ood"), cache, init=learned).policy


def test_patches_are_told_by_the_names_of_what_they_show(smoke, learned):
    rows = [row for row in history(learned.parent) if row["phase"] == -1]
    assert [row["epoch"] for row in rows] == list(range(12))
    assert rows[-1]["accuracy"] > max(0.6, rows[0]["accuracy"] + 0.1)
    _, about, _ = read_weights(learned)
    index = read_index(open_root(smoke), Selection(("id_train",)))
    said = " ".join(index.goal_columns["target_name"]).lower().split()
    assert about.named
    assert set(about.named) <= set(said)


def test_what_is_seen_is_learned_apart_from_all_else(learned, sightless):
    """With it and without it the map and the choice are the same, to the bit."""
    without, with_it = (read_weights(path)[0] for path in (sightless, learned))
    assert not any(".sight." in name for name in without)
    assert {name for name in with_it if ".sight." not in name} == set(without)
    assert all(torch.equal(with_it[name], tensor) for name, tensor in without.items())


@pytest.mark.nightly
def test_killed_while_it_learns_to_see_it_goes_on_and_ends_the_same(smoke, cache, learned, tmp_path):
    file, out = tmp_path / "own.toml", tmp_path / "out"
    file.write_text(TEXT)
    kill_at_first_checkpoint(file, smoke, out, cache)
    assert read_weights(out / "checkpoint.safetensors")[2]["phase"] == -1
    assert not (out / "sight.safetensors").exists()
    assert_same_training(learned, train_here(smoke, recipe(), out, cache).policy)


@pytest.fixture
def calls(monkeypatch):
    """The calls of the search, counted."""
    calls = Counter()

    class CountedSearch(Search):
        def observe(self, log_chances, pictures, odometry):
            calls["observe"] += 1
            assert np.allclose(np.exp(log_chances).sum(axis=1), 1.0, atol=1e-4)
            super().observe(log_chances, pictures, odometry)

        def towards(self, odometry, remaining):
            calls["towards"] += 1
            return super().towards(odometry, remaining)

    monkeypatch.setattr("aerialdojo_gen.learning.policy.Search", CountedSearch)
    return calls


def set_lost_from(monkeypatch, nats):
    """How unsure of its place a policy has to be to search."""
    monkeypatch.setattr("aerialdojo_gen.learning.policy.LOST_NATS", nats)


def test_the_search_leads_where_the_place_is_not_known_and_nowhere_else(smoke, learned, tmp_path, calls, monkeypatch):
    for name, nats in (("known", np.inf), ("lost", -1.0)):
        assert not calls
        set_lost_from(monkeypatch, nats)
        chosen = Selection(("id_train",), limit=4)
        evaluate(smoke, Evaluation(name, "policy", {"weights": str(learned)}, chosen), out=tmp_path, workers=1)
    assert any(n > 1 for n in read_run(tmp_path, "known")["n_actions"].to_pylist())
    assert calls["observe"] == calls["towards"] >= read_run(tmp_path, "lost").num_rows > 0


def test_who_finds_out_late_that_it_is_lost_searches_what_it_saw_before(learned, calls, monkeypatch):
    set_lost_from(monkeypatch, np.inf)
    policy, draw = Policy(str(learned)), np.random.default_rng(0)
    policy.reset(
        Goal("semantic", "red van", "clock tower", "north", "A red van.", None, Rules(90, sensors=policy.sensors))
    )
    for step in range(7):
        if step == 5:
            assert not calls
            set_lost_from(monkeypatch, -1.0)
        rgb = {view: draw.integers(0, 256, (32, 32, 3), np.uint8) for view in policy.sensors.views}
        depth_m = {view: draw.uniform(1.0, 20.0, (32, 32)).astype(np.float32) for view in policy.sensors.views}
        assert 0 <= policy.act(Observation(step, 90 - step, rgb=rgb, depth_m=depth_m)) < 16
    # The five of before, and one at each step since.
    assert calls["observe"] == 7


def test_a_guess_that_is_led_is_where_it_was_led_to(sightless):
    net = network(sightless)
    with torch.no_grad():
        seen, goal = torch.randn(2, 3, 64), torch.randn(2, 32)
        guess, _ = net.whereabouts(seen, goal, torch.zeros(2, 3, 4), net.blank(2))
        assert ((guess.scene_nats >= 0.0) & (guess.scene_nats <= np.log(max(guess.scene.shape[-1], 2)))).all()
        away_m = torch.tensor([3.0, -4.0, 1.0]).expand(2, 3, 3)
        led = guess.with_goal_offset(away_m)
        assert torch.allclose(led.offset * UNIT_M, away_m)
        one, two = (net.choose(seen, one).logits for one in (guess, led))
        assert not torch.allclose(one, two)


def guess(network, seen, goal):
    blank = network.blank(len(seen))
    return network.whereabouts(seen[:, None], goal, torch.zeros(len(seen), 1, 4), blank)[0]


def test_adapted_weights_begin_as_the_given_ones(learned, adapted):
    """For what both know, the two networks answer alike; what is new stands beside it."""
    old, new = (read_weights(path)[1] for path in (learned, adapted))
    assert old.scenes == ("U_Courtyard_0",)
    assert new.scenes == ("U_Courtyard_0", "U_Courtyard_1")
    n = len(old.vocabulary)
    assert new.vocabulary.words[: n - 2] == old.vocabulary.words
    assert len(new.vocabulary) > n, "the OOD scene's goals have words of their own"
    assert new.named[: len(old.named)] == old.named
    assert (new.init, old.init) == (file_digest(learned), "")
    before, after, draw = network(learned), network(adapted), np.random.default_rng(0)
    pictures = torch.from_numpy(draw.integers(0, 256, (5, 32, 32, 4), np.uint8))
    tokens = torch.from_numpy(draw.integers(0, n, (5, 64)))
    shown, inside = torch.tensor([False, True, False, True, False]), torch.ones(5, 1)
    with torch.no_grad():
        goal, goal_after = (net.encode_goal(tokens, pictures, shown) for net in (before, after))
        seen, seen_after = (net.encode_pictures(pictures).repeat(1, 2) for net in (before, after))  # two views
        place, heading, scene, trust = before.whereabouts.locate(seen)
        place_after, heading_after, scene_after, trust_after = after.whereabouts.locate(seen)
        words, words_after = before.sight(pictures), after.sight(pictures)
        target = before.whereabouts.target(torch.cat([goal, inside], dim=1))
        choice, choice_after = (net.choose(seen[:, None], guess(before, seen, goal)) for net in (before, after))
        for a, b in (
            (goal, goal_after), (seen, seen_after), (place, place_after), (heading, heading_after),
            (scene, scene_after[:, :1]), (trust, trust_after), (choice.logits, choice_after.logits),
            (target, after.whereabouts.target(torch.cat([goal, inside, 0 * inside], dim=1))),
            (choice.blocked, choice_after.blocked), (words[..., :-1], words_after[..., : len(old.named)]),
            (words[..., -1], words_after[..., -1]),  # the last is of no object
        ):  # fmt: skip
            assert torch.allclose(a, b, rtol=0.0, atol=1e-5)


def test_a_training_goes_on_from_where_the_given_weights_are(smoke, cache, learned, tmp_path):
    """By the command, on the same scene: its first loss is below that of random weights."""
    file, out = tmp_path / "again.toml", tmp_path / "out"
    file.write_text(TEXT.replace('"sight"', '"again"').replace("epochs = 3", "epochs = 1").replace("= 12", "= 1"))
    command = ["train", str(file), "--data", str(smoke), "--cache", str(cache), "--device", "cpu", "--workers", "1"]
    done = CliRunner().invoke(cli.app, [*command, "--init", str(learned), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert f"begins with {learned}, scenes known: 1, new: 0; words known: " in done.stderr
    first, anew = (next(row for row in history(folder) if row["phase"] == 0) for folder in (out, learned.parent))
    assert first["loss"] < 0.9 * anew["loss"]
    assert read_weights(out / "policy.safetensors")[1].scenes == ("U_Courtyard_0",)


def test_what_does_not_fit_is_refused_in_a_line_that_names_it(smoke, cache, learned, tmp_path):
    old = rewritten(learned, tmp_path / "old.safetensors", scenes=())
    cut = rewritten(learned, tmp_path / "cut.safetensors", lacking="choice")
    named = read_weights(learned)[1].named
    wordless = rewritten(learned, tmp_path / "wordless.safetensors", named=named[:-1])
    for init, changed, error, message in (
        (learned, {"model": {"hidden": 48}}, UsageError, r"its \[model\] hidden is 32, and the recipe's is 48"),
        (learned, {"data": {"views": ["front"]}}, UsageError,
         r"its \[data\] views is \['front', 'left'\], and the recipe's is \['front'\]"),
        (learned, {"data": {"size_px": 64}}, UsageError, r"its \[data\] size_px is 32, and the recipe's is 64"),
        (old, {}, UsageError, r"old\.safetensors does not say which scenes it was trained on"),
        (cut, {}, StoreError, r"cut\.safetensors holds no policy of this version"),
        (wordless, {}, StoreError, r"\d+ words to search for, for weights of \d+"),
    ):  # fmt: skip
        with pytest.raises(error, match=message):
            train_here(smoke, recipe(**changed), tmp_path / "no", cache, init=init)
    assert not list((tmp_path / "no").glob("*.safetensors"))


def test_a_folder_is_gone_on_with_by_the_same_recipe_and_initial_weights_alone(smoke, cache, learned, adapted):
    with pytest.raises(
        UsageError, match=r"another set of initial weights: its .* and that of this one is none; give"
    ):
        train_here(smoke, ELSEWHERE, adapted.parent, cache)
    with pytest.raises(UsageError, match=r"another recipe: its fingerprint is [0-9a-f]{16}, and that of this one is"):
        train_here(smoke, recipe(train={"epochs": 1}), learned.parent, cache)
    before = file_digest(adapted)
    train_here(smoke, ELSEWHERE, adapted.parent, cache, init=learned)
    assert file_digest(adapted) == before, "the same command has nothing left to learn"


def test_a_run_says_where_its_policy_was_trained_and_the_report_tells_ood_from_ood_adapted(
    smoke, learned, adapted, tmp_path
):
    def run(*arguments):
        done = CliRunner().invoke(cli.app, [*arguments, "--data", str(smoke)])
        assert done.exit_code == 0, done.output
        return done.stdout

    def report(*arguments):
        return run("report", *arguments, "--log", str(tmp_path), "--no-baselines")

    for name, weights in zip(BOTH, (learned, adapted), strict=True):
        run("evaluate", "--agent", "policy", "--option", f"weights={weights}", "--run", name, "--split", "test",
            "--limit", "4", "--out", str(tmp_path), "--submission", str(tmp_path / f"{name}.json.gz"),
            "--workers", "1")  # fmt: skip
    rows = json.loads(report(*BOTH, "--json"))
    parts = {(row["run"], row["name"]) for row in rows if row["scope"] == "partition"}
    assert parts == {("before", "ID"), ("before", "OOD"), ("after", "ID"), ("after", "OOD adapted")}
    page = " ".join(report(*BOTH, "--table", "partition").split())
    assert "OOD adapted: OOD scenes whose training tasks the agent was trained on: policy (after), 1 scene." in page
    assert "adapted" not in report("before", "--table", "partition")
    chosen = Selection(("test",), limit=4)
    cards = [score(smoke, tmp_path / f"{name}.json.gz", tmp_path / "scored", selection=chosen) for name in BOTH]
    assert [card.adapted for card in cards] == [False, True]
