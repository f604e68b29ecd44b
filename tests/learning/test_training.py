"""Policies: trained, resumed to the bit, flown by the evaluator, and refused where they do not fit."""

import json
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from scipy.stats import binomtest
from support.flying import free_poses, town
from support.planting import set_columns
from support.trainings import (
    assert_same_training,
    history,
    kill_at_first_checkpoint,
    network,
    recipe_of,
    rewritten,
    train_here,
)

from aerialdojo_gen.base.errors import ConfigError, StoreError, UsageError
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.learning.collect import Teacher, collect, parts_of, view_parts
from aerialdojo_gen.learning.encoding import DeadReckoning
from aerialdojo_gen.learning.index import read_index
from aerialdojo_gen.learning.labels import odometry, to_body_frame
from aerialdojo_gen.learning.parts import Part, pictures
from aerialdojo_gen.learning.policy import Policy, read_weights
from aerialdojo_gen.learning.recipe import load_recipe
from aerialdojo_gen.learning.steps import read_steps
from aerialdojo_gen.learning.trajectories import sample_evenly
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.pipeline.executors.base import make_executor
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.planning.difficulty import agent_actions
from aerialdojo_gen.planning.flight_space import FlightSpace
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.schemas import STOP, TURN_LEFT, TURN_RIGHT
from aerialdojo_gen.store.schemas.staged import list_of

torch = pytest.importorskip("torch", reason="PyTorch is not installed: it is the extra 'train'")

from aerialdojo_gen.learning.network import pose_loss  # noqa: E402 - it needs torch

TEXT = """
name = "small"
[data]
split = "id_train"
limit = 8
size_px = 32
validation_share = 0.0
settings = []
[model]
channels = [8, 8, 16]
features = 32
word_features = 16
hidden = 32
[train]
epochs = 9
batch_steps = 64
learning_rate = 4e-3
warmup_batches = 5
checkpoint_s = 1e-3
looks = 16
[dagger]
rounds = 0
"""
# A model that can learn eight trajectories by heart, or a map.
LARGER = {"channels": (16, 16, 32), "features": 64, "word_features": 32, "hidden": 128}
recipe = partial(recipe_of, TEXT)


@pytest.fixture(scope="module")
def learned(smoke, cache, tmp_path_factory):
    """A policy that saw eight trajectories nine times."""
    return train_here(smoke, recipe(), tmp_path_factory.mktemp("policy"), cache)


def test_a_short_training_fits_better_at_its_end(learned):
    rows = history(learned.policy.parent)
    assert [row["epoch"] for row in rows] == list(range(9))
    assert rows[-1]["loss"] < 0.8 * rows[0]["loss"]


@pytest.mark.nightly
def test_eight_trajectories_are_learned_by_heart_and_flown(smoke, cache, tmp_path):
    by_heart = recipe(model=LARGER, train={"epochs": 80})
    learned = train_here(smoke, by_heart, tmp_path / "out", cache)
    assert history(learned.policy.parent)[-1]["accuracy"] > 0.95
    assert learned.imitation.is_file()
    options = {"weights": str(learned.policy)}
    evaluate(smoke, Evaluation("learned", "policy", options, Selection(("id_train",))), out=tmp_path, workers=1)
    rows = read_run(tmp_path, "learned").to_pylist()
    index = read_index(open_root(smoke), Selection(("id_train",)))
    eight = set(index.take(sample_evenly(index, 8, 0)).nav_id)
    own = [row for row in rows if row["nav_id"] in eight]
    assert len(own) == 16, "both goals of each"
    assert sum(row["success"] for row in own) >= 14
    assert json.loads(own[0]["agent_options"])["weights"] == str(learned.policy)


def test_killed_and_gone_on_with_it_ends_with_the_same_weights(smoke, cache, learned, tmp_path):
    """A kill between two batches, at a checkpoint of every batch: what is left is learned, and nothing twice."""
    file, broken = tmp_path / "short.toml", tmp_path / "broken"
    file.write_text(TEXT)
    assert load_recipe(file) == recipe()
    kill_at_first_checkpoint(file, smoke, broken, cache)
    assert not (broken / "policy.safetensors").exists()
    train_here(smoke, recipe(), broken, cache)
    assert_same_training(learned.policy, broken / "policy.safetensors")


def test_successful_flights_of_a_run_are_learned_from(planted, tmp_path):
    known = {side: [row["agent_action"] for row in planted.rows(f"routes/{side}")] for side in ("train", "test")}
    for side, rows in known.items():
        turning = [[TURN_LEFT, TURN_RIGHT, *row] for row in rows]
        set_columns(planted, f"routes/{side}", agent_action=pa.array(turning, list_of(pa.int8())))
    three = Selection(("id_train",), modalities=("semantic",), limit=3)
    evaluate(planted.data, Evaluation("turning", "oracle", {"actions": "agent_action"}, three))
    for side, rows in known.items():
        set_columns(planted, f"routes/{side}", agent_action=pa.array(rows, list_of(pa.int8())))
    drawn = tmp_path / "drawn"
    train_here(
        planted.data, recipe(data={"runs": ["turning"]}, train={"epochs": 1, "looks": 0}), tmp_path / "out", drawn
    )
    (steps,) = [read_steps(file.parent) for file in drawn.glob("*/steps.npz")]
    assert set(steps.nav_id) == set(read_run(planted.data, "turning")["nav_id"].to_pylist())
    assert len(steps) == 3
    for begin in steps.first[:-1]:
        assert steps.label[begin : begin + 2].tolist() == [TURN_LEFT, TURN_RIGHT]


@pytest.mark.nightly
def test_to_restart_is_to_learn_anew(smoke, cache, learned, tmp_path):
    out = tmp_path / "again"
    for epochs in (1, 2):
        done = train_here(smoke, recipe(train={"epochs": epochs}), out, cache, restart=True)
        assert [row["epoch"] for row in history(out)] == list(range(epochs))
        assert read_weights(done.policy)[2]["epoch"] == epochs
    # A line that was cut short is no line.
    (out / "history.jsonl").write_text((out / "history.jsonl").read_text() + '{"phase": 0, "ep')
    train_here(smoke, recipe(train={"epochs": 2}), out, cache)
    assert len(history(out)) == 2


def parts_by_name(root, index, folder, seed=0):
    parts = parts_of(Part(root, ("id_train",), (), Sensors(width=32, height=32), "gl", folder), index, seed)
    assert sorted(nav_id for part in parts for nav_id in part.nav_ids) == sorted(index.nav_id)
    return {part.folder.name: part for part in parts}


def test_other_pictures_of_the_goals_are_drawn_from_anew(planted, tmp_path):
    index = read_index(open_root(planted.data), Selection(("id_train",)))
    before = parts_by_name(open_root(planted.data), index, tmp_path)
    shown = "reference_image"
    planted.edit("release/objects", lambda row: row.update({shown: row[shown] + b"x"}), lambda row: row[shown])
    after = parts_by_name(open_root(planted.data), index, tmp_path)
    assert len(after) == len(before)
    own = {name for name, part in before.items() if part.scene == planted.scene}
    assert before.keys() - after.keys() == own != set()


def test_references_and_looks_are_not_drawn_again_where_only_the_network_is_another():
    counted = set(code_of("aerialdojo_gen.learning.parts").parts)
    assert "aerialdojo_gen.learning.parts" in counted
    learned = {"network", "policy", "collect", "imitation", "training"}
    assert not {f"aerialdojo_gen.learning.{module}" for module in learned} & counted
    assert "aerialdojo_gen.learning.network" in code_of("aerialdojo_gen.learning.collect").parts


def test_of_more_trajectories_or_other_scenes_what_was_drawn_stays_drawn(smoke, tmp_path, monkeypatch):
    monkeypatch.setattr("aerialdojo_gen.learning.collect._PART", 5)
    root = open_root(smoke)
    index = read_index(root, Selection(("id_train", "ood_train")))
    assert len(index.scenes) > 1

    def whole(chosen):
        return {name for name, part in parts_by_name(root, chosen, tmp_path, 3).items() if len(part) == 5}

    all_of_them = whole(index)
    fewer = whole(index.take(sample_evenly(index, 10 * len(index.scenes), 3)))
    assert len(fewer) == 2 * len(index.scenes)
    last = whole(index.take(np.flatnonzero(index.scene == len(index.scenes) - 1)))
    assert last
    assert fewer | last < all_of_them


@pytest.mark.nightly
def test_a_map_is_learned_from_looks_about_too(smoke, cache, tmp_path):
    """With them places and headings are known better, at looks that no network was trained on."""
    root = open_root(smoke)
    index = read_index(root, Selection(("id_train",)))
    loss = {0: 0.0, 300: 0.0}
    # Two trainings each: what one gains differs by seed, between 0.1 and 0.5 as measured.
    for looks, seed in [(0, 0), (0, 1), (300, 0), (300, 1)]:
        thorough = {"epochs": 12, "looks": 128, "batch_steps": 256}
        own = recipe(seed=seed, data={"looks": looks, "limit": None}, model=LARGER, train=thorough)
        policy = train_here(smoke, own, tmp_path / f"{looks}-{seed}", cache).policy
        net, about = network(policy), read_weights(policy)[1]
        common = Part(root, ("id_train",), (), about.sensors, "gl", tmp_path)
        unseen = view_parts(common, index.scenes, 200, 7, None)
        with make_executor("local", 1) as executor, torch.no_grad():
            (found,) = collect(unseen, executor, Reporter(False), "looking")
            seen = net.encode_pictures(torch.from_numpy(np.array(found.frames)).flatten(0, 1)).reshape(200, -1)
            place, heading, scene, _ = net.whereabouts.locate(seen)
        pose, number = torch.from_numpy(found.pose), torch.zeros(200, dtype=torch.int64)
        loss[looks] += float(pose_loss(place, heading, scene, pose, number))
    assert loss[300] < loss[0]


def test_weights_of_another_action_set_or_release_are_refused_with_both_fingerprints(smoke, learned, tmp_path):
    def fly(options=(), **changed):
        path = rewritten(learned.policy, tmp_path / "changed.safetensors", **changed)
        chosen = Selection(("id_train",), limit=1)
        evaluation = Evaluation("refused", "policy", {"weights": str(path), **dict(options)}, chosen)
        return evaluate(smoke, evaluation, out=tmp_path / "log", workers=1)

    with pytest.raises(UsageError, match=r"another action set: its fingerprint is f{16}, and .* [0-9a-f]{16}"):
        fly(actions="f" * 64)
    with pytest.raises(UsageError, match=r"another release: its fingerprint is e{16}, and .* [0-9a-f]{16};"):
        fly(release="e" * 64)
    assert fly({"any_release": True}, release="e" * 64).finished == 1


def test_what_is_no_policy_is_refused_in_a_line(tmp_path, learned):
    with pytest.raises(UsageError, match="there are no weights"):
        read_weights(tmp_path / "none.safetensors")
    cut = tmp_path / "cut.safetensors"
    for content in (learned.policy.read_bytes()[:-1000], b"{}"):
        cut.write_bytes(content)
        with pytest.raises(StoreError, match="holds no policy"):
            read_weights(cut)
    # A shape beyond its weights, before it takes memory.
    shape = read_weights(learned.policy)[1].shape
    with pytest.raises(StoreError, match="holds no policy of this version"):
        Policy(str(rewritten(learned.policy, cut, shape={**shape, "hidden": 10**7})))
    file = tmp_path / "wrong.toml"
    file.write_text("[train]\nepoch = 3\n")
    with pytest.raises(ConfigError, match="did you mean 'epochs'"):
        load_recipe(file)


def test_shipped_recipes_are_named_after_their_files_and_small_ones_have_no_more_rounds(project):
    files = sorted((project / "pipelines" / "baselines").glob("*.toml"))
    assert {"imitation", "blind"} <= {file.stem for file in files}
    for file in files:
        shipped = load_recipe(file)
        assert shipped.name == file.stem  # else two of them would train into one folder
        assert shipped.reduced().dagger.rounds <= shipped.dagger.rounds, f"{file} --small is another method"


def test_the_teachers_labels_are_the_planners_own_plan():
    """From wherever the body is: the label is the plan's first action, and to follow labels is to arrive."""
    world = town()
    planner, teacher = Planner(world), Teacher(world)
    goal, *starts = free_poses(planner.grid, np.random.default_rng(1), 5)
    with teacher.cache_fields():
        plans = teacher.plan([goal] * len(starts), starts)
        for start, plan in zip(starts, plans, strict=True):
            route = planner.plan_one(goal, start)
            assert route.outcome == "SOLVED"
            assert plan[0] == agent_actions(route.actions)[0]
            episode = Episode(FlightSpace(world, 0.25), tuple(start), tuple(goal[:3]), 300)
            while episode.termination is None:
                pose = np.array([*episode.position, episode.yaw_rad])
                (plan,) = teacher.plan([goal], [pose])
                assert len(plan)
                episode.step(int(plan[0]))
            assert episode.termination == "stop"
            assert episode.distance_m <= 1.0 + 1e-6
            assert episode.path_length_m <= route.length_m * 1.02 + 0.1


@pytest.mark.nightly
def test_rounds_of_dagger_add_flights_whose_labels_are_the_teachers(smoke, cache, learned, tmp_path):
    own = tmp_path / "drawn"
    again = recipe(train={"epochs": 1}, dagger={"rounds": 1, "episodes": 4, "epochs": 1, "teacher_share": 0.0})
    done = train_here(smoke, again, tmp_path / "out", own)
    assert (done.policy.parent / "dagger-1.safetensors").is_file()
    assert [row["phase"] for row in history(done.policy.parent)] == [0, 1]
    parts = [read_steps(path) for path in sorted(own.iterdir()) if path.is_dir()]
    # The references are eight, the flights four.
    flown = sorted(parts, key=len)[: len(parts) // 2]
    assert 0 < sum(len(part) for part in flown) <= 4
    for part in flown:
        assert (part.label < 16).all()
        assert part.frames.shape[1:] == (1, 32, 32, 4)
        assert not part.blocked[:, [STOP, 14, 15]].any()
        assert part.blocked.any()
        for k in range(len(part)):
            steps = slice(part.first[k], part.first[k + 1])
            moved, pose = part.odometry[steps].astype(float), part.pose[steps].astype(float)
            # Own motion leads to where the body was: whatever the world did not allow is not in it.
            assert np.abs(odometry(pose) - moved)[:, :3].max() < 1e-4
            assert np.abs(np.sin(pose[:, 3] - pose[0, 3] - moved[:, 3])).max() < 1e-4


# In a process of its own, which has not drawn: forks of one that has could not.
FRESH = """
import sys
from aerialdojo_gen.learning import Loader, Trajectories
from aerialdojo_gen.learning.policy import Policy
from aerialdojo_gen.learning.recipe import load_recipe
from aerialdojo_gen.learning.training import train
smoke, weights, recipe, out, cache = sys.argv[1:]
Policy(weights)
data = Trajectories(smoke, split="all", scene="U_Courtyard_0", size=24, limit=2, past=1)
forking, plain = Loader(data, 8, seed=3, workers=2, context="fork"), Loader(data, 8, seed=3)
forked, alone = [*forking, *forking], [*plain, *plain]  # two epochs
assert len(forked) == len(alone) > 6
for a, b in zip(forked, alone):
    assert all((a[name] == b[name]).all() for name in ("rgb", "depth_m", "action"))
train(smoke, load_recipe(recipe), out=out, cache=cache, device="cpu", workers=1)
assert "torch._dynamo" not in sys.modules
"""


@pytest.mark.slow
def test_a_new_process_trains_without_torchs_compiler_and_its_forks_draw_what_it_draws(
    smoke, cache, learned, tmp_path
):
    """The compiler's import takes some seconds, in every process that trains or flies."""
    file = tmp_path / "recipe.toml"
    file.write_text(TEXT.replace("epochs = 9", "epochs = 1"))
    command = [sys.executable, "-c", FRESH, smoke, learned.policy, file, tmp_path / "out", cache]
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_without_torch_there_is_one_line(smoke, tmp_path):
    """In a process that cannot import it."""
    (tmp_path / "torch.py").write_text("raise ImportError('no torch here')\n")
    env = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    file = tmp_path / "recipe.toml"
    file.write_text('name = "small"\n')
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "train", str(file), "--data", str(smoke)]
    done = subprocess.run(command, capture_output=True, text=True, env=env, check=False)
    assert done.returncode == 1
    assert done.stderr == "error: train lacks the package torch: pip install 'aerialdojo-gen[train]'\n"


def flown(root, net, sensors, index, k, led):
    """Fly a task, told the goal's offset at every step or not; say whether it ends at the goal."""
    part = Part(root, ("id_test",), (), sensors, "gl", root.path, scene=index.scenes[0])
    episode = Episode(part.space, tuple(index.start[k]), tuple(index.goal[k]), int(index.budget[k]))
    reckoning, goal, memory = DeadReckoning(), torch.zeros(1, net.shape.features), net.blank(1)
    step = torch.ones((1, 1), dtype=torch.bool)
    while episode.termination is None:
        pose = np.array([[*episode.position, episode.yaw_rad]])
        seen = net.features(torch.from_numpy(pictures(part, pose)), goal, step)
        guess, memory = net.whereabouts(seen, goal, torch.from_numpy(reckoning.odometry[None, None]), memory)
        if led:
            guess = guess.with_goal_offset(torch.from_numpy(to_body_frame(pose, index.goal[k : k + 1]))[None].float())
        action = int(net.choose(seen, guess).actions(torch.from_numpy(reckoning.back[None, None]))[0, 0])
        episode.step(action)
        reckoning.add(action, episode.refused)
    return episode.success(3.0)


@pytest.mark.nightly
def test_told_where_goals_are_it_flies_there_though_its_map_knows_nothing(smoke, tmp_path):
    root = open_root(smoke)
    # The map learns nothing: where the goal is, is told or not known at all.
    thorough = {"epochs": 16, "batch_steps": 256, "learning_rate": 3e-3, "goal_weight": 0.0, "looks": 256}
    data = {"views": ["front", "down"], "limit": None, "validation_share": 0.02}
    own = recipe(data=data, model=LARGER | {"word_features": 16}, train=thorough)
    policy = train_here(smoke, own, tmp_path / "out", tmp_path / "cache").policy
    net, about = network(policy), read_weights(policy)[1]
    index = read_index(root, Selection(("id_test",)))
    rows = np.linspace(0, len(index) - 1, min(len(index), 40)).astype(int)
    with torch.inference_mode():
        told, untold = ([flown(root, net, about.sensors, index, k, led) for k in rows] for led in (True, False))
    # 18 and 0 of 39 as measured; a choice that learned beside its own guess ended none when told.
    assert np.mean(told) > 0.25
    assert np.mean(untold) < 0.1


@pytest.mark.slow
def test_the_weights_of_the_baseline_do_as_well_as_readme_says(project, tmp_path):
    """Flown where they and the whole release are here."""
    data = Path(os.environ.get("AERIALDOJO_DATA") or project / "data")
    weights = data / "policies" / "imitation" / "policy.safetensors"
    if not weights.is_file():
        pytest.skip(f"there are no weights of train imitation in {data}")
    row = re.search(r"^\| imitation and DAgger \| ([\d.]+) \[", (project / "README.md").read_text(), re.MULTILINE)
    selection = Selection(("id_test",), ("base",), limit=40)
    flown = evaluate(data, Evaluation("row", "policy", {"weights": str(weights)}, selection), out=tmp_path, workers=2)
    assert flown.finished == 40
    assert binomtest(flown.successes, 40, float(row[1]) / 100).pvalue > 0.001, f"{flown.successes} of 40"
