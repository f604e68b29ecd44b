"""Where to look for a goal that no map tells: names of what is seen, sightings over steps, and where to fly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.flight import nodes_of
from aerialdojo_gen.benchmark.observations import renderer_for
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of
from aerialdojo_gen.geometry.cameras import view_pose
from aerialdojo_gen.learning import parts
from aerialdojo_gen.learning.index import read_index
from aerialdojo_gen.learning.labels import blocked_at
from aerialdojo_gen.learning.parts import NOTHING, UNNAMED
from aerialdojo_gen.learning.search import Search, patch_depths_m, patch_rays
from aerialdojo_gen.learning.words import name_vocabulary, word_targets
from aerialdojo_gen.planning.flight_space import flight_space
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root

SENSORS = Sensors(("front", "left", "right", "down"), width=32, height=32)
WORDS = ("blue", "red", "van")
RED_VAN = word_targets(["red van"], WORDS)[0]
coordinates = st.floats(-60.0, 60.0)
poses = st.tuples(coordinates, coordinates, st.floats(-8.0, 8.0), st.floats(-3.2, 3.2)).map(
    lambda p: np.array(p, np.float32)
)


@pytest.fixture(scope="module")
def looks(smoke, tmp_path_factory):
    """Looks about in the smoke run's scene, with what they show."""
    root = open_root(smoke)
    (scene, *_) = read_index(root, Selection(("id_train",))).scenes
    part = parts.Part(root, ("id_train",), (), SENSORS, "gl", tmp_path_factory.mktemp("looks"), scene=scene)
    return part, parts.collect_views(part, parts.Exploration(60, 3, 0, "train"))


def seeing(shown, number):
    """Log chances of a sight that is right: the words of `WORDS` for patches that show an object, else nothing."""
    chances = np.full((len(shown), len(WORDS) + 1), 1e-3, np.float32)
    chances[shown == number, 1:3] = 0.49
    chances[shown != number, -1] = 0.99
    return np.log(chances)


def test_words_that_name_several_objects_are_searched_for():
    words = name_vocabulary(["the red van", "a red car, with a roof", "van of the baker", "roof"])
    assert words == ("red", "roof", "van")
    wanted = word_targets(["red van in red", "blue bus"], words)
    assert np.allclose(wanted, [[0.5, 0.0, 0.5], [0.0, 0.0, 0.0]])


@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 5, 12]))
def test_a_patch_shows_what_most_of_its_pixels_do(seed, blocky):
    rng = np.random.default_rng(seed)
    # Blocks of any size: patches of one object, of several, and of few pixels of one.
    small = rng.integers(-2, 4, (2, 16 // blocky + 1, 16 // blocky + 1)).astype(np.int16)
    number = small.repeat(blocky, axis=1).repeat(blocky, axis=2)[:, :16, :16]
    for k, label in enumerate(parts.patch_labels(number).tolist()):
        view, row, column = np.unravel_index(k, (2, 4, 4))
        own = number[view, 4 * row : 4 * row + 4, 4 * column : 4 * column + 4].ravel().tolist()
        count = {one: own.count(one) for one in set(own) - {NOTHING}}
        if not count:
            assert label == NOTHING
        elif max(count.values()) < 4:
            assert label == UNNAMED
        else:
            assert count[label] == max(count.values())


def test_looks_about_tell_targets_of_their_side_and_no_others(looks):
    part, views = looks
    root, name = part.data, part.scene
    scene = open_scene(*mesh_of(root, name), SEVERAL).scene
    rows = store.read_scene(root, "release/objects", name, ("object_id", "name")).to_pylist()
    called = {nodes_of(root, name)[row["object_id"]]: row["name"] for row in rows}
    targets = {"train": set(), "test": set()}
    for side in ("train", "test"):
        tasks = store.read_scene(root, f"tasks/{side}", name, ("nav_id", "target_split")).to_pylist()
        side_of = {row["nav_id"]: row["target_split"] for row in tasks}
        for row in store.read_scene(root, f"routes/{side}", name, ("nav_id", "target_object_id")).to_pylist():
            targets[side_of[row["nav_id"]]].add(nodes_of(root, name)[row["target_object_id"]])
    assert targets["test"]
    assert sorted(views.names) == sorted(called[node] for node in targets["train"])
    renderer, seen = renderer_for(scene, "gl"), 0
    for pose, shown in zip(views.pose[:20].astype(np.float64), views.shown, strict=False):
        matrices = [view_pose(pose[:3], float(pose[3]), view) for view in SENSORS.views]
        instance = np.stack([p.instance for p in renderer.render_views(SENSORS.camera, matrices, True)])
        cut = instance.reshape(4, 8, 4, 8, 4).transpose(0, 1, 3, 2, 4).reshape(-1, 16)
        for own, label in zip(cut, shown.tolist(), strict=True):
            nodes = [scene.instances[k].node for k in own[own >= 0]]
            if label >= 0:
                # Poses are kept in single precision: a pixel at an edge may be another's.
                assert sum(called.get(n) == views.names[label] and n in targets["train"] for n in nodes) >= 3
                seen += 1
            elif label == NOTHING:
                assert sum(node in called for node in nodes) <= 1
    assert seen > 20


def test_looks_about_are_taken_near_where_references_lead_and_turned_at_random(looks):
    part, views = looks
    followed = read_index(part.data, Selection(("id_train",), scenes=(part.scene,)), "train")
    places = np.concatenate([followed.poses_of(k)[:, :3] for k in range(len(followed))])
    away_m = np.linalg.norm(views.pose[:, None, :3] - places[None], axis=2).min(axis=1)
    assert 0.2 < np.median(away_m) < away_m.max() <= 3.0
    space = flight_space(*mesh_of(part.data, part.scene), 0.25)
    for pose in views.pose.astype(np.float64):
        # A look may be at a contact: single precision moves it by some micrometres.
        assert space.grid.distance_m(pose[:3]) > 0.25 - 0.01
    assert (views.blocked == blocked_at(space, views.pose)).all()
    assert set(views.scene) == {part.scene}
    assert (views.first == np.arange(61)).all()
    # All four quarters, each by more than a tenth.
    assert np.bincount(((views.pose[:, 3] + np.pi) // (np.pi / 2)).astype(int), minlength=4).min() > 6
    # Poses are kept in single precision: an edge may fall on the other side of a pixel's middle.
    assert (parts.pictures(part, views.pose[:5].astype(np.float64)) == views.frames[:5]).mean() > 0.99
    assert len(np.unique(views.frames.reshape(60, -1), axis=0)) > 50


def test_who_sees_the_goal_is_led_to_it(looks):
    part, views = looks
    size_of, columns = [f"size_{axis}_m" for axis in "xyz"], ("name", "x_m", "y_m", "z_m")
    rows = store.read_scene(part.data, "release/objects", part.scene, (*columns, *size_of)).to_pylist()
    names = [row["name"] for row in rows]
    known = {row["name"]: row for row in rows if names.count(row["name"]) == 1}
    off = []
    for pose, frames, shown in zip(views.pose, views.frames, views.shown, strict=True):
        away_m = patch_rays(SENSORS) * patch_depths_m(frames, SENSORS.max_depth_m)[:, None]
        distance_m = np.linalg.norm(away_m, axis=1)
        near = np.where((distance_m > 0.0) & (distance_m < 12.0), shown, NOTHING)
        for number in np.unique(near[near >= 0]).tolist():
            row = known.get(str(views.names[number]))
            if row is None or (near == number).sum() < 3:
                continue
            # From another pose the same sighting leads to the same place.
            for begun in ((0.0, 0.0, 0.0, 0.0), (4.0, -2.0, 1.0, 1.2)):
                odometry, search = np.array(begun, np.float32), Search(RED_VAN, SENSORS)
                search.observe(seeing(shown, number), frames, odometry)
                place = pose[:3] + turned(search.towards(odometry, 1), pose[3])
                outside = np.abs(place - [row["x_m"], row["y_m"], row["z_m"]])
                off.append(np.linalg.norm(np.maximum(outside - np.array([row[s] for s in size_of]) / 2.0, 0.0)))
    assert len(off) > 20
    # It stands 1.5 m before the object; a patch's depth may be that of what is behind the object or in front of it.
    assert np.median(off) < 2.0
    assert np.quantile(off, 0.85) < 3.0


def turned(away, yaw):
    """What is so far ahead, to the left and above, in the frame that the yaw is in."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([c * away[0] - s * away[1], s * away[0] + c * away[1], away[2]])


# The patches ahead and to the left.
AHEAD, LEFT = (int(np.linalg.norm(patch_rays(SENSORS) - ray, axis=1).argmin()) for ray in ([1, 0, 0], [0, 1, 0]))


def looking(search, odometry, distance_m, chances):
    """Observe patches with these chances at a distance; the others show nothing."""
    seen = np.full((256, 4), 1e-3)
    seen[:, -1] = 0.997
    for patch, own in chances.items():
        seen[patch] = own
    pictures = np.zeros((4, 32, 32, 4), np.uint8)
    pictures[..., 3] = round(255 * np.sqrt(distance_m / SENSORS.max_depth_m))
    search.observe(np.log(seen).astype(np.float32), pictures, odometry)


def test_it_goes_to_what_looks_most_like_the_goal_until_it_was_seen_from_nearby():
    search, start = Search(RED_VAN, SENSORS), np.zeros(4, np.float32)
    # 9 m away; what is ahead is red, what is to the left is a red van.
    looking(search, start, 9.0, {AHEAD: [0.01, 0.9, 0.04, 0.05], LEFT: [0.01, 0.45, 0.45, 0.09]})
    first = search.towards(start, 60)
    assert first[1] > 5.0 > abs(first[0])
    # From nearby it is no van: what is ahead is more like one now.
    there = np.array([0.0, 6.0, 0.0, np.pi / 2], np.float32)
    for _ in range(3):
        looking(search, there, 3.0, {AHEAD: [0.9, 0.01, 0.001, 0.089]})
    second = search.towards(start, 60)
    assert second[0] > 5.0 > abs(second[1])


@given(st.lists(poses, min_size=1, max_size=40), st.integers(20, 90))
def test_who_has_seen_nothing_flies_round_and_stops_nowhere(places, remaining):
    search = Search(RED_VAN, SENSORS)
    nothing = np.log(np.full((256, 4), [1e-3, 1e-3, 1e-3, 0.997]))
    for odometry in places:
        search.observe(nothing, np.zeros((4, 32, 32, 4), np.uint8), odometry)
        away = search.towards(odometry, remaining)
        assert np.linalg.norm(away) > 2.0
        place = odometry[:3] + turned(away, odometry[3])
        assert np.hypot(place[0], place[1]) == pytest.approx(12.0, abs=1e-3)
        assert place[2] == pytest.approx(0.0, abs=1e-4)


def test_the_ring_is_flown_round_once_in_its_order():
    search = Search(RED_VAN, SENSORS)
    odometry, bearings = np.zeros(4, np.float32), []
    for _ in range(60):
        away = search.towards(odometry, 90)
        # As a body does that flies 3 m at a time, and turns nowhere.
        odometry[:3] += away * min(1.0, 3.0 / np.linalg.norm(away))
        bearings.append(np.arctan2(odometry[1], odometry[0]))
    bearings = np.unwrap(bearings)
    assert bearings[-1] - bearings[3] > 2.0 * np.pi


def test_the_last_way_leads_to_one_thing_and_is_begun_in_time():
    """Whatever is seen on it: who changes his mind arrives nowhere."""
    search, odometry = Search(RED_VAN, SENSORS), np.zeros(4, np.float32)
    van = [0.01, 0.45, 0.45, 0.09]
    looking(search, odometry, 9.0, {LEFT: van})
    # It has looked at it, in vain, and is as far from it as it was: round the start, until the way there is due.
    first = search.towards(odometry, 90)
    for _ in range(13):
        search.towards(odometry, 90)
    due = [r for r in range(60, 10, -1) if np.allclose(search.towards(odometry, r), first)]
    assert due
    assert due == list(range(due[0], 10, -1)), "for good"
    assert 20 <= due[0] <= 40
    for _ in range(8):
        looking(search, odometry, 9.0, {AHEAD: van})
    assert np.allclose(search.towards(odometry, 9), first)
