"""A training that begins with the weights of another: what it takes over, what it refuses, what a report says."""

import json
from functools import partial

import numpy as np
import pytest
from support.trainings import history, recipe_of
from typer.testing import CliRunner

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.scoring import score
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.store.files import file_digest

torch = pytest.importorskip("torch", reason="PyTorch is not installed: it is the extra 'train'")

from aerialdojo_gen.learning import checkpoints  # noqa: E402 - it needs torch
from aerialdojo_gen.learning.policy import network_of  # noqa: E402
from aerialdojo_gen.learning.training import train  # noqa: E402

TEXT = """
name = "tiny"
[data]
split = "id_train"
limit = 6
size_px = 32
validation_share = 0.0
settings = []
looks = 40
[model]
channels = [8, 8, 16]
features = 32
word_features = 16
hidden = 32
[train]
epochs = 3
batch_steps = 64
learning_rate = 4e-3
warmup_batches = 0
looks = 8
weight_decay = 0.0
[sight]
epochs = 2
batch_looks = 16
learning_rate = 1e-2
[dagger]
rounds = 0
"""
BOTH = ("before", "after")
# A rate at which no weight changes that is not 0.
STILL = {"learning_rate": 1e-30, "epochs": 1}
recipe = partial(recipe_of, TEXT)


@pytest.fixture(scope="module")
def learned(smoke, cache, tmp_path_factory):
    """Weights of the ID scene."""
    out = tmp_path_factory.mktemp("id")
    return train(smoke, recipe(), out=out, cache=cache, device="cpu", workers=1).policy


@pytest.fixture(scope="module")
def adapted(smoke, cache, learned, tmp_path_factory):
    """The same, taken to the OOD scene by a training that changes nothing."""
    still = recipe(data={"split": "ood_train"}, train=STILL, sight=STILL)
    out = tmp_path_factory.mktemp("ood")
    return train(smoke, still, out=out, cache=cache, init=learned, device="cpu", workers=1).policy


def read(path):
    tensors, about, _ = checkpoints.read(path)
    return network_of(about, tensors, str(path)).eval(), about


def same(a, b):
    return torch.allclose(a, b, rtol=0.0, atol=1e-5)


def test_adapted_weights_begin_as_the_given_ones(learned, adapted):
    """For what both know, the two networks answer alike; what is new stands beside it."""
    (before, old), (after, new) = read(learned), read(adapted)
    assert old.scenes == ("U_Courtyard_0",)
    assert new.scenes == ("U_Courtyard_0", "U_Courtyard_1")
    n = len(old.vocabulary)
    assert new.vocabulary.words[: n - 2] == old.vocabulary.words
    assert len(new.vocabulary) > n, "the OOD scene's goals have words of their own"
    assert new.named[: len(old.named)] == old.named
    assert (new.init, old.init) == (file_digest(learned), "")
    draw = np.random.default_rng(0)
    pictures = torch.from_numpy(draw.integers(0, 256, (5, 32, 32, 4), np.uint8))
    tokens = torch.from_numpy(draw.integers(0, n, (5, 64)))
    shown = torch.tensor([False, True, False, True, False])
    with torch.no_grad():
        goal, goal_after = (net.encode_goal(tokens, pictures, shown) for net in (before, after))
        assert same(goal, goal_after)
        seen, seen_after = (net.encode_pictures(pictures) for net in (before, after))
        assert same(seen, seen_after)
        place, heading, scene, trust = before.whereabouts.locate(seen)
        place_after, heading_after, scene_after, trust_after = after.whereabouts.locate(seen)
        assert same(place, place_after)
        assert same(heading, heading_after)
        assert same(trust, trust_after)
        assert same(scene, scene_after[:, :1])
        inside = torch.ones(5, 1)
        first = before.whereabouts.target(torch.cat([goal, inside], dim=1))
        assert same(first, after.whereabouts.target(torch.cat([goal, inside, 0 * inside], dim=1)))
        assert same(before.choose(seen[:, None], guess(before, seen, goal)).logits,
                    after.choose(seen[:, None], guess(before, seen, goal)).logits)  # fmt: skip
        assert same(before.blocked(seen), after.blocked(seen))
        words, words_after = before.sight(pictures), after.sight(pictures)
        assert same(words[..., :-1], words_after[..., : len(old.named)])
        assert same(words[..., -1], words_after[..., -1]), "the last is of no object"


def guess(network, seen, goal):
    blank = network.blank(len(seen))
    return network.whereabouts(seen[:, None], goal, torch.zeros(len(seen), 1, 4), blank)[0]


def test_a_training_goes_on_from_where_the_given_weights_are(smoke, cache, learned, tmp_path):
    """By the command, on the same scene: its first loss is below that of random weights."""
    file = tmp_path / "again.toml"
    file.write_text(TEXT.replace('"tiny"', '"again"').replace("epochs = 3", "epochs = 1"))
    command = ["train", str(file), "--data", str(smoke), "--cache", str(cache), "--device", "cpu", "--workers", "1"]
    out = tmp_path / "out"
    done = CliRunner().invoke(cli.app, [*command, "--init", str(learned), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert f"begins with {learned}, scenes known: 1, new: 0; words known: " in done.stderr
    first, anew = (next(row for row in history(folder) if row["phase"] == 0) for folder in (out, learned.parent))
    assert first["loss"] < 0.9 * anew["loss"]
    assert checkpoints.read(out / "policy.safetensors")[1].scenes == ("U_Courtyard_0",)


def test_what_does_not_fit_is_refused_in_a_line_that_names_it(smoke, cache, learned, tmp_path):
    def begin(init, **changed):
        train(smoke, recipe(**changed), out=tmp_path / "no", cache=cache, init=init, device="cpu", workers=1)

    with pytest.raises(
        UsageError, match=r"does not fit the recipe: its \[model\] hidden is 32, and the recipe's is 48"
    ):
        begin(learned, model={"hidden": 48})
    with pytest.raises(
        UsageError, match=r"its \[data\] views is \['front'\], and the recipe's is \['front', 'down'\]"
    ):
        begin(learned, data={"views": ["front", "down"]})
    with pytest.raises(UsageError, match=r"its \[data\] size_px is 32, and the recipe's is 64"):
        begin(learned, data={"size_px": 64})
    with pytest.raises(UsageError, match=r"there are no weights .*none\.safetensors"):
        begin(tmp_path / "none.safetensors")
    tensors, about, state = checkpoints.read(learned)
    old, cut = tmp_path / "old.safetensors", tmp_path / "cut.safetensors"
    checkpoints.write(old, tensors, type(about)(**{**vars(about), "scenes": ()}), state)
    with pytest.raises(UsageError, match=r"old\.safetensors does not say which scenes it was trained on"):
        begin(old)
    checkpoints.write(cut, {name: t for name, t in tensors.items() if "choice" not in name}, about, state)
    with pytest.raises(StoreError, match=r"cut\.safetensors holds no policy of this version"):
        begin(cut)
    assert not list((tmp_path / "no").glob("*.safetensors"))


def test_a_folder_that_was_begun_with_other_weights_is_not_gone_on_with(smoke, cache, learned, adapted):
    still = recipe(data={"split": "ood_train"}, train=STILL, sight=STILL)
    with pytest.raises(
        UsageError, match=r"another set of initial weights: its .* and that of this one is none; give"
    ):
        train(smoke, still, out=adapted.parent, cache=cache, device="cpu", workers=1)
    before = file_digest(adapted)
    train(smoke, still, out=adapted.parent, cache=cache, init=learned, device="cpu", workers=1)
    assert file_digest(adapted) == before, "the same command has nothing left to learn"


def test_a_run_says_where_its_policy_was_trained_and_the_report_tells_ood_from_ood_adapted(
    smoke, learned, adapted, tmp_path
):
    def run(*arguments):
        done = CliRunner().invoke(cli.app, [*arguments, "--data", str(smoke)])
        assert done.exit_code == 0, done.output
        return done.stdout

    for name, weights in zip(BOTH, (learned, adapted), strict=True):
        run("evaluate", "--agent", "policy", "--option", f"weights={weights}", "--run", name, "--split", "test",
            "--limit", "4", "--out", str(tmp_path), "--submission", str(tmp_path / f"{name}.json.gz"),
            "--workers", "1")  # fmt: skip
    rows = json.loads(run("report", "before", "after", "--log", str(tmp_path), "--no-baselines", "--json"))
    parts = {(row["run"], row["name"]) for row in rows if row["scope"] == "partition"}
    assert parts == {("before", "ID"), ("before", "OOD"), ("after", "ID"), ("after", "OOD adapted")}
    page = " ".join(
        run("report", "before", "after", "--log", str(tmp_path), "--no-baselines", "--table", "partition").split()
    )
    assert "OOD adapted: OOD scenes whose training tasks the agent was trained on: policy (after), 1 scene." in page
    alone = run("report", "before", "--log", str(tmp_path), "--no-baselines", "--table", "partition")
    assert "adapted" not in alone
    chosen = Selection(("test",), limit=4)
    cards = [score(smoke, tmp_path / f"{name}.json.gz", tmp_path / "scored", selection=chosen) for name in BOTH]
    assert [card.adapted for card in cards] == [False, True]
