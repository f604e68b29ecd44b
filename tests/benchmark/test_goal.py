"""What agents are told of a goal: picture and its distance, descriptions of its side, and the heading where asked."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark import AerialDojoEnv
from aerialdojo_gen.benchmark.agents import AgentBase
from aerialdojo_gen.benchmark.agents.goal import BLIND, Goal, Heading, Rules
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.llm.options import Options
from aerialdojo_gen.benchmark.llm.prompt import goal_text, system_prompt
from aerialdojo_gen.benchmark.metrics import PROFILES
from aerialdojo_gen.benchmark.registry import report_tables
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.tables import ReportRequest, as_csv
from aerialdojo_gen.benchmark.tasks import Selection, goal_of, read_tasks, select, texts_of_tasks
from aerialdojo_gen.geometry.frames import compass_direction, compass_heading
from aerialdojo_gen.geometry.motion import TURN_RAD, TURNS
from aerialdojo_gen.learning.trajectories import Trajectories
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.schemas import TURN_LEFT, TURN_RIGHT

SCENE = "U_Courtyard_1"
CHOICE = {"scene": SCENE, "modality": "semantic", "views": ()}


def test_the_distance_leads_from_the_pictures_place_to_the_goal(smoke):
    root = open_root(smoke)
    objects = pd.read_parquet(smoke / "release/objects").set_index(["scene", "object_id"])
    distances = set()
    for task in read_tasks(root, select(root, Selection())):
        goal = goal_of(root, task, Rules(task.row["action_budget"]))
        far = goal.image_distance_m
        if goal.modality == "semantic":
            assert far is None
            continue
        distances.add(far)
        target = objects.loc[(task.row["scene"], task.target_id)]
        yaw = target["reference_yaw_rad"]
        place = np.array([target[f"reference_{axis}_m"] for axis in "xyz"])
        assert place + far * np.array([np.cos(yaw), np.sin(yaw), 0.0]) == pytest.approx(task.goal, abs=1e-6)
        said = f"from {far:g} m behind the goal viewpoint" if far else "from the goal viewpoint in front of it:"
        assert said in goal_text(goal)
        assert not far or f"the goal viewpoint is {far:g} m ahead of that camera" in goal_text(goal)
    assert {bool(far) for far in distances} == {True, False}


def drawn(env, episodes=12):
    return [env.reset(seed=None if k else 5)[0]["goal"]["description"] for k in range(episodes)]


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
    sides = [{*sum(texts_of_tasks(open_root(smoke), SCENE, side).values(), ())} for side in ("train", "test")]
    assert all(sides)
    assert not sides[0] & sides[1]
    assert len(set(drawn(AerialDojoEnv(smoke, split="ood_test", limit=1, **CHOICE)))) == 1


def test_trajectories_draw_by_their_seed(smoke):
    how = {"views": (), "rgb": False, "depth": False, "scene": SCENE, "paraphrase": "random"}
    texts = [Trajectories(smoke, "train", seed=seed, **how).index.goal_columns["description"] for seed in (1, 1, 2)]
    assert texts[0] == texts[1] != texts[2]


class Listener(AgentBase):
    """Keeps the goals that it is told, and stops."""

    sensors = BLIND
    heard: list[Goal] = []  # noqa: RUF012 (the runner makes the instance)

    def reset(self, goal):
        self.heard.append(goal)

    def act(self, observation):
        return 0


@given(st.floats(-20.0, 20.0))
def test_a_compass_shows_the_way_that_a_yaw_looks(yaw_rad):
    word, degrees = compass_heading(yaw_rad)
    assert 0 <= degrees < 360
    # North is +y, east +x: the heading's own vector is the yaw's, to half a degree.
    east, north = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    assert east * math.cos(yaw_rad) + north * math.sin(yaw_rad) >= math.cos(math.radians(0.5)) - 1e-9
    assert word == compass_direction(east, north)


def test_a_model_is_told_what_turns_do_to_the_heading():
    goal = Goal("semantic", "van", "tower", "north", "A van.", None, Rules(90), Heading("east", 90))
    # After a turn by the motion model, from a yaw that faces east.
    right, left = (compass_heading(TURNS[action] * TURN_RAD)[1] for action in (TURN_RIGHT, TURN_LEFT))
    assert (right, left) == (105, 75)
    assert "(0° is north, 90° east). Turning right adds, turning left takes away." in goal_text(goal)


def test_a_heading_is_told_where_it_is_asked_for_and_logged(court, tmp_path):
    me = f"{__name__}:Listener"
    evaluate(court, Evaluation("plain", me), out=tmp_path)
    evaluate(court, Evaluation("told", me, hints=("heading",)), out=tmp_path)
    # The tasks look west.
    assert [goal.heading for goal in Listener.heard] == [None] * 3 + [Heading("west", 270)] * 3
    plain, told = Listener.heard[0], Listener.heard[3]
    assert "faces west: a compass would show 270°" in goal_text(told)
    assert "compass" not in goal_text(plain)
    options = Options(model="m")
    assert "no compass. Find" in system_prompt(plain, options)
    assert "no compass, but you are told which way the drone faces at the start. Find" in system_prompt(told, options)
    runs = load_runs(tmp_path, ["plain", "told"])
    assert [read_run(tmp_path, name)["told"].to_pylist() for name in ("plain", "told")] == [[""] * 3, ["heading"] * 3]
    request = ReportRequest(open_root(court), runs, [PROFILES["aerialdojo"]])
    (overall,) = report_tables(request, ["overall"])
    assert [(label, row[1]) for label, row in overall.rows] == [(me, "none"), (f"{me} + heading", "heading")]
    last = {line.split(",")[0]: line.split(",")[-1] for line in as_csv(request).splitlines()}
    assert last == {"run": "told", "plain": "", "told": "heading"}
    with pytest.raises(UsageError, match=r"run 'plain' was begun with tell = \[\], not \['heading'\]: give"):
        evaluate(court, Evaluation("plain", me, hints=("heading",)), out=tmp_path)
    with pytest.raises(UsageError, match="no hint 'headings': did you mean 'heading'"):
        Evaluation("r", "stop", hints=("headings",))


def test_the_environment_observes_a_heading(court):
    plain, told = (AerialDojoEnv(court, views=(), tell=tell) for tell in ((), "heading"))
    assert "heading" not in plain.reset()[0]["goal"]
    seen = told.reset()[0]
    assert told.observation_space.contains(seen)
    assert (int(seen["goal"]["heading"]), seen["goal"]["heading_deg"].tolist()) == (4, [270])
