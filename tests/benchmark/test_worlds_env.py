"""The environment over worlds from seeds: real worlds, made by real processes, in a cache of the test's own."""

import gymnasium
import pytest
from support.browser import until

import aerialdojo_gen.benchmark  # noqa: F401 - registers the environment
from aerialdojo_gen.base.errors import AerialDojoError, UsageError
from aerialdojo_gen.benchmark.worlds import WorldMaker
from aerialdojo_gen.scenes.worlds.world import World

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
