"""The agents: how they are found, what they do, the explorer's map; the references as agents can fly them."""

import cmath
import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.handmade import box, instance, scene
from support.planting import definitions, set_columns, with_column

import aerialdojo_gen
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark.agents import AgentBase, load_agent
from aerialdojo_gen.benchmark.agents.depth_map import DepthMap
from aerialdojo_gen.benchmark.agents.explorer import ExplorerAgent
from aerialdojo_gen.benchmark.agents.goal import BLIND, Goal, Observation, Rules, Sensors
from aerialdojo_gen.benchmark.agents.load import read_options
from aerialdojo_gen.benchmark.agents.simple import BEST_CONSTANT, ConstantAgent, RandomAgent, StopAgent
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.dataset.validate import flights
from aerialdojo_gen.dataset.validate.parts import read_tables, release_of
from aerialdojo_gen.dataset.validate.rows import SceneData
from aerialdojo_gen.geometry.cameras import view_pose
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.planning.flight_space import FlightSpace
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store.schemas import APPROACH, MOVE_UP_1, STOP
from aerialdojo_gen.store.schemas.staged import list_of

CAMERAS = Sensors(("front", "left", "right"), rgb=False, width=48, height=48)


def goal(budget=90, name="red van", image=None, sensors=BLIND):
    text = "A red van by the gate." if image is None else None
    kind = "semantic" if image is None else "image"
    return Goal(kind, name, "clock tower", "north", text, image, Rules(budget, sensors=sensors))


def flown(agent, n):
    return [agent.act(Observation(k, 90 - k)) for k in range(n)]


class Nothing:
    """No agent."""


class Typed(AgentBase):
    """Has a default of every type, and takes no negative number."""

    def __init__(self, needed, n=3, share=0.5, flag=False, name="", seed=None, names=("a",)):
        if n < 0:
            raise ValueError("n is not negative")

    def reset(self, goal): ...

    def act(self, observation): ...


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("oracel", {}, "did you mean 'oracle'"),
        ("nobody", {}, "package.module:Class"),
        ("no_such_module_here:Agent", {}, "cannot load agent .* No module named"),
        (f"{__name__}:Missing", {}, f"module {__name__} has no Missing"),
        (f"{__name__}:Nothing", {}, "it needs reset"),
        (f"{__name__}:CAMERAS", {}, "CAMERAS is no class"),
        ("random", {"sead": 1}, "its options: seed, stop_probability"),
        ("random", {"stop_probability": 2}, "between 0 and 1"),
        ("constant", {"actions": "MoveForward5,MoveBack1"}, "no action 'MoveBack1': there are Stop, MoveForward1, "),
        ("constant", {"actions": [16]}, "no action '16'"),
        (f"{__name__}:Typed", {"needed": 1, "n": -1}, "n is not negative"),
    ],
)
def test_what_cannot_be_made_is_said_in_one_line(name, options, message):
    with pytest.raises(UsageError, match=message) as error:
        load_agent(name, **options)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("option", "text", "value"),
    [
        ("n", "-1", -1), ("share", "2", 2.0), ("flag", "true", True), ("flag", "no", False), ("flag", "1", True),
        ("name", "12", "12"), ("name", "None", "None"), ("name", "[1]", "[1]"), ("name", '"quoted"', "quoted"),
        ("seed", "None", None), ("seed", "null", None), ("seed", "7", 7), ("seed", "words", "words"),
        ("names", '["b", "c"]', ["b", "c"]), ("names", "b,c", "b,c"), ("names", "7", "7"),
        ("needed", "7", 7), ("needed", "words", "words"), ("other", "true", True),
    ],
)  # fmt: skip
def test_options_take_the_types_of_their_defaults(option, text, value):
    read = read_options(f"{__name__}:Typed", {option: text})
    assert read == {option: value}
    assert type(read[option]) is type(value)


@pytest.mark.parametrize(
    ("option", "text", "what"),
    [("n", "1.5", "a whole number"), ("n", "true", "a whole number"), ("n", "None", "a whole number"),
     ("share", "much", "a number"), ("flag", "maybe", "true or false"), ("flag", "2", "true or false")],
)  # fmt: skip
def test_an_option_that_cannot_be_converted_is_named(option, text, what):
    default = {"n": 3, "share": 0.5, "flag": False}[option]
    message = rf"^--option {option}={text}: agent '\S+:Typed' takes {what} here, its default is {default}$"
    with pytest.raises(UsageError, match=message):
        read_options(f"{__name__}:Typed", {option: text})


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({}, [schemas.ACTION_NAMES.index(name) for name in BEST_CONSTANT]),
        ({"actions": "moveup1, 14,MoveForward3"}, [10, 14, 2]),
        ({"actions": [9, "TurnRight15"]}, [9, 15]),
    ],
)
def test_the_constant_agent_does_the_same_whatever_it_is_told_and_then_stops(options, expected):
    agent = ConstantAgent(**options)
    for told in (goal(), goal(name="blue bench", budget=300)):
        agent.reset(told)
        assert flown(agent, 6) == (expected + [schemas.STOP] * 6)[:6]


def test_random_draws_depend_on_seed_and_goal_alone():
    def draws(name="red van", **options):
        agent = RandomAgent(**options)
        agent.reset(goal(name=name))
        return flown(agent, 90)

    assert draws() == draws()
    assert draws() != draws(seed=1)
    assert draws() != draws("blue van")
    assert {a for name in range(20) for a in draws(str(name))} == set(range(16))
    assert 0 not in draws(stop_probability=0.0)
    assert draws(stop_probability=1.0) == flown(StopAgent(), 90) == [0] * 90


class Seer:
    """Depth by casting rays: no renderer, and no share in the explorer's code."""

    def __init__(self, space):
        self._caster = RayCaster(space.scene)
        self._rays = CAMERAS.camera.rays().reshape(-1, 3)

    def look(self, episode, rgb=None):
        depth = {}
        for view in CAMERAS.views:
            pose = view_pose(episode.position, episode.yaw_rad, view)
            along = self._caster.first_hit(pose[:3, 3], self._rays @ pose[:3, :3].T)[0]
            planar = along / np.linalg.norm(self._rays, axis=1)
            planar = np.where(planar <= CAMERAS.max_depth_m, planar, 0.0).astype(np.float32)
            depth[view] = planar.reshape(CAMERAS.height, CAMERAS.width)
        return Observation(episode.n_actions, episode.remaining_actions, episode.refused, rgb or {}, depth)


def test_the_map_knows_a_wall_from_the_open():
    wall = instance("wall", box((5, -9, 0), (6, 9, 6)))
    space = FlightSpace(scene(wall, half=12.0, ceiling=8.0), 0.25)
    episode = Episode(space, (0.0, 0.0, 3.0, 0.0), (9.0, 0.0, 3.0), 90)
    drawn = DepthMap(CAMERAS)
    for view, depth in Seer(space).look(episode).depth_m.items():
        drawn.add(view, depth, 0.0, 0.0, 0.0)
    occupied = np.argwhere(drawn._cells == 2)
    x, y = drawn.point((occupied[:, 0], occupied[:, 1]))
    assert x == pytest.approx(np.full(len(x), 5.0), abs=0.5), "the wall's face, and nothing else"
    assert np.ptp(y) > 8.0
    assert drawn._cells[drawn.cell(3.0, 0.0)] == 1
    assert drawn._cells[drawn.cell(8.0, 0.0)] == 0, "nobody has seen what is behind it"
    way = drawn.way_to_frontier(0.0, 0.0)
    assert math.dist(way[-1], (0.0, 0.0)) > 2.0
    assert max(px for px, _ in way) < 5.0 - 0.5
    drawn.clear()
    assert drawn.way_to_frontier(0.0, 0.0) == []


def test_the_explorer_flies_on_and_touches_nothing(village):
    seer, lengths = Seer(village), []
    for k, start in enumerate([(0.0, -17.0, 2.0), (16.5, 16.5, 3.0), (-16.5, 0.0, 1.5)]):
        if village.in_collision(start):
            continue
        episode = Episode(village, (*start, 0.7 * k), (50.0, 50.0, 2.0), 60)
        agent = ExplorerAgent()
        agent.reset(goal(60, sensors=CAMERAS))
        while episode.termination is None:
            episode.step(agent.act(seer.look(episode)))
        assert (episode.termination, episode.n_actions) == ("stop", 60), "the last action is a Stop"
        moved = complex(*episode.position[:2]) - complex(*start[:2])
        own = complex(*agent._xy_m) * cmath.exp(0.7j * k)
        assert own == pytest.approx(moved, abs=1e-6), "it knows where it is"
        lengths.append(episode.path_length_m)
    assert len(lengths) >= 2
    assert np.mean(lengths) > 15.0


def test_the_explorer_stops_where_the_picture_fits(village):
    picture = np.random.default_rng(0).integers(0, 255, (48, 48, 3)).astype(np.uint8)
    other = np.random.default_rng(1).integers(0, 255, (48, 48, 3)).astype(np.uint8)
    episode = Episode(village, (0.0, -17.0, 2.0, 0.0), (50.0, 50.0, 2.0), 60)
    agent = ExplorerAgent()
    agent.reset(goal(60, image=picture, sensors=CAMERAS))
    assert agent.act(Seer(village).look(episode, {"front": other})) != 0
    assert agent.act(Seer(village).look(episode, {"front": picture})) == 0
    with pytest.raises(UsageError, match="front, left and right"):
        agent.reset(goal(sensors=Sensors(("front",))))


def test_an_agent_in_the_working_directory_is_found_and_takes_no_librarys_place(tmp_path):
    for name in ("mine", "numpy"):
        (tmp_path / f"{name}.py").write_text("class Mine:\n    reset = act = print\n")
    code = "from aerialdojo_gen.benchmark.agents import load_agent as load\nload('mine:Mine')\nload('numpy:Mine')"
    # -P: as a console script has it, whose own folder is first on the path in place of the working directory.
    env = os.environ | {"PYTHONPATH": str(Path(aerialdojo_gen.__file__).parents[1])}
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert done.stderr.strip().endswith("cannot load agent 'numpy:Mine': module numpy has no Mine")


SEMANTIC = Selection(scenes=("U_Courtyard_0",), modalities=("semantic",))
AS_AGENT = Evaluation("r", "oracle", {"actions": "agent_action"}, SEMANTIC)


def test_the_oracle_flies_that_list_and_no_other(planted):
    for side in ("train", "test"):
        lists = [[14, STOP]] * len(planted.rows(f"routes/{side}"))
        set_columns(planted, f"routes/{side}", agent_action=pa.array(lists, list_of(pa.int8())))
    evaluate(planted.data, AS_AGENT)
    steps = read_run(planted.data, "r", "steps").to_pandas()
    assert steps.groupby("task_id").action.apply(list).map(tuple).unique().tolist() == [(14, STOP)]


def test_a_release_without_them_says_so(planted):
    for side in ("train", "test"):
        table = pq.read_table(planted.path(f"routes/{side}"), partitioning=None)
        planted.write_table(f"routes/{side}", table.drop_columns("agent_action"))
    with pytest.raises(StoreError, match=r"^the routes of U_Courtyard_0 in .* have no agent_action.*$"):
        evaluate(planted.data, AS_AGENT)
    with pytest.raises(UsageError, match="routes have the lists action and agent_action, not 'actions'"):
        load_agent("oracle", actions="actions")


def test_an_agents_list_may_be_another_way_but_not_out_of_the_flight_volume(planted):
    """Lists of another form are found by the check's own faults, tests/dataset/test_validate_tables.py."""
    release = release_of(planted.data)
    data = SceneData(planted.scene, release, definitions(), read_tables(release, planted.scene)[0])
    routes, tasks = data["routes"], data["tasks"]
    lists = [[a for a in actions if a != APPROACH] for actions in routes.column("action").to_pylist()]
    budget = dict(zip(tasks.texts("nav_id"), tasks.ints("action_budget").tolist(), strict=True))
    # A turn to and fro before the Stop: other actions, the same place.
    turned = [k for k, nav_id in enumerate(routes.texts("nav_id")) if len(lists[k]) + 2 <= budget[nav_id]]
    assert len(turned) > 20
    lists = [[*a[:-1], 14, 15, STOP] if k in turned else a for k, a in enumerate(lists)]
    lists[turned[0]] = [STOP, *lists[turned[0]]]
    for k in (up := turned[1:9]):
        lists[k] = [MOVE_UP_1] * 30 + [STOP]
    table = with_column(routes.table, "agent_action", pa.array(lists, list_of(pa.int8())))
    found = {f.row: f.found for f in flights.agent_action_fails(data, dataclasses.replace(routes, table=table))}
    assert found.keys() == {turned[0], *up}
    assert "no Stop at its end alone" in found[turned[0]]
    assert any("flight volume" in found[k] for k in up), "others hit something before"
