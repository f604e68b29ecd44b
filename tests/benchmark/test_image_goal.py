"""What an image goal's picture shows, and from where: agents are told how far behind the goal it was taken."""

import numpy as np
import pandas as pd
import pytest

from aerialdojo_gen.benchmark.agents.goal import Rules
from aerialdojo_gen.benchmark.llm.prompt import goal_text
from aerialdojo_gen.benchmark.tasks import Selection, goal_of, read_tasks, select
from aerialdojo_gen.store.root import open_root


@pytest.fixture(scope="module")
def flown(smoke):
    """Tasks of the smoke release with their goals and their targets' rows of `objects`."""
    root = open_root(smoke)
    tasks = read_tasks(root, select(root, Selection()))
    objects = pd.read_parquet(smoke / "release/objects").set_index(["scene", "object_id"])
    return [
        (t, goal_of(root, t, Rules(t.row["action_budget"])), objects.loc[(t.row["scene"], t.target_id)])
        for t in tasks
    ]


def test_the_distance_leads_from_the_pictures_place_to_the_goal(flown):
    seen = 0
    for task, goal, target in flown:
        if goal.modality == "semantic":
            assert goal.image_distance_m is None
            continue
        seen += 1
        place = np.array([target[f"reference_{axis}_m"] for axis in "xyz"])
        yaw = target["reference_yaw_rad"]
        ahead = place + goal.image_distance_m * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        assert ahead == pytest.approx(task.goal, abs=1e-6)
        assert np.linalg.norm(place - task.goal) == pytest.approx(goal.image_distance_m, abs=1e-6)
    assert seen > 10


def test_the_prompt_says_how_far_behind_the_goal_the_picture_was_taken(flown):
    images = [goal for _, goal, _ in flown if goal.modality == "image"]
    assert {bool(goal.image_distance_m) for goal in images} == {True, False}
    for goal in images:
        text = goal_text(goal)
        if goal.image_distance_m:
            assert f"from {goal.image_distance_m:g} m behind the goal viewpoint" in text
            assert f"the goal viewpoint is {goal.image_distance_m:g} m ahead of that camera" in text
        else:
            assert text.endswith("from the goal viewpoint in front of it:")
