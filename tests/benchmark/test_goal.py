"""What agents are told of a goal, and SR-view: a Stop at any viewpoint with the target in sight is a success."""

import math
import shutil

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.planting import without_columns
from support.walled import VIEWPOINTS, walled, write_walled

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark import AerialDojoEnv
from aerialdojo_gen.benchmark.agents import AgentBase
from aerialdojo_gen.benchmark.agents.goal import BLIND, Goal, Heading, Rules
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.flight import view_of
from aerialdojo_gen.benchmark.llm.options import Options
from aerialdojo_gen.benchmark.llm.prompt import goal_text, system_prompt
from aerialdojo_gen.benchmark.metrics import PROFILES
from aerialdojo_gen.benchmark.registry import report_tables
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.tables import Cut, ReportRequest, as_csv
from aerialdojo_gen.benchmark.tasks import Selection, goal_of, read_tasks, select, texts_of_tasks
from aerialdojo_gen.geometry.frames import compass_direction, compass_heading
from aerialdojo_gen.geometry.motion import TURN_RAD, TURNS
from aerialdojo_gen.learning.trajectories import Trajectories
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.rendering.casters import in_sight
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


AT_3, AT_5 = PROFILES["aerialdojo"], PROFILES["aerialdojo-5m"]
NEW = ("success_view", "viewpoint_distance_m", "target_in_sight", "told")


def flown(data, out, actions, run="r"):
    evaluate(data, Evaluation(run, "constant", {"actions": actions}), out=out)
    return read_run(out, run).to_pandas().set_index("nav_id")


def test_a_stop_is_judged_by_sight_and_by_any_viewpoint(court, tmp_path):
    # Behind a wall and above a roof the paper's rule sees success, and a person none.
    rows = flown(court, tmp_path, "Stop")
    assert (rows.final_distance_m[["behind", "above"]] <= 3.0).all()
    told = rows.loc[["behind", "above", "open"], ["success", "target_in_sight", "success_view"]].to_numpy().tolist()
    assert told == [[True, False, False]] * 2 + [[False, True, False]]
    # Facing west, round the southern end of the wall and under the roof to the crate's western side.
    way = "MoveLeft5,MoveForward5,MoveForward1,MoveForward1,MoveRight3,Stop"
    row = flown(court, tmp_path, way, "around").loc["behind"]
    assert row.final_distance_m == pytest.approx(math.dist((-3.0, -2.0, 0.5), VIEWPOINTS[0]))
    assert row.viewpoint_distance_m == pytest.approx(2.5)
    assert (row.success, row.target_in_sight, row.success_view) == (False, True, True)


def test_no_stop_and_a_collision_are_no_success_however_near(court, tmp_path):
    spun = flown(court, tmp_path, ",".join(["TurnLeft15"] * 90), "spun")
    assert (spun.termination == "budget").all()
    assert not spun.success_view.any()
    # In sight of the target, 1 m from the goal.
    near = flown(court, tmp_path, ",".join(["MoveRight5"] + ["TurnLeft15"] * 89), "near").loc["open"]
    assert (near.termination, near.target_in_sight, near.viewpoint_distance_m) == ("budget", True, pytest.approx(1.0))
    assert (near.success, near.success_view, near.oracle_success) == (False, False, True)
    hit = flown(court, tmp_path, "MoveForward3,Stop", "hit").loc["behind"]
    assert (hit.termination, hit.success_view) == ("collision", False)
    assert math.isfinite(hit.viewpoint_distance_m)
    # The body touches the wall at x = 2.7 with its radius of 0.25 m; the goal is at x = 1.5.
    assert hit.final_distance_m == hit.min_distance_m == pytest.approx(1.45, abs=2e-3)


places = st.tuples(st.floats(-11, 11), st.floats(-11, 11), st.floats(0.1, 7.9))
BOXES = [((2.6, -3.0, 0.0), (2.7, 3.0, 5.0)), ((-4.0, -4.0, 2.6), (2.6, 4.0, 2.7))]


def meets(p, q, low, high):
    """Whether segments from p to every q pass through a box, by its slabs."""
    d = np.where(np.abs(q - p) < 1e-12, 1e-12, q - p)
    a, b = (np.array(low) - p) / d, (np.array(high) - p) / d
    enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    return np.asarray((enter <= leave) & (leave >= 0.0) & (enter <= 1.0))


@given(places)
@settings(max_examples=120)
def test_in_sight_is_what_solid_geometry_says(place):
    # Every point of the crate's surface, densely.
    side = np.linspace(-0.5, 0.5, 15)
    u, v = (w.ravel() for w in np.meshgrid(side, side))
    faces = [np.insert(np.column_stack([u, v]), axis, value, axis=1) for axis in range(3) for value in (-0.5, 0.5)]
    surface = np.concatenate(faces) + np.array([0.0, 0.0, 0.5])
    p = np.array(place)
    crate = ((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0))
    for low, high in np.array([*BOXES, crate]):
        assume(((p < low - 0.05) | (p > high + 0.05)).any())
    seen = ~np.any([meets(p, surface, *ends) for ends in BOXES], axis=0)
    if not seen.any():
        assert not in_sight(_WALLED, "crate", place)
    elif seen.mean() > 0.1:
        assert in_sight(_WALLED, "crate", place)


_WALLED = walled()


def test_the_goal_is_a_viewpoint_in_any_case_and_a_node_that_is_not_there_is_named():
    view = view_of(_WALLED, "crate", np.empty((0, 3)), (1.5, 0.0, 0.5), (1.5, 2.0, 0.5))
    assert (view.viewpoint_distance_m, view.target_in_sight) == (2.0, True)
    farther = view_of(_WALLED, "crate", np.array([[9.0, 9.0, 0.5]]), (1.5, 0.0, 0.5), (1.5, 2.0, 0.5))
    assert farther.viewpoint_distance_m == 2.0
    with pytest.raises(StoreError, match="U_Walled_0 has no node 'barrel'"):
        in_sight(_WALLED, "barrel", (0.0, 0.0, 5.0))


def test_a_release_without_viewpoints_has_no_such_rate_and_with_them_is_other_data(court, tmp_path, capsys):
    data, job = write_walled(tmp_path, viewpoints=False), Evaluation("r", "stop")
    evaluate(data, job, reporter=Reporter())
    said = [line for line in capsys.readouterr().err.splitlines() if "viewpoints/" in line]
    assert said == ["the release has no viewpoints/, which an older version did not write: SR-view stays empty"]
    rows = read_run(data, "r")
    assert [rows[name].null_count for name in NEW] == [3, 3, 3, 0]
    (overall,) = report_tables(ReportRequest(open_root(data), load_runs(data), [AT_3]), ["overall"])
    assert "SR-view ↑" not in overall.groups[1][1]
    assert any(note.startswith("No SR-view of stop: flown by an older version or on a") for note in overall.notes)
    shutil.copytree(court / "release" / "viewpoints", data / "release" / "viewpoints")
    with pytest.raises(UsageError, match="run 'r' was begun with other data"):
        evaluate(data, job)


@pytest.fixture(scope="module")
def viewed_smoke(smoke, tmp_path_factory):
    """The log of three agents on the smoke release."""
    out = tmp_path_factory.mktemp("viewed")
    for agent in ("oracle", "random", "constant"):
        evaluate(smoke, Evaluation(agent, agent, selection=Selection(modalities=("semantic",), limit=60)), out=out)
    return out


def test_relations_hold_on_real_episodes(viewed_smoke):
    for run in load_runs(viewed_smoke):
        rows = run.table.to_pandas()
        near = rows.viewpoint_distance_m <= 3.0
        assert (rows.viewpoint_distance_m <= rows.final_distance_m + 1e-12).all()
        assert (rows.success_view == ((rows.termination == "stop") & near & rows.target_in_sight)).all()
        if run.agent == "oracle":
            assert rows.success.all()
            assert rows.target_in_sight.mean() > 0.95


def test_the_report_has_it_beside_sr_with_intervals(viewed_smoke):
    runs = load_runs(viewed_smoke, ["random"])
    wanted = ReportRequest(open_root(viewed_smoke), runs, [AT_3, AT_5])
    for table in report_tables(wanted, ["overall", "results", "family", "goal", "difficulty"]):
        heads = [head for _, names in table.groups for head in names if head in ("SR ↑", "SR-view ↑")]
        assert heads[::2] == ["SR ↑"] * (len(heads) // 2)
        assert heads[1::2] == ["SR-view ↑"] * (len(heads) // 2)
    # The smoke scenes are of one family.
    scenes = runs[0].table.to_pandas().groupby("scene").success_view.mean()
    assert wanted.score(Cut(profile=AT_3)).sr_view == pytest.approx(scenes.mean())


def test_a_log_of_an_older_version_is_reported_beside_a_new_one(viewed_smoke, tmp_path):
    shutil.copytree(viewed_smoke / "episodes", tmp_path / "episodes")
    shutil.copytree(viewed_smoke / "failures", tmp_path / "failures")
    for path in (tmp_path / "episodes" / "random").glob("*.parquet"):
        without_columns(path, NEW)
    runs = load_runs(tmp_path, ["random", "constant"])
    (overall,) = report_tables(ReportRequest(open_root(tmp_path), runs, [AT_3]), ["overall"])
    at = overall.groups[1][1].index("SR-view ↑") + len(overall.groups[0][1])
    cells = dict(overall.rows)
    assert cells["random"][at] == "–"
    assert cells["random"][at - 1] != "–"
    assert cells["constant"][at] != "–"
    assert sum("No SR-view of random:" in note for note in overall.notes) == 1
    assert runs[0].hints == ""
