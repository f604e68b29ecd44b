"""Going from scene to scene: which stay open, what is read ahead, and that neither changes an episode."""

import copy
import threading
from collections import Counter

import numpy as np
import pytest

from aerialdojo_gen import make_env
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.tasks import TaskSampler, mesh_of
from aerialdojo_gen.learning.vector import OwnScenes
from aerialdojo_gen.scenes import context
from aerialdojo_gen.scenes.context import context_of, open_contexts, open_scene, prefetch_mesh, release_scene
from aerialdojo_gen.store.root import open_root

YARDS = ("U_Courtyard_0", "U_Courtyard_1")
BLIND = {"views": (), "rgb": False, "depth": False}


@pytest.fixture(autouse=True)
def nothing_open():
    context.release_scenes()
    yield
    context.release_scenes()


def flown(smoke, episodes=8, seed=3, **options):
    """Tasks that an environment draws, and what is seen after a step of each."""
    env, seen = make_env(smoke, **options), []
    for k in range(episodes):
        env.reset(seed=None if k else seed)
        seen.append((env.task.row, env.step(14)[0]))
    env.close()
    return seen


def test_reading_ahead_changes_no_task_and_no_picture(smoke):
    options = {"views": "front", "width": 48, "height": 48, "episodes_per_scene": 2, "scenes_in_memory": 1}
    plain, ahead = (flown(smoke, 10, prefetch=prefetch, **options) for prefetch in (False, True))
    assert {task["scene"] for task, _ in plain} == set(YARDS), "the draw goes from one to the other"
    np.testing.assert_equal(ahead, plain)


def test_one_episode_a_scene_is_the_draw_of_old(smoke):
    draw = np.random.Generator(np.random.PCG64(np.random.SeedSequence(3)))
    ids = make_env(smoke, **BLIND)._rows["task_id"].to_pylist()
    assert [task["task_id"] for task, _ in flown(smoke, **BLIND)] == [ids[draw.integers(len(ids))] for _ in range(8)]


@pytest.mark.parametrize("run_length", [1, 2, 5])
def test_episodes_come_in_blocks_of_a_scene_and_all_tasks_as_often(run_length):
    scenes = ["a"] * 6 + ["b"] * 3 + ["c"]
    tasks, draw = TaskSampler(scenes, run_length), np.random.default_rng(0)
    assert tasks.coming is None
    drawn, coming = zip(*((tasks.next(draw), tasks.coming) for _ in range(20_000)), strict=True)
    blocks = [{scenes[at] for at in drawn[k : k + run_length]} for k in range(0, len(drawn), run_length)]
    assert blocks[1:] == [{scene} for scene in coming[:-run_length:run_length]], "what comes is known"
    counts = Counter(drawn)
    # Blocks of five make a fifth as many independent draws of a scene: four standard deviations of that.
    off = 4.0 * np.sqrt(len(drawn) * run_length / len(scenes))
    assert all(abs(counts[at] - len(drawn) / len(scenes)) < off for at in range(len(scenes)))


def test_a_seed_begins_anew_and_scenes_can_be_chosen():
    tasks, drawn = TaskSampler(["a", "b", "c", "d"] * 5, 3), []
    for _ in range(2):
        tasks.restart()
        draw = np.random.default_rng(7)
        drawn.append([tasks.next(draw) for _ in range(10)])
    assert drawn[0] == drawn[1]
    tasks.restrict(["b"])
    assert {tasks._scenes[tasks.next(draw)] for _ in range(20)} == {"b"}
    with pytest.raises(UsageError, match="in e"):
        tasks.restrict(["e"])


def test_scenes_stay_open_as_many_as_were_asked_for(smoke):
    root = open_root(smoke)
    digests = {mesh_of(root, scene)[1]: scene for scene in YARDS}

    def kept():
        return [digests[key] for key in context._contexts if key in digests]

    ids = make_env(smoke, **BLIND)._rows.select(["task_id", "scene"]).to_pylist()
    one, other = (next(row["task_id"] for row in ids if row["scene"] == scene) for scene in YARDS)
    few = make_env(smoke, scenes_in_memory=1, **BLIND)
    for task in (one, other, one):
        few.reset(options={"task_id": task})
        assert kept() == [few.task.row["scene"]]
    few.close()
    assert kept() == []
    many = make_env(smoke, scenes_in_memory=5, **BLIND)
    many.reset(options={"task_id": one})
    space = many._flight.space
    many.reset(options={"task_id": other})
    # Somebody who keeps a single scene does not take away what this one holds.
    open_scene(*mesh_of(root, YARDS[1]), 1)
    assert set(kept()) == set(YARDS)
    many.reset(options={"task_id": one})
    assert many._flight.space is space, "nothing was read or built again"
    many.close()
    assert kept() == []


def test_what_is_read_ahead_is_taken_up_and_keeps_nobody_waiting(smoke):
    root = open_root(smoke)
    here, there = (mesh_of(root, scene) for scene in YARDS)
    begun, go_on, made = threading.Event(), threading.Event(), []

    def make(own):
        own.part("slow", lambda: (begun.set(), go_on.wait(60), made.append(own)))

    ahead = threading.Thread(target=prefetch_mesh, args=(*there, make), daemon=True)
    ahead.start()
    assert begun.wait(60)
    worked = threading.Event()

    def work():
        quick = open_scene(*here, 1)
        quick.part("quick", lambda: 1)
        assert context_of(quick.scene) is quick
        open_scene(*here, 1)
        worked.set()

    # What waits for the other thread here would wait for ever.
    threading.Thread(target=work, daemon=True).start()
    assert worked.wait(60)
    assert not made
    go_on.set()
    ahead.join(60)
    assert len(open_contexts()) == 1
    taken = open_scene(*there, 1)
    assert taken is made[0]
    assert taken.part("slow", lambda: "anew") != "anew"
    assert open_contexts() == (taken,)
    release_scene(there[1])
    assert not open_contexts()


def test_a_closed_environment_says_so_and_leaves_no_thread(smoke):
    before = threading.active_count()
    env = make_env(smoke, prefetch=True, **BLIND)
    env.reset(seed=0)
    for _ in range(2):
        env.close()
    assert threading.active_count() == before
    assert not open_contexts()
    with pytest.raises(RuntimeError, match="closed: make another"):
        env.reset()
    with pytest.raises(RuntimeError, match="call reset first"):
        env.step(0)


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy])
def test_a_copy_is_refused_with_what_to_do(smoke, how):
    env = make_env(smoke, **BLIND)
    for one in (env, OwnScenes(env, YARDS[:1])):
        if how is copy.deepcopy or one is env:
            with pytest.raises(TypeError, match="make_env, make_vec"):
                how(one)
