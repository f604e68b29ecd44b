"""Vector environments, rewards for progress, and the checkers of Gymnasium and Stable-Baselines3."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from aerialdojo_gen import make_env, open_release
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.learning.vector import Flattened, OwnScenes, ProgressReward, make_vec


class Blindfold(gymnasium.ObservationWrapper):
    """What goes through: a wrapper of a user's, which can be sent to another process."""

    def __init__(self, env):
        super().__init__(env)
        self.observation_space = gymnasium.spaces.Dict({"step": env.observation_space["step"]})

    def observation(self, observation):
        return {"step": observation["step"]}


def test_progress_adds_up_to_the_distance_flown_nearer(smoke):
    env = ProgressReward(make_env(smoke, views=()), scale=0.5, action_cost=0.25)
    for row in open_release(smoke).routes(scene="U_Courtyard_0").slice(0, 5).to_pylist():
        _, info = env.reset(options={"task_id": f"{row['nav_id']}-s"})
        start, total = info["goal_distance_m"], 0.0
        assert row["euclidean_m"] - 1e-6 <= start <= row["length_m"] * 1.02 + 0.5
        for action in row["agent_action"]:
            _, reward, terminated, _, info = env.step(action)
            total += reward
        assert terminated
        assert info["goal_distance_m"] <= 3.0
        expected = 1.0 + 0.5 * (start - info["goal_distance_m"]) - 0.25 * len(row["agent_action"])
        assert total == pytest.approx(expected, abs=1e-6)
    # Turning on the spot gains nothing, and a detour gains nothing in the end.
    env = ProgressReward(make_env(smoke, views=()))
    env.reset(options={"task_id": f"{row['nav_id']}-s"})
    assert [env.step(14)[1], env.step(15)[1]] == [0.0, 0.0]
    assert env.step(10)[1] + env.step(12)[1] == pytest.approx(0.0, abs=1e-9)


def test_a_collision_costs(smoke):
    env, last = ProgressReward(make_env(smoke, views=(), scene="U_Courtyard_0"), scale=0.0, collision_cost=2.0), {}
    for seed in range(20):
        env.reset(seed=seed)
        ended = False
        while not ended:
            _, reward, terminated, truncated, info = env.step(3)
            ended = terminated or truncated
        last[info["reason"]] = reward
    assert last["collision"] == -2.0


def test_gymnasiums_checker_finds_nothing_in_the_wrappers(smoke):
    env = ProgressReward(OwnScenes(make_env(smoke, views=("front", "down"), width=16, height=16), ["U_Courtyard_0"]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*not.*unwrapped|.*spec.*|.*render_modes.*|.*is different from.*")
        for one in (env, flat := Flattened(env)):
            check_env(one, skip_render_check=True)
    shapes = {name: space.shape for name, space in flat.observation_space.items()}
    assert (shapes["rgb"], shapes["depth_m"]) == ((16, 16, 6), (16, 16, 2))


def test_stable_baselines_checker_takes_what_it_can_take(smoke):
    """It takes no dicts within dicts and no texts: pictures and numbers, which is what its policies read."""
    checker = pytest.importorskip(
        "stable_baselines3.common.env_checker", reason="stable-baselines3 is not installed: tried where it is"
    )
    env = Flattened(ProgressReward(make_env(smoke, views=("front", "down"), width=48, height=48)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Depth is metres, and goes to a network as numbers.
        warnings.filterwarnings("ignore", message="It seems that your observation( space)? depth_m is an image")
        checker.check_env(env, skip_render_check=True)


@pytest.mark.parametrize(
    ("mode", "scenes"),
    [("sync", ("U_Courtyard_0", "U_Courtyard_1")), pytest.param("async", ("U_Courtyard_0",), marks=pytest.mark.slow)],
)
def test_environments_share_the_scenes_out(smoke, mode, scenes):
    alone = OwnScenes(make_env(smoke, views=("front",), width=24, height=16), ["U_Courtyard_0"])
    envs = make_vec(
        smoke, len(scenes), vectorization_mode=mode, scene=scenes, views=("front",), width=24, height=16,
        progress={"scale": 1.0},
    )  # fmt: skip
    try:
        first, info = envs.reset(seed=[5, 6][: len(scenes)])
        assert first["rgb"]["front"].shape == (len(scenes), 16, 24, 3)
        expected, _ = alone.reset(seed=5)
        assert (first["rgb"]["front"][0] == expected["rgb"]["front"]).all()
        assert first["goal"]["target_name"][0] == expected["goal"]["target_name"]
        assert (info["goal_distance_m"] > 3.0).all()
        _, rewards, terminated, truncated, info = envs.step(np.full(len(scenes), 14))
        assert not np.any([rewards, terminated, truncated])
    finally:
        envs.close()


def test_more_environments_than_scenes_and_ones_own_wrappers(smoke):
    envs = make_vec(smoke, 5, vectorization_mode="sync", views=(), wrappers=[Blindfold])
    observation, _ = envs.reset(seed=0)
    assert set(observation) == {"step"}
    assert {env.unwrapped.task.row["scene"] for env in envs.envs} == set(make_env(smoke, views=()).scenes)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"num_envs": 0}, "at least 1 environment"),
        ({"vectorization_mode": "threads"}, "no vectorization mode 'threads'"),
        ({"split": "ood_tset"}, "did you mean 'ood_test'"),
        ({"progress": {"discount": 2.0}, "vectorization_mode": "sync", "views": ()}, "a discount is from 0 to 1"),
    ],
)
def test_what_makes_no_sense_is_named(smoke, options, message):
    with pytest.raises(UsageError, match=message):
        make_vec(smoke, **options)
    with pytest.raises(UsageError, match="no task of the selection is in U_Mall_0"):
        OwnScenes(make_env(smoke, views=()), ["U_Mall_0"])
