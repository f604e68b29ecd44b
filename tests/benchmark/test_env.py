"""The environment: motion, collision, what ends an episode, Gymnasium's contract; worlds from seeds."""

import math
import os
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st
from support.browser import until
from support.handmade import box, instance, scene

import aerialdojo_gen.benchmark  # noqa: F401 - registers the environment
from aerialdojo_gen.base.errors import AerialDojoError, RenderError, StoreError, UsageError
from aerialdojo_gen.benchmark import AerialDojoEnv
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.benchmark.worlds import WorldMaker
from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.geometry.motion import replay, route_length_m
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.flight_space import FlightSpace
from aerialdojo_gen.scenes.worlds.world import World
from aerialdojo_gen.store import schemas

RADIUS = 0.25
ID = {name: i for i, name in enumerate(schemas.ACTION_NAMES)}


@pytest.fixture(scope="module")
def yard():
    """A wall of 1 m across x = 5, and a thin one across x = -5."""
    wall = instance("wall", box((5, -3, 0), (6, 3, 4)))
    sheet = instance("sheet", box((-5.001, -3, 0), (-5, 3, 4)))
    return FlightSpace(scene(wall, sheet, half=10.0, ceiling=8.0), RADIUS)


def fly(space, *names, start=(0.0, 0.0, 2.0, 0.0), goal=(3.0, 0.0, 2.0), budget=90):
    episode = Episode(space, start, goal, budget)
    for name in names:
        episode.step(None if name is None else ID[name])
    return episode


def test_stop_inside_the_radius_is_success_and_outside_is_not(yard):
    near = fly(yard, "MoveForward3", "Stop")
    assert (near.termination, near.stop_called, near.success(3.0)) == ("stop", True, True)
    assert near.distance_m == 0.0
    far = fly(yard, "MoveLeft1", "Stop", goal=(3.0, 0.0, 2.0))
    assert (far.termination, far.stop_called, far.success(3.0)) == ("stop", True, False)
    assert far.success(3.2)
    assert far.min_distance_m == 3.0, "the start counts"


def test_a_wall_stops_the_body_where_it_touches(yard):
    hit = fly(yard, "MoveForward5")
    assert (hit.termination, hit.stop_called, hit.success(3.0)) == ("collision", False, False)
    assert hit.position == pytest.approx((5.0 - RADIUS, 0.0, 2.0), abs=2e-3)
    assert hit.path_length_m == pytest.approx(4.75, abs=2e-3)
    assert hit.position[0] <= 5.0 - RADIUS, "on the free side"
    assert hit.min_distance_m == pytest.approx(1.75, abs=2e-3), "the contact counts"
    late = fly(yard, "MoveForward3", "MoveForward3")
    assert (late.termination, late.min_distance_m) == ("collision", 0.0), "it was there before"
    assert late.distance_m == pytest.approx(1.75, abs=2e-3)


def test_a_thin_sheet_cannot_be_jumped_over(yard):
    back = (0.0, 0.0, 2.0, math.pi)
    assert fly(yard, "MoveForward3", "MoveForward3", start=back).termination == "collision"
    assert fly(yard, "MoveUp2", "MoveUp2", "MoveForward5", "MoveForward3", start=back).termination is None


def test_the_last_action_may_be_a_stop_a_collision_or_neither(yard):
    assert fly(yard, "MoveForward1", "Stop", budget=2).termination == "stop"
    assert fly(yard, "MoveForward1", "MoveForward5", budget=2).termination == "collision"
    over = fly(yard, "MoveForward1", "MoveForward1", budget=2)
    assert (over.termination, over.stop_called, over.remaining_actions) == ("budget", False, 0)
    assert not over.success(3.0), "within the radius, but no Stop"
    with pytest.raises(RuntimeError, match="budget"):
        over.step(0)


@pytest.mark.parametrize("first", ["Stop", "TurnLeft15", "MoveUp1", None])
def test_a_start_in_collision_ends_so_at_the_first_action(yard, first):
    episode = fly(yard, first, start=(5.1, 0.0, 2.0, 0.0), goal=(5.1, 0.0, 2.0))
    assert episode.termination == "collision"
    assert not episode.success(3.0)
    assert episode.stop_called == (first == "Stop")
    assert episode.position == (5.1, 0.0, 2.0)


def test_an_answer_without_an_action_spends_one(yard):
    episode = fly(yard, None, None, budget=2)
    assert (episode.n_invalid, episode.n_actions, episode.termination) == (2, 2, "budget")
    refused = fly(yard, "MoveForward5", start=(0.0, 9.0, 2.0, math.pi / 2), budget=1)
    assert (refused.n_refused, refused.n_actions, refused.termination) == (1, 1, "budget"), "the fence spends one too"
    with pytest.raises(ValueError, match="0 to 15"):
        fly(yard).step(schemas.APPROACH)
    with pytest.raises(ValueError, match="0 to 15"):
        fly(yard).step(-1)


free_starts = st.tuples(st.floats(-17, 17), st.floats(-17, 17), st.floats(0.5, 11), st.floats(-math.pi, math.pi))


@settings(max_examples=60, deadline=None)
@given(start=free_starts, actions=st.lists(st.integers(1, N_ACTIONS - 1), min_size=1, max_size=30))
def test_flying_is_replaying_up_to_the_first_touch(village, start, actions):
    world = CollisionWorld(village.scene)
    episode = Episode(village, start, (0.0, 0.0, 5.0), 300)
    touched = world.sphere_in_collision(start[:3], RADIUS)
    low, high = village.grid.arrays.lower - 1e-9, village.grid.arrays.upper + 1e-9
    poses = [np.array(start)]
    for action in actions:
        here = replay(poses[-1], [action])[-1]
        inside = bool((here[:3] >= low).all() and (here[:3] <= high).all())
        episode.step(action)
        if touched or (inside and world.segment_in_collision(poses[-1][:3], here[:3], RADIUS)):
            assert episode.termination == "collision"
            return
        assert episode.termination is None
        assert episode.refused == (not inside)
        if inside:
            poses.append(here)
        assert episode.position == pytest.approx(tuple(poses[-1][:3]), abs=1e-9)
        assert math.cos(episode.yaw_rad - poses[-1][3]) == pytest.approx(1.0, abs=1e-12)
        assert -math.pi < episode.yaw_rad <= math.pi
    distances = np.linalg.norm(np.array(poses)[:, :3] - [0.0, 0.0, 5.0], axis=1)
    assert episode.min_distance_m == pytest.approx(distances.min(), abs=1e-9)
    assert episode.path_length_m == pytest.approx(route_length_m(np.array(poses)[:, :3]), abs=1e-9)


@pytest.fixture(scope="module")
def seeing(smoke):
    return gymnasium.make("AerialDojo-v0", data=smoke, width=24, height=16, render_mode="rgb_array").unwrapped


def test_gymnasium_finds_nothing_to_complain_of(smoke, seeing):
    blind = AerialDojoEnv(smoke, views=(), modality="semantic")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*not.*unwrapped|.*spec.*|.*render_modes.*")
        check_env(blind, skip_render_check=True)
        check_env(seeing, skip_render_check=True)
    assert "image" not in blind.observation_space["goal"].spaces
    assert set(blind.observation_space.spaces) == {"step", "remaining_actions", "refused", "goal"}


def test_what_is_seen_is_what_is_asked_for_and_turns(seeing):
    observation, info = seeing.reset(seed=4)
    assert info == {"reason": ""}
    assert list(observation["rgb"]) == list(observation["depth_m"]) == list(schemas.VIEWS)
    depth = np.stack([*observation["depth_m"].values()])
    assert depth.any()
    assert ((depth == 0) | (depth > 0.1)).all(), "nothing within range is 0"
    picture = seeing.render()
    assert picture.shape == (640, 640, 3)
    assert picture.std() > 5
    # Turning around shows the left view in front.
    left = observation["depth_m"]["left"]
    for _ in range(6):
        observation, reward, terminated, truncated, info = seeing.step(schemas.TURN_LEFT)
        assert (reward, terminated, truncated, info) == (0.0, False, False, {"reason": ""})
    assert observation["depth_m"]["front"] == pytest.approx(left, abs=1e-3)
    assert observation["step"].tolist() == [6]


def test_a_chosen_task_and_what_ends_it(smoke):
    env = AerialDojoEnv(smoke, views=(), modality="semantic", setting="base")
    row = env._rows.slice(0, 1).to_pylist()[0]
    observation, _ = env.reset(options={"task_id": row["task_id"]})
    assert observation["goal"]["target_name"] == row["target_name"]
    assert observation["goal"]["description"] == row["description"]
    assert schemas.DIRECTIONS[observation["goal"]["direction"]] == row["direction"]
    assert observation["remaining_actions"].tolist() == [row["action_budget"]]
    for k in range(row["action_budget"]):
        observation, _, terminated, truncated, info = env.step(schemas.TURN_LEFT)
        assert truncated == (k == row["action_budget"] - 1)
        assert not terminated
    last = {"task_id": row["task_id"], "success": False, "distance_m": math.dist(env.episode.position, env.task.goal)}
    assert info == {"reason": "budget"} | last
    env.reset(options={"task_id": row["task_id"]})
    ended = (0.0, True, False, {"reason": "stop"} | last)
    assert env.step(0)[1:] == ended, "the start is never within 3 m of the goal"
    with pytest.raises(RuntimeError, match="stop"):
        env.step(0)


def test_the_same_seed_draws_the_same_tasks_and_a_success_is_rewarded(smoke):
    env = AerialDojoEnv(smoke, views=(), success_radius_m=1000.0)

    def drawn(seed):
        return [env.reset(seed=None if k else seed)[0]["goal"]["target_name"] for k in range(6)]

    assert drawn(1) == drawn(1)
    assert drawn(1) != drawn(2)
    *ended, info = env.step(0)[1:]
    assert (ended, info["reason"], info["success"]) == ([1.0, True, False], "stop", True)


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectorised(smoke, mode):
    envs = gymnasium.make_vec(
        "AerialDojo-v0", num_envs=2, vectorization_mode=mode, data=smoke, views=(), modality="semantic"
    )
    try:
        first, _ = envs.reset(seed=[3, 5])
        alone = [AerialDojoEnv(smoke, views=(), modality="semantic") for _ in range(2)]
        names = [env.reset(seed=s)[0]["goal"]["target_name"] for env, s in zip(alone, (3, 5), strict=True)]
        assert list(first["goal"]["target_name"]) == names
        observation, _, terminated, truncated, info = envs.step(np.array([0, 14]))
        assert terminated.tolist() == [True, False]
        assert truncated.tolist() == [False, False]
        assert info["reason"].tolist() == ["stop", ""]
        ended = alone[0].step(0)[-1]
        for name in ("task_id", "success", "distance_m"):
            assert info[name][0] == ended[name]
            assert info[f"_{name}"].tolist() == [True, False], "nothing of an episode that goes on"
        assert observation["step"].tolist() == [[1], [1]]
        assert list(first["goal"]["target_name"]) == names, "an observation that was kept stays what it was"
    finally:
        envs.close()


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"setting": "short"}, "there are base, standard, long_horizon"),
        ({"scene": "U_Nowhere"}, "no scene 'U_Nowhere'"),
        ({"width": 0}, "no camera has 0"),
        ({"render_mode": "human"}, "no render mode 'human'"),
        ({"views": "fron"}, "no view 'fron': did you mean 'front'"),
        ({"scenes_in_memory": 0}, "at least 1, not 0"),
        ({"episodes_per_scene": 0}, "at least 1, not 0"),
        ({"paraphrase": "all"}, "no choice of paraphrase 'all'"),
        ({"data": "/dev"}, "there is no release in"),
    ],
)
def test_what_does_not_exist_is_named(smoke, keywords, message):
    with pytest.raises((UsageError, StoreError), match=message):
        AerialDojoEnv(**{"data": smoke} | keywords)


def test_a_task_that_is_not_there_is_named(smoke):
    env = AerialDojoEnv(smoke, views=())
    with pytest.raises(UsageError, match="no task 'U_X_0-1-s'"):
        env.reset(options={"task_id": "U_X_0-1-s"})
    with pytest.raises(UsageError, match="no option 'task'"):
        env.reset(options={"task": "x"})


def test_a_fork_of_a_process_that_has_drawn_is_told_so_and_does_not_hang(seeing, monkeypatch):
    from aerialdojo_gen.benchmark import observations

    monkeypatch.setattr(observations, "_opengl_process", [os.getppid()])
    with pytest.raises(RenderError, match="start it by spawn"):
        seeing.reset(seed=0)


GIVEN = {"worlds": "U_Alley", "num_worlds": 2, "episodes_per_world": 2, "n_objects": 6, "views": ()}


def episodes(env, n):
    """Worlds and tasks of some episodes, each ended at once."""
    found = []
    for k in range(n):
        observation, _ = env.reset(seed=5 if k == 0 else None)
        assert observation in env.observation_space
        *_, info = env.step(0)
        found.append((env.unwrapped.world, info["task_id"]))
    return found


def test_a_world_that_cannot_be_made_says_why_and_the_next_one_is_made(worlds_cache):
    maker = WorldMaker("U_Alley", n_objects=6, folder=worlds_cache)
    wrong, (right,) = World("U_Alley", 7, {"relief_m": 3.0}), maker.worlds
    for world in (wrong, right):
        maker.prepare(world)
    child = until("a process", lambda: maker._child)
    with pytest.raises(AerialDojoError, match=r"U_Alley-7 could not be made: .*relief_m"):
        maker.root(wrong)
    assert (maker.root(right) / "release" / "tasks").is_dir()
    maker.close()
    assert child.poll() == 0, "nobody waits any more"


@pytest.mark.slow
def test_episodes_go_through_worlds_that_are_made_once(worlds_cache):
    env = gymnasium.make("AerialDojo-v0", **GIVEN, cache=worlds_cache)
    first = episodes(env, 6)
    env.close()
    worlds = [world for world, _ in first]
    assert set(worlds) == {"U_Alley-1000", "U_Alley-1001"}
    assert worlds[0] == worlds[1]
    assert worlds[2] == worlds[3] != worlds[0]
    assert all(task.startswith(world) for world, task in first)

    def made():
        return {path: path.stat().st_mtime_ns for path in worlds_cache.glob("*/*/data/release/tasks/**/*.parquet")}

    before = made()
    assert before
    again = gymnasium.make("AerialDojo-v0", **GIVEN, cache=worlds_cache)
    assert episodes(again, 6) == first, "the seed alone decides worlds and tasks"
    again.reset(options={"world": "U_Alley-1001"})
    assert again.unwrapped.world == "U_Alley-1001"
    with pytest.raises(UsageError, match="no world 'U_Alley-1002'"):
        again.reset(options={"world": "U_Alley-1002"})
    again.close()
    assert made() == before


def test_closing_stops_the_process_that_makes_a_world(tmp_path):
    maker = WorldMaker("N_Snowfield", folder=tmp_path)
    maker.prepare(maker.worlds[0])
    until("a process", lambda: maker._child)
    child, coming = maker._child, maker._coming[maker.worlds[0].name]
    maker.close()
    assert child.poll() is not None
    with pytest.raises(AerialDojoError, match="N_Snowfield-1000"):
        coming.result()
    assert not list(tmp_path.glob("[0-9a-f][0-9a-f]/*")), "nothing half-made is kept"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"worlds": "U_Nowhere"}, "U_Nowhere"),
        ({"worlds": "N_Snowfield", "num_worlds": 0}, "at least 1 world"),
        ({"worlds": "N_Snowfield", "start_seed": -1}, "seeds from 0"),
        ({"worlds": "N_Snowfield", "data": "data"}, "data and worlds"),
        ({"worlds": "N_Snowfield", "episodes_per_world": 0}, "episodes_per_world"),
    ],
)
def test_requests_that_make_no_sense(given, said):
    with pytest.raises(UsageError, match=said):
        gymnasium.make("AerialDojo-v0", **given)
