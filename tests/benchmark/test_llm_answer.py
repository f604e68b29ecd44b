"""Answers of a model, read strictly; the prompt; the pictures."""

import base64
import json

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aerialdojo_gen.base.pictures import colour_picture, depth_picture
from aerialdojo_gen.benchmark.agents.base import InvalidAnswer
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Rules, Sensors
from aerialdojo_gen.benchmark.llm.answer import SIXTEEN, eight, parse_answer
from aerialdojo_gen.benchmark.llm.options import Options
from aerialdojo_gen.benchmark.llm.prompt import Turn, goal_text, repair_text, step_text, system_prompt
from aerialdojo_gen.store.schemas import ACTION_NAMES, APPROACH


@pytest.mark.parametrize(
    "text",
    [
        '  \n{"action": "Stop"}\n',
        '```json\n{"action": "Stop"}\n```',
        '<think>It is there.\n{"action": "MoveUp1"}</think>\n\n{"action": "Stop", "thought": "there"}',
    ],
)
def test_wrappings_that_are_not_part_of_the_answer_come_off(text):
    assert parse_answer(text).action == "Stop"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "it is empty"),
        ("Stop", "not one JSON object"),
        ('{"action": "Stop"} That is all.', "not one JSON object"),
        ('["Stop"]', "JSON, but no object: list"),
        ("{}", "action: Field required"),
        ('{"action": 0}', "action: Input should be a valid string"),
        ('{"action": "stop"}', "'stop' is none of the actions"),
        ('{"action": "Approach"}', "'Approach' is none of the actions"),
        ('{"action": "Stop", "confidence": 1}', "confidence: Extra inputs are not permitted"),
        ('{"action": "Stop", "action": "MoveUp1"}', "duplicate key"),
        ("[" * 10_000, "not one JSON object"),
        ('{"thought": ' + "9" * 5_000 + ', "action": "Stop"}', "not one JSON object .*digits"),
        ('{"thought": 1e999, "action": "Stop"}', "thought: Input should be a valid string"),
        ('{"thought": NaN, "action": "Stop"}', "NaN is no number of JSON"),
        ('{"thought": "\\ud800", "action": "Stop"}', "half of a surrogate pair|valid string"),
        ('{"\\ud800": 1, "action": "Stop"}', "Extra inputs|surrogate|valid string"),
        (" " * 20_001, "20,001 characters"),
    ],
)
def test_anything_else_is_refused_with_the_reason(text, why):
    with pytest.raises(InvalidAnswer, match=why.replace("(", r"\(")) as refused:
        parse_answer(text)
    # The reason goes back to the model, over HTTP.
    assert len(repair_text(str(refused.value)).encode("utf-8")) < 2_000


@given(st.text(max_size=60) | st.recursive(st.none() | st.text(), st.lists, max_leaves=5).map(json.dumps))
def test_no_text_is_guessed_at(text):
    with pytest.raises(InvalidAnswer):
        parse_answer(text)


RULES = Rules(180, 3.0, 0.25, 0.25, Sensors(("front",)))
SEMANTIC = Goal("semantic", "red van", "clock tower", "northeast", "A red van by a hedge.", None, RULES)
IMAGE = Goal("image", "red van", "clock tower", "northeast", None, np.zeros((4, 4, 3), np.uint8), RULES)


def test_the_prompt_holds_what_appendix_a_asks_for():
    prompt = system_prompt(SEMANTIC, Options(model="m"))
    for words in (
        *(f"- {name}: " for name in ACTION_NAMES[:APPROACH]), "fly 5 m forward", "turn 15° to the left", "sink 2 m",
        "wheelbase of 0.25 m", "within 3 m", "budget of 180 actions", "black at 0 m to white at 50 m",
        "640 x 640 pixels", "picture of the step before is shown again", json.dumps(SIXTEEN.schema()),
    ):  # fmt: skip
        assert words in prompt
    assert "left (looks" not in prompt
    assert "Approach" not in prompt
    assert "depth" not in system_prompt(SEMANTIC, Options(model="m", depth=False))
    assert "shown again" not in system_prompt(SEMANTIC, Options(model="m", history_images=0))
    # Its own example of an answer is one, once the blanks are filled: with any of the actions.
    for k, name in enumerate(ACTION_NAMES[:APPROACH]):
        example = prompt.splitlines()[-1].replace("<one name from the list above>", name)
        assert SIXTEEN.ids[parse_answer(example).action] == k


def test_the_papers_eight_actions_have_common_magnitudes():
    actions = eight(5, 2)
    assert {name: ACTION_NAMES[k] for name, k in actions.ids.items()} == {
        "Stop": "Stop", "MoveForward": "MoveForward5", "MoveLeft": "MoveLeft5", "MoveRight": "MoveRight5",
        "MoveUp": "MoveUp2", "MoveDown": "MoveDown2", "TurnLeft": "TurnLeft15", "TurnRight": "TurnRight15",
    }  # fmt: skip
    options = Options(model="m", actions="eight", move_m=5, climb_m=2)
    prompt = system_prompt(SEMANTIC, options)
    assert "- MoveForward: fly 5 m forward" in prompt
    assert "MoveForward5" not in prompt
    assert parse_answer('{"action": "MoveUp"}', actions.names).action == "MoveUp"
    with pytest.raises(InvalidAnswer, match="'MoveUp2' is none of the actions"):
        parse_answer('{"action": "MoveUp2"}', actions.names)
    assert 'Call the tool "act"' in system_prompt(SEMANTIC, options, "tool")


def test_the_goal_is_told_as_its_modality_has_it_and_a_step_tells_the_budget_the_history_and_a_refusal():
    assert goal_text(SEMANTIC).endswith("Description: A red van by a hedge.")
    for goal in (SEMANTIC, IMAGE):
        assert "TARGET: red van. It lies northeast of the landmark nearest to it: clock tower." in goal_text(goal)
    assert "None" not in goal_text(IMAGE)
    turns = [Turn(5, "MoveUp1", "Higher."), Turn(6, None)]
    said = step_text(Observation(7, 173, refused=True), turns)
    assert "- step 5: MoveUp1. Higher." in said
    assert "- step 6: none (the answer could not be read)" in said
    assert "was refused" in said
    assert "step 7; 173 actions left" in said
    assert step_text(Observation(0, 180), []).startswith("NOW: step 0; 180 actions left")


def decoded(picture, flag):
    return cv2.imdecode(np.frombuffer(base64.b64decode(picture.base64), np.uint8), flag)


@given(arrays(np.float32, (6, 9), elements=st.floats(0.0, 65.0, width=32)))
def test_depth_comes_back_from_its_picture_as_the_prompt_says(depth_m):
    depth_m[0, 0] = np.inf
    grey = decoded(depth_picture(depth_m, 50.0, 64), cv2.IMREAD_UNCHANGED)
    assert (grey.shape, grey.dtype) == (depth_m.shape, np.uint8)
    near = (depth_m > 0) & (depth_m < 50)
    assert np.abs(grey[near] / 255 * 50.0 - depth_m[near]).max(initial=0.0) <= 50 / 255 / 2 + 1e-5
    assert (grey[(depth_m == 0) | (depth_m >= 50)] == 255).all()


def test_pictures_keep_their_colours_and_are_scaled_down_but_never_up():
    rgb = np.zeros((100, 200, 3), np.uint8)
    rgb[:, :100] = (250, 10, 10)
    small = cv2.cvtColor(decoded(colour_picture(rgb, 50), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert small.shape == (25, 50, 3)
    assert np.abs(small[12, 5].astype(int) - (250, 10, 10)).max() < 12
    assert np.abs(small[12, 45].astype(int)).max() < 12
    assert decoded(colour_picture(rgb, 640), cv2.IMREAD_COLOR).shape == (100, 200, 3)
    assert colour_picture(rgb, 50).data_url.startswith("data:image/jpeg;base64,/9j/")
