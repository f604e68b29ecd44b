"""The data set: its pictures are the renderer's, its labels fly to the goal, its windows are the trajectory's.

Over one data directory, over several, and over worlds from seeds that are made for it.
"""

import shutil
from itertools import product

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from aerialdojo_gen import GlRenderer, open_release
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.benchmark.env import AerialDojoEnv
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.benchmark.worlds import make_worlds
from aerialdojo_gen.dataset.contents import prune_release
from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.learning import Trajectories, Vocabulary, collate
from aerialdojo_gen.learning.labels import NO_ACTION
from aerialdojo_gen.planning.flight_space import flight_space
from aerialdojo_gen.store.root import open_root

VIEWS = ("front", "down", "left")
STEPS = ("rgb", "depth_m", "action", "previous_action", "remaining_actions", "odometry", "pose")
HOW = {"views": ("front",), "size": (24, 16), "goal": ("text", "image"), "privileged": ("pose", "goal_distance_m")}
SEEN = {"split": "all", "views": VIEWS, "size": (40, 24), "limit": 6, "privileged": "pose"}


@pytest.fixture(scope="module")
def seen(smoke):
    return Trajectories(smoke, **SEEN)


@pytest.fixture(scope="module")
def blind(smoke):
    return Trajectories(smoke, split="all", views=(), privileged=("pose", "goal_distance_m", "actions"))


def test_pictures_are_those_of_the_renderer_at_the_same_pose_and_size(smoke, seen):
    release = open_release(smoke)
    numbers = range(0, len(seen), 7)
    batch = seen.batch(numbers)
    for scene in seen.index.scenes:
        own = [k for k, nav_id in enumerate(batch["nav_id"]) if nav_id.startswith(scene)]
        assert own, "both scenes are drawn from"
        with GlRenderer(release.mesh(scene)) as renderer:
            for k, (v, view) in product(own, enumerate(VIEWS)):
                pose = batch["pose"][k, 0]
                picture = renderer.render(Camera(40, 24, 90.0), view_pose(pose[:3], pose[3], view))
                assert (batch["rgb"][k, 0, v] == picture.rgb).all()
                depth_m = np.where(picture.depth_m <= np.float32(65.535), picture.depth_m, 0)
                assert (batch["depth_m"][k, 0, v] == depth_m).all()
    assert batch["rgb"].std() > 10


def test_what_is_learned_from_is_what_the_environment_shows(smoke, seen):
    k, env = 2, AerialDojoEnv(smoke, views=VIEWS, width=40, height=24)
    observation, _ = env.reset(options={"task_id": f"{seen.index.nav_id[k]}-s"})
    for number in range(*seen._first[k : k + 2]):
        sample = seen[number]
        assert sample["remaining_actions"] == observation["remaining_actions"]
        for v, view in enumerate(VIEWS):
            assert np.abs(sample["rgb"][0, v].astype(int) - observation["rgb"][view]).max() <= 1
            assert np.median(np.abs(sample["depth_m"][0, v] - observation["depth_m"][view])) < 1e-5
        observation, reward, terminated, _, _ = env.step(sample["action"][0])
    assert (reward, terminated) == (1.0, True), "the labels fly to the goal"


def test_labels_fly_every_trajectory_to_its_goal(smoke, blind):
    index, root = blind.index, open_root(smoke)
    assert len(index) > 200
    assert len(blind) == len(index.actions)
    for k in range(0, len(index), 12):
        batch = blind.batch(range(blind._first[k], blind._first[k + 1]))
        space = flight_space(*mesh_of(root, index.sources[k][1]), 0.25)
        episode = Episode(space, tuple(index.start[k]), tuple(index.goal[k]), int(index.budget[k]))
        left = batch["goal_distance_m"][:, 0]
        for i, action in enumerate(batch["action"][:, 0]):
            assert (batch["action_collides"][i, 0, action], batch["action_refused"][i, 0, action]) == (False, False)
            assert batch["pose"][i, 0] == pytest.approx((*episode.position, episode.yaw_rad), abs=1e-9)
            assert batch["remaining_actions"][i, 0] == episode.remaining_actions
            # What was done last, not what is to be done now: that is the label.
            assert batch["previous_action"][i, 0] == (batch["action"][i - 1, 0] if i else NO_ACTION)
            straight = np.linalg.norm(index.goal[k] - episode.position)
            assert straight - 1e-4 <= left[i] <= 3 * straight + 40
            episode.step(int(action))
        assert episode.success(3.0)
        # The distance left falls by no more than what is flown.
        assert left[-1] <= 3.0
        assert (np.diff(left) <= 5.3).all()
        reckoned = replay([0.0, 0.0, 0.0, 0.0], index.routes[k][:-1])
        told = batch["odometry"][:, 0]
        assert told[:, :3] == pytest.approx(reckoned[:, :3], abs=1e-4)
        assert np.cos(told[:, 3] - reckoned[:, 3]) == pytest.approx(1.0, abs=1e-6)


def test_privileged_columns_are_what_the_environment_does(smoke, blind):
    root, blocked = open_root(smoke), 0
    for number in np.random.default_rng(0).choice(len(blind), 60, replace=False).tolist():
        sample, k = blind[number], blind.place(number)[0]
        space = flight_space(*mesh_of(root, blind.index.sources[k][1]), 0.25)
        for action in range(N_ACTIONS):
            episode = Episode(space, tuple(sample["pose"][0]), tuple(blind.index.goal[k]), 5)
            episode.step(action)
            collision = episode.termination == "collision"
            blocked += collision
            assert sample["action_collides"][0, action] == collision
            assert sample["action_refused"][0, action] == episode.refused
            cost = sample["action_cost_to_go_m"][0, action]
            assert np.isinf(cost) if collision else cost >= episode.distance_m - 1e-3
    assert blocked > 20


def test_windows_look_back_and_hold_nothing_before_the_start(smoke, seen):
    past = Trajectories(smoke, **SEEN, past=3)
    assert len(past) == len(seen)
    k = 4
    for step in range(6):
        number = int(seen._first[k]) + step
        window = past[number]
        assert window["mask"].tolist() == [step - 3 + i >= 0 for i in range(4)]
        for i in range(4):
            if not window["mask"][i]:
                assert not any(window[name][i].any() for name in STEPS)
                continue
            alone = seen[number - 3 + i]
            assert all((window[name][i] == alone[name][0]).all() for name in STEPS)
        first = int(window["mask"].argmax())
        assert (window["previous_action"][first] == NO_ACTION) == (step <= 3)


def test_a_stride_shares_every_step_out_once(smoke):
    tiled = Trajectories(smoke, split="all", views=(), past=7, stride=8, privileged="pose")
    steps = {}
    for number in range(len(tiled)):
        k, end = tiled.place(number)
        window = tiled[number]
        seen = [s for s, on in zip(range(end - 7, end + 1), window["mask"], strict=True) if on]
        steps.setdefault(k, []).extend(seen)
    assert all(sorted(found) == list(range(tiled.index.steps[k])) for k, found in steps.items())
    assert len(steps) == len(tiled.index)


def test_whole_trajectories_are_padded_at_their_front(smoke):
    whole = Trajectories(smoke, split="all", views=("front",), size=16, past=None, limit=5)
    assert len(whole) == len(whole.index) == 5
    lengths = whole.index.steps.tolist()
    assert len(set(lengths)) > 1
    samples = [whole[k] for k in range(5)]
    assert [len(s["action"]) for s in samples] == lengths
    for batch in (collate(samples), whole.batch(range(5))):
        assert batch["rgb"].shape == (5, max(lengths), 1, 16, 16, 3)
        assert batch["mask"].sum(axis=1).tolist() == lengths
        assert batch["mask"][:, -1].all()
        for k, sample in enumerate(samples):
            assert (batch["action"][k, -lengths[k] :] == sample["action"]).all()
            assert (batch["rgb"][k, -lengths[k] :] == sample["rgb"]).all()
            assert not batch["rgb"][k, : -lengths[k]].any()


def test_goals_as_text_tokens_and_pictures(smoke):
    data = Trajectories(smoke, split="all", views=(), goal=("image", "text", "tokens"))
    release = open_release(smoke)
    sample = data[11]
    found = release.task(sample["nav_id"])
    words = found.instances[0]
    said = "{target_name}, {direction} of {landmark}. {description}"
    assert sample["text"] == said.format(**words)
    assert (sample["image"] == release.picture(sample["nav_id"])).all()
    assert sample["has_image"]
    back = [data.vocabulary.words[n - 2] for n in sample["tokens"] if n]
    assert " ".join(back).startswith(words["target_name"].lower().split()[0])
    few = Vocabulary.of(data._texts[:1], length=5)
    other = Trajectories(smoke, split="all", views=(), goal="tokens", vocabulary=few)
    tokens = other.batch(range(0, len(other), 50))["tokens"]
    assert tokens.shape[1:] == (5,)
    assert (tokens == 1).any(), "words that are not known"
    assert other.fingerprint != data.fingerprint


def test_a_batch_without_a_goal_picture_is_the_same_whenever_it_comes(planted):
    """Where there is none it is black, and as large as the others', whatever was seen before."""
    table = pq.read_table(planted.path("tasks/train"), partitioning=None)
    lacking = min(table["nav_id"].to_pylist())
    is_lacking = pc.and_(pc.equal(table["nav_id"], lacking), pc.equal(table["modality"], "image"))
    planted.write_table("tasks/train", table.filter(pc.invert(is_lacking)))
    options = {"scene": planted.scene, "split": "train", "views": (), "goal": ("text", "image")}
    fresh, used = Trajectories(planted.data, **options), Trajectories(planted.data, **options)
    assert fresh.index.nav_id[0] == lacking
    other = used.batch([len(used) - 1])
    assert other["has_image"].tolist() == [True]
    for batch in (fresh.batch([0, 0]), used.batch([0, 0])):
        assert batch["image"].shape == (2, *other["image"].shape[1:])
        assert not batch["has_image"][0]
        assert not batch["image"][0].any()


def test_the_cache_gives_what_was_drawn_survives_damage_and_stays_within_its_bound(smoke, seen, tmp_path):
    kept = Trajectories(smoke, **SEEN, cache_gb=1, cache_dir=tmp_path)
    assert kept.fingerprint == seen.fingerprint
    numbers = list(range(0, len(seen), 5))
    plain, first = seen.batch(numbers), kept.batch(numbers)
    files = sorted(tmp_path.glob("*/*/*.pix"))
    assert len(files) == 6
    written = [path.stat().st_mtime_ns for path in files]
    again = kept.batch(numbers)
    assert [path.stat().st_mtime_ns for path in files] == written, "read, not drawn"
    one, two, three = (path.read_bytes() for path in files[:3])
    changed = one[:-7], two[:400], three[:-30] + bytes([three[-30] ^ 1]) + three[-29:]
    for path, content in zip(files, changed, strict=False):
        path.write_bytes(content)
    mended = kept.batch(range(len(kept)))
    for name in ("rgb", "depth_m"):
        for batch in (first, again):
            assert (batch[name] == plain[name]).all()
        assert (mended[name][numbers] == plain[name]).all()
    # Within its bound, whatever finds no room is drawn.
    size, folder = 300_000, tmp_path / "small"
    few = Trajectories(smoke, **SEEN, cache_gb=size / 1e9, cache_dir=folder)
    for _ in range(2):
        assert (few.batch(numbers)["rgb"] == plain["rgb"]).all()
    sizes = [path.stat().st_size for path in folder.glob("*/*/*.pix")]
    assert 0 < len(sizes) < 6
    assert sum(sizes) <= size


def test_recordings_are_read_where_they_are(smoke):
    options = {"split": "all", "views": VIEWS, "size": 160, "privileged": "pose"}
    read = Trajectories(smoke, source="recordings", **options)
    assert sorted(read.index.nav_id) == open_release(smoke).recorded()
    drawn = Trajectories(smoke, **options)
    place = {nav_id: k for k, nav_id in enumerate(drawn.index.nav_id)}
    numbers = list(range(0, len(read), 9))
    same = [int(drawn._first[place[read.index.nav_id[k]]]) + step for k, step in map(read.place, numbers)]
    a, b = read.batch(numbers), drawn.batch(same)
    assert (a["pose"] == b["pose"]).all()
    assert np.abs(a["rgb"].astype(int) - b["rgb"]).mean() < 8, "lossy, and made smaller"
    close = np.abs(a["depth_m"] - b["depth_m"]) < 0.02 * b["depth_m"] + 0.02
    assert close.mean() > 0.9
    both = Trajectories(smoke, source="auto", **options)
    assert len(both) == len(drawn)
    mixed = both.batch([*same[:2], 0, 1])
    assert (mixed["rgb"][:2] == a["rgb"][:2]).all()
    other = [k for k in (0, 1) if drawn.index.nav_id[drawn.place(k)[0]] not in read.index.nav_id]
    assert all((mixed["rgb"][2 + k] == drawn[k]["rgb"]).all() for k in other)


def test_a_release_without_recordings_or_without_meshes_is_named(planted):
    meshes = (planted.data / "meshes").rename(planted.data / "elsewhere")
    with pytest.raises(StoreError, match=r"the mesh .*U_Courtyard_0.*is missing: run aerialdojo-gen build-scenes"):
        Trajectories(planted.data, split="all")
    assert len(Trajectories(planted.data, split="all", views=())) > 0, "who sees nothing needs none"
    meshes.rename(planted.data / "meshes")
    with pytest.raises(UsageError, match="aerialdojo-gen render"):
        Trajectories(planted.data, split="all", source="recordings")


def test_a_selection_keeps_to_the_split_by_objects_and_to_its_limit(smoke):
    sides = {side: Trajectories(smoke, split="all", views=(), target_split=side) for side in ("train", "test")}
    tasks = open_release(smoke).tasks().to_pandas().drop_duplicates("nav_id").set_index("nav_id")["target_split"]
    assert all(set(tasks[data.index.nav_id]) == {side} for side, data in sides.items())
    assert sum(len(d.index) for d in sides.values()) == len(tasks)
    assert sides["train"].fingerprint != sides["test"].fingerprint
    few, more = (Trajectories(smoke, split="all", views=(), limit=limit).index for limit in (4, 7))
    assert set(few.nav_id) < set(more.nav_id)
    assert np.bincount(few.scene).tolist() == [2, 2], "spread over the scenes"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"views": ("front", "up")}, "no view 'up'"),
        ({"goal": "txt"}, "did you mean 'text'"),
        ({"privileged": "posse"}, "did you mean 'pose'"),
        ({"split": "id_trian"}, "did you mean 'id_train'"),
        ({"scene": "U_Nowhere"}, "no scene 'U_Nowhere'"),
        ({"source": "disk"}, "no source 'disk'"),
        ({"size": 0}, "no camera has 0"),
        ({"past": -1}, "at least 0"),
        ({"limit": 0}, "a limit is at least 1"),
        ({"release": None}, "either a release or worlds"),
        ({"worlds": "N_*"}, "either a release or worlds"),
        ({"num_worlds": 2}, "num_worlds: of worlds, not of a release"),
        ({"release": []}, "at least one data directory"),
        ({"release": None, "worlds": "N_Nowhere"}, "N_Nowhere"),
        ({"release": None, "worlds": "N_Snowfield", "num_worlds": 0}, "at least 1 world"),
    ],
)
def test_what_makes_no_sense_is_named(smoke, options, message):
    with pytest.raises(UsageError, match=message):
        Trajectories(**{"release": smoke, "split": "all", **options})


def test_a_number_beyond_the_samples_is_an_index_error(blind):
    with pytest.raises(IndexError, match="samples"):
        blind[len(blind)]
    assert blind[-1]["nav_id"] == blind.index.nav_id[-1]


def alike(a, b):
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
