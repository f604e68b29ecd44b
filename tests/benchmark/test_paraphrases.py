"""Descriptions that are drawn for an episode, and for a trajectory."""

import pytest

from aerialdojo_gen.benchmark.env import AerialDojoEnv
from aerialdojo_gen.benchmark.tasks import texts_of_tasks
from aerialdojo_gen.learning.trajectories import Trajectories
from aerialdojo_gen.store.root import open_root

SCENE = "U_Courtyard_1"
CHOICE = {"scene": SCENE, "modality": "semantic", "views": ()}


def drawn(env, episodes=12):
    first = env.reset(seed=5)[0]["goal"]["description"]
    return [first, *(env.reset()[0]["goal"]["description"] for _ in range(episodes - 1))]


@pytest.mark.parametrize("subset", ["train", "test"])
def test_an_episode_has_a_text_of_its_side(smoke, subset):
    texts = texts_of_tasks(open_root(smoke), SCENE, subset)
    env = AerialDojoEnv(smoke, split=f"ood_{subset}", paraphrase="random", limit=1, **CHOICE)
    found = drawn(env)
    assert set(found) <= set(texts[env.task.row["nav_id"]])
    assert len(set(found)) > 1
    assert set(found) <= {text for *_, text in env.goals_in_words()}
    assert env.observation_space.contains(env.reset()[0])
    assert found == drawn(env)


def test_sides_share_no_text_and_a_task_keeps_its_own(smoke):
    sides = [
        {text for own in texts_of_tasks(open_root(smoke), SCENE, s).values() for text in own}
        for s in ("train", "test")
    ]
    assert sides[0]
    assert sides[1]
    assert not sides[0] & sides[1]
    assert len(set(drawn(AerialDojoEnv(smoke, split="ood_test", limit=1, **CHOICE)))) == 1


def test_trajectories_draw_by_their_seed(smoke):
    how = {"views": (), "rgb": False, "depth": False, "scene": SCENE, "paraphrase": "random"}
    texts = [Trajectories(smoke, "train", seed=seed, **how).index.goal_columns["description"] for seed in (1, 1, 2)]
    assert texts[0] == texts[1] != texts[2]
