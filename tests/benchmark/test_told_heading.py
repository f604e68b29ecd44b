"""--tell heading: agents are told which way they face at the start, where it is asked for, and runs never mix."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark import AerialDojoEnv
from aerialdojo_gen.benchmark.agents import AgentBase
from aerialdojo_gen.benchmark.agents.goal import BLIND, Goal, Heading, Observation, Rules
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.llm.options import Options
from aerialdojo_gen.benchmark.llm.prompt import goal_text, system_prompt
from aerialdojo_gen.benchmark.metrics import PROFILES
from aerialdojo_gen.benchmark.registry import report_tables
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.score_rows import as_csv
from aerialdojo_gen.benchmark.tables import ReportRequest
from aerialdojo_gen.geometry.frames import compass_direction, compass_heading
from aerialdojo_gen.geometry.motion import TURN_RAD, TURNS
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.schemas import TURN_LEFT, TURN_RIGHT

ME = f"{__name__}:Listener"


class Listener(AgentBase):
    """Keeps the goals that it is told, and stops."""

    sensors = BLIND
    heard: list[Goal] = []  # noqa: RUF012 (the runner makes the instance)

    def reset(self, goal: Goal) -> None:
        self.heard.append(goal)

    def act(self, observation: Observation) -> int:
        return 0


@given(st.floats(-20.0, 20.0))
def test_a_compass_shows_the_way_that_a_yaw_looks(yaw_rad: float) -> None:
    word, degrees = compass_heading(yaw_rad)
    assert isinstance(degrees, int)
    assert 0 <= degrees < 360
    # North is +y, east +x: the heading's own vector is the yaw's, to half a degree.
    ahead = math.sin(math.radians(degrees)) * math.cos(yaw_rad) + math.cos(math.radians(degrees)) * math.sin(yaw_rad)
    assert ahead >= math.cos(math.radians(0.5)) - 1e-9
    assert word == compass_direction(math.sin(math.radians(degrees)), math.cos(math.radians(degrees)))


@pytest.mark.parametrize(
    ("yaw_deg", "told"), [(90, ("north", 0)), (0, ("east", 90)), (180, ("west", 270)), (-135, ("southwest", 225))]
)
def test_known_headings(yaw_deg: float, told: tuple[str, int]) -> None:
    assert compass_heading(math.radians(yaw_deg)) == told


def test_a_model_is_told_what_turns_do_to_the_heading() -> None:
    goal = Goal("semantic", "van", "tower", "north", "A van.", None, Rules(90), Heading("east", 90))
    # After a turn by the motion model, from a yaw that faces east.
    right, left = (compass_heading(TURNS[action] * TURN_RAD)[1] for action in (TURN_RIGHT, TURN_LEFT))
    assert (right, left) == (105, 75)
    assert "(0° is north, 90° east). Turning right adds, turning left takes away." in goal_text(goal)


def test_it_is_told_where_it_is_asked_for_and_logged(court: Path, tmp_path: Path) -> None:
    Listener.heard.clear()
    evaluate(court, Evaluation("plain", ME), out=tmp_path)
    evaluate(court, Evaluation("told", ME, hints=("heading",)), out=tmp_path)
    # The tasks look west.
    assert [goal.heading for goal in Listener.heard] == [None] * 3 + [Heading("west", 270)] * 3
    plain, told = Listener.heard[0], Listener.heard[3]
    assert "faces west: a compass would show 270°" in goal_text(told)
    assert goal_text(told).endswith("Description: A crate.")
    assert "compass" not in goal_text(plain)
    options = Options(model="m")
    assert "no compass. Find" in system_prompt(plain, options)
    assert "no compass, but you are told which way the drone faces at the start. Find" in system_prompt(told, options)
    assert read_run(tmp_path, "plain")["told"].to_pylist() == [""] * 3
    assert read_run(tmp_path, "told")["told"].to_pylist() == ["heading"] * 3
    runs = load_runs(tmp_path, ["plain", "told"])
    assert [run.label for run in runs] == [ME, f"{ME} + heading"]
    request = ReportRequest(open_root(court), runs, [PROFILES["aerialdojo"]])
    (overall,) = report_tables(request, ["overall"])
    assert [(label, row[1]) for label, row in overall.rows] == [(ME, "none"), (f"{ME} + heading", "heading")]
    last = {line.split(",")[0]: line.split(",")[-1] for line in as_csv(request).splitlines()}
    assert last == {"run": "told", "plain": "", "told": "heading"}


def test_a_run_with_it_never_mixes_with_one_without(court: Path, tmp_path: Path) -> None:
    evaluate(court, Evaluation("r", "stop"), out=tmp_path)
    with pytest.raises(UsageError, match=r"run 'r' was begun with tell = \[\], not \['heading'\]: give"):
        evaluate(court, Evaluation("r", "stop", hints=("heading",)), out=tmp_path)
    evaluate(court, Evaluation("r", "stop", hints=("heading",)), out=tmp_path, restart=True)
    with pytest.raises(UsageError, match=r"begun with tell = \['heading'\], not \[\]"):
        evaluate(court, Evaluation("r", "stop"), out=tmp_path)
    with pytest.raises(UsageError, match="no hint 'headings': did you mean 'heading'"):
        Evaluation("r", "stop", hints=("headings",))


def test_the_environment_observes_it(court: Path) -> None:
    plain, told = (AerialDojoEnv(court, views=(), tell=tell) for tell in ((), "heading"))
    assert "heading" not in plain.reset()[0]["goal"]
    seen = told.reset()[0]
    assert told.observation_space.contains(seen)
    assert (int(seen["goal"]["heading"]), seen["goal"]["heading_deg"].tolist()) == (4, [270])
