"""The paper's sample: drawn by rule, carried by the release, and drawn the same where a release does not carry it."""

import json
import shutil

import pytest
from support.handmade import write_rows

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.paper_figures import inventory, splits
from aerialdojo_gen.benchmark.tasks import Selection, select
from aerialdojo_gen.dataset.protocol import SAMPLE, draw_sample, read_sample, sample_shortfall
from aerialdojo_gen.pipeline.stages.work.candidate_policy import train_quotas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import FAMILIES


@pytest.fixture
def release(smoke, tmp_path):
    """A copy of the smoke release's tables."""
    shutil.copytree(smoke / "release", tmp_path / "release")
    return tmp_path


def write_tasks(data, scene, counts):
    """Write the test tasks of a made-up scene: so many of every setting, with either goal."""
    tasks = [(f"{scene}-{setting}{k:03}", setting) for setting, count in counts.items() for k in range(count)]
    rows = (
        {"task_id": f"{nav_id}-{goal[0]}", "nav_id": nav_id, "setting": setting, "modality": goal}
        | {"family": FAMILIES[scene[0]], "partition": store.partition(scene).upper(), "subset": "test"}
        for nav_id, setting in tasks for goal in ("semantic", "image")
    )  # fmt: skip
    write_rows(data, "tasks/test", rows, scene)


def test_a_release_carries_its_sample_and_an_older_one_gives_the_same(smoke, release):
    written = json.loads((smoke / SAMPLE).read_text())
    sample = read_sample(smoke)
    assert written["protocol"] == "paper"
    assert written["tasks"] == {s: {n: list(ids) for n, ids in own.items()} for s, own in sample.tasks.items()}
    assert list(sample.tasks) == ["U_Courtyard_0", "U_Courtyard_1"]
    (release / SAMPLE).unlink()
    assert read_sample(release) == sample
    chosen = select(release, Selection(protocol="paper")).to_pylist()
    assert {row["task_id"] for row in chosen} == sample.ids()
    assert {row["subset"] for row in chosen} == {"test"}
    for row in chosen:
        assert row["task_id"] in sample.tasks[row["scene"]][row["setting"]]
    base = [row["modality"] for row in chosen if (row["scene"], row["setting"]) == ("U_Courtyard_0", "base")]
    assert sorted(base) == ["image"] * 25 + ["semantic"] * 25


def test_two_maps_a_family_that_have_enough_test_tasks_and_fifty_tasks_of_each(tmp_path):
    enough = {"base": 30, "standard": 25, "long_horizon": 3}
    few = {"base": 60, "standard": 24}
    for scene, counts in {
        "U_Mall_0": enough, "U_Park_0": few, "U_Mall_1": few, "U_Park_1": {"base": 70, "standard": 2},
        "N_Coast_0": enough, "N_Coast_1": enough, "N_Forest_1": enough, "D_Flood_1": enough,
    }.items():  # fmt: skip
        write_tasks(tmp_path, scene, counts)
    sample = draw_sample(tmp_path)
    north = ({*sample.tasks} - {"U_Mall_0", "U_Mall_1", "D_Flood_1", "N_Coast_0"}).pop()
    assert north in ("N_Coast_1", "N_Forest_1")
    assert sorted(sample.tasks) == sorted(["U_Mall_0", "U_Mall_1", "D_Flood_1", "N_Coast_0", north])
    sizes = {scene: {setting: len(ids) for setting, ids in own.items()} for scene, own in sample.tasks.items()}
    assert sizes["U_Mall_0"] == sizes[north] == {"base": 50, "standard": 50}
    assert sizes["U_Mall_1"] == {"base": 50, "standard": 48}
    lines = sample.shortfall(sample.tasks)
    assert lines == "smaller than the paper's sample: 5 of 8 maps, none of Infrastructure; 498 of 800 tasks"
    assert sample_shortfall(tmp_path) == lines
    # What another family has changes nothing.
    write_tasks(tmp_path, "D_Flood_0", enough)
    again = draw_sample(tmp_path).tasks
    assert {scene: own for scene, own in again.items() if scene != "D_Flood_0"} == sample.tasks


def test_the_papers_scenes_have_the_whole_sample(project, tmp_path):
    for scene, paper in inventory().items():
        trains = train_quotas(scene, inventory(), splits())
        # More than are drawn change nothing.
        write_tasks(tmp_path, scene, {s: min(26, paper.tasks[s] - trains[s]) for s in ("base", "standard")})
    assert sample_shortfall(tmp_path) == ""
    sample = read_sample(tmp_path)
    assert len(sample.ids()) == 800
    page = (project / "docs" / "evaluate.md").read_text()
    assert all(scene in page for scene in sample.tasks)


def test_the_sample_is_narrowed_and_nothing_else_is_flown(smoke):
    image = select(smoke, Selection(protocol="paper", settings=("base",), modalities=("image",), limit=6)).to_pylist()
    assert len(image) == 6
    assert {row["task_id"] for row in image} < read_sample(smoke).ids()
    for narrow in ({"splits": ("train",)}, {"settings": ("long_horizon",)}):
        with pytest.raises(UsageError, match="no task of the paper's sample, test tasks of base and standard, fits"):
            select(smoke, Selection(protocol="paper", **narrow))
    with pytest.raises(UsageError, match="no protocol 'papers'"):
        Selection(protocol="papers")


def test_a_file_of_other_tasks_and_a_damaged_one_are_refused(release):
    path = release / SAMPLE
    found = json.loads(path.read_text())
    found["tasks"]["U_Courtyard_0"]["base"][0] = "U_Courtyard_0-none-s"
    path.write_text(json.dumps(found))
    with pytest.raises(StoreError, match=r"names 1 tasks of U_Courtyard_0 .* run aerialdojo-gen split"):
        select(release, Selection(protocol="paper"))
    for text in ("{}", '{"tasks": {"U_Courtyard_0": ["a"]}}', '{"tasks": {"U_Courtyard_0": {"base": [1]}}}'):
        path.write_text(text)
        with pytest.raises(StoreError, match=r"protocol.json is damaged: run aerialdojo-gen split"):
            read_sample(release)
