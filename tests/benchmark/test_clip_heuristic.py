"""The agent clip: CLIP-H's rule, by a CLIP of a few bytes that knows colours."""

import json

import numpy as np
import pytest
from support.command_line import called
from support.tiny_clip import write_clip

from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.benchmark.agents import load_agent
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Rules, Sensors
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.store.schemas import ACTION_NAMES

RED, REDDISH, GREY, BLUE = (220, 30, 30), (200, 120, 120), (128, 128, 128), (30, 40, 210)
CAMERAS = Sensors(width=16, height=16)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return write_clip(tmp_path_factory.mktemp("clip"))


def agent_of(clip, **options):
    paths = {name: str(getattr(clip, name)) for name in ("vision", "text", "tokenizer")}
    return load_agent("clip", **paths, **options)


def begun(clip, image=None, sensors=CAMERAS, **options):
    """An agent at the start of an episode; it stops at nothing that is not asked for."""
    agent = agent_of(clip, **{"stop": 2.0, "stop_image": 2.0} | options)
    words = None if image is not None else "a red post"
    kind = "semantic" if image is None else "image"
    agent.reset(Goal(kind, "post", "gate", "north", words, image, Rules(90, sensors=sensors)))
    return agent


def plain(colour):
    return np.full((16, 16, 3), colour, np.uint8)


def seen(front=GREY, left=GREY, right=GREY, down=GREY, depth_m=40.0, refused=False):
    colours = {"front": front, "left": left, "right": right, "down": down}
    return Observation(
        0, 90, refused, {view: plain(colour) for view, colour in colours.items()},
        {view: np.full((16, 16), depth_m, np.float32) for view in colours},
    )  # fmt: skip


def done(agent, *args, **kw):
    return ACTION_NAMES[agent.act(seen(*args, **kw))]


def test_it_moves_towards_the_view_that_fits_the_goal(clip):
    agent = begun(clip, move_m=3)
    assert done(agent, front=RED, left=BLUE) == "MoveForward3"
    assert done(agent, left=RED) == "MoveLeft3"
    assert agent.answer().startswith("front ")
    assert done(agent, down=RED) == "MoveDown1"
    assert done(agent, down=RED, right=REDDISH) == "MoveDown1"
    assert done(begun(clip, image=plain(BLUE)), front=RED, right=BLUE) == "MoveRight1"


def test_it_does_not_go_back_sideways_and_moves_down_only_where_nothing_is_near(clip):
    agent = begun(clip)
    assert done(agent, left=RED) == "MoveLeft1"
    assert done(agent, right=RED, front=REDDISH) == "MoveForward1"
    assert done(agent, right=RED, front=REDDISH) == "MoveRight1"
    for depth_m, action in ((40.0, "MoveDown1"), (0.0, "MoveDown1"), (5.0, "MoveForward1")):
        assert done(begun(clip), down=RED, front=REDDISH, depth_m=depth_m) == action


def test_it_stops_where_a_view_fits_well_enough(clip):
    assert done(begun(clip, stop=0.9), right=RED) == "Stop"
    assert done(begun(clip, stop=0.9), right=GREY) != "Stop"
    assert done(begun(clip, image=plain(RED), stop_image=0.99), left=RED) == "Stop"


def test_it_turns_at_the_edge_of_its_square(clip):
    agent = begun(clip, boundary_m=3.0)
    flown = [done(agent, front=RED) for _ in range(10)]
    # Three metres ahead, turns to the left until a step leads no further out.
    assert flown == ["MoveForward1"] * 3 + ["TurnLeft15"] * 6 + ["MoveForward1"]
    assert done(begun(clip), front=RED, refused=True) == "TurnLeft15"


def test_with_a_clearance_it_takes_the_next_best_view(clip):
    walled = seen(front=RED, left=REDDISH, depth_m=1.5)
    assert ACTION_NAMES[begun(clip).act(walled)] == "MoveForward1"
    open_left = Observation(0, 90, False, walled.rgb, dict(walled.depth_m) | {"left": np.zeros((16, 16), np.float32)})
    assert ACTION_NAMES[begun(clip, clearance_m=0.8).act(open_left)] == "MoveLeft1"
    assert ACTION_NAMES[begun(clip, clearance_m=0.8).act(walled)] == "TurnLeft15"


def test_what_it_cannot_do_without_is_named(clip):
    with pytest.raises(UsageError, match=r"agent 'clip': missing a required argument: 'text'; its options: vision"):
        load_agent("clip", vision="x.onnx")
    with pytest.raises(AssetError, match=r"nowhere\.onnx does not exist"):
        load_agent("clip", vision="nowhere.onnx", text="nowhere.onnx", tokenizer="tokenizer.json")
    with pytest.raises(UsageError, match="move_m is 1, 3 or 5, not 2"):
        agent_of(clip, move_m=2)
    with pytest.raises(UsageError, match="needs pictures and depth"):
        begun(clip, sensors=Sensors(("left",), width=16, height=16))


def test_it_flies_by_the_command(clip, smoke, tmp_path):
    paths = [f"{name}={getattr(clip, name)}" for name in ("vision", "text", "tokenizer")]
    given = [word for option in [*paths, "stop=0.99"] for word in ("--option", option)]
    size = ("--width", "32", "--height", "32", "--limit", "2", "--workers", "1", "--setting", "base")
    told = called("evaluate", "--agent", "clip", *given, *size, "--data", smoke, "--out", tmp_path)
    assert told.returncode == 0, told.stderr
    assert "clip: vision.onnx, text.onnx: embeddings of 3 numbers" in told.stderr
    options = json.loads(read_run(tmp_path, "clip")["agent_options"][1].as_py())
    assert (options["stop"], len(options["sha256"])) == (0.99, 64)
    steps = read_run(tmp_path, "clip", "steps")
    assert all(answer.startswith("front ") for answer in steps["answer"].to_pylist())
