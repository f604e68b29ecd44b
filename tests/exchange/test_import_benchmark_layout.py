"""The authors' layout as it comes: split names of two documents, fields missing, files out of their tree."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support import task_files
from support.task_files import authors as document
from support.task_files import put_authors as put

from aerialdojo_gen.base.errors import ImportRefused
from aerialdojo_gen.exchange.importing import Options, import_benchmark
from aerialdojo_gen.geometry.frames import wrap_angle_rad


@pytest.mark.parametrize("split", ["IID_TRAINS", "ID_TRAINS"])
def test_a_file_of_theirs_is_read_with_what_it_lacks(tmp_path, split):
    put(tmp_path / "root", *document(turn_deg=15), split)
    report = import_benchmark("aerialdojo", [tmp_path / "root"], tmp_path)
    task = pd.read_parquet(tmp_path / "imported/aerialdojo/tasks").iloc[0]
    route = pd.read_parquet(tmp_path / "imported/aerialdojo/routes").iloc[0]
    assert task[["scene", "family", "scene_type", "partition", "subset", "setting"]].tolist() == [
        "N_Island_0", "Natural", "Island", "ID", "train", "base",
    ]  # fmt: skip
    assert task[["target_name", "landmark", "description"]].tolist() == ["TowerActor", "wooden pier", "A stone tower"]
    # Heading 0 is north; a metre forward is a metre north; rotr turns towards east.
    assert route["y_m"].tolist() == [0, 1, 1]
    assert route["z_m"].tolist() == [3, 3, 3]
    assert route["action"].tolist() == [1, 15, 0]
    assert route["source_action"].tolist() == ["start", "forward", "rotr"]
    assert float(wrap_angle_rad(route["yaw_rad"][2] - route["yaw_rad"][1])) == pytest.approx(-0.2617993878, abs=1e-9)
    assert route["replay_error_m"] == pytest.approx(0, abs=1e-12)
    # The goal is missing in the task: it is where the trajectory ends.
    assert route[["goal_x_m", "goal_y_m", "goal_z_m"]].tolist() == [0, 1, 3]
    assert report.notes == {"task_id names no pair of objects: their numbers are null": 1}
    assert pd.isna(route["start_object_id"])


def test_a_turn_of_another_size_is_none_of_ours(tmp_path):
    put(tmp_path / "root", *document())
    report = import_benchmark("aerialdojo", [tmp_path / "root"], tmp_path)
    route = pd.read_parquet(tmp_path / "imported/aerialdojo/routes").iloc[0]
    assert route["action"] is None
    assert route["yaw_rad"].tolist()[2] == pytest.approx(route["yaw_rad"][1] - 1.0471975512)
    assert "has moves that are none of ours: action is null, source_action has them" in report.notes


def test_the_evaluators_name_of_the_quaternion_is_read_too(tmp_path):
    tasks, trajectory = document()
    pose = tasks[0]["start_pose"]
    pose["start_quaternionr"] = pose.pop("start_quaternion_xyzw")
    put(tmp_path / "root", tasks, trajectory)
    assert import_benchmark("aerialdojo", [tmp_path / "root"], tmp_path).records == 1


def test_a_task_file_out_of_its_tree_has_tasks_without_routes(tmp_path):
    path = put(tmp_path / "root", *document())
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    names = []
    for folder in ("a", "b"):
        lone = shutil.copy(path, tmp_path / folder / "mine.json")
        report = import_benchmark("aerialdojo", [Path(lone)], tmp_path, name=folder)
        assert report.rows == {"tasks": 1, "routes": 1, "objects": 1}
        names.append(pd.read_parquet(tmp_path / "imported" / folder / "tasks")["task_id"].tolist())
    # Whatever folder it lies in.
    assert names[0] == names[1]
    route = pd.read_parquet(tmp_path / "imported/a/routes").iloc[0]
    assert route["x_m"] is None
    assert json.loads((tmp_path / "imported/a/import.json").read_text())["files"] == ["mine.json"]


@pytest.mark.parametrize("name", ["../outside", "/etc", "a b", ""])
def test_a_scene_name_is_a_plain_one_wherever_the_file_lies(tmp_path, name):
    tasks, _ = document()
    path = task_files.write(tmp_path / "mine.json", [*tasks, tasks[0] | {"episode_id": "7", "map_name": name}])
    with pytest.raises(ImportRefused, match=r"mine\.json: row 1: map_name: "):
        import_benchmark("aerialdojo", [path], tmp_path)


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_whatever_stands_in_a_task_or_its_trajectory_is_read_or_named(tmp_path, data):
    tasks, trajectory = document()
    target = data.draw(st.sampled_from([tasks[0], tasks[0]["start_pose"], trajectory, trajectory["trajectory"][1]]))
    target[data.draw(st.sampled_from([*sorted(target), "another"]))] = data.draw(task_files.ANYTHING)
    root = tmp_path / "any"
    put(root, tasks, trajectory)
    report = import_benchmark("aerialdojo", [root], tmp_path, Options(skip_bad=True), force=True)
    kept = pd.read_parquet(tmp_path / "imported/aerialdojo/tasks")
    assert (report.records, len(kept)) == (1, 1 - report.n_bad)
    assert report.n_bad or kept["source_id"][0] == "42"


def test_tasks_of_one_pair_are_told_apart(tmp_path):
    tasks, trajectory = document()
    tasks.append(tasks[0] | {"episode_id": "7"})
    trajectory["task_id"] = "3_0__5"
    path = put(tmp_path / "root", tasks, trajectory)
    folder = tmp_path / "root/TrajectoryDATA" / path.parent.relative_to(tmp_path / "root/SemanticOGS")
    shutil.copy(folder / "42.json", folder / "7.json")
    report = import_benchmark("aerialdojo", [tmp_path / "root"], tmp_path)
    routes = pd.read_parquet(tmp_path / "imported/aerialdojo/routes")
    assert routes["nav_id"].nunique() == 2
    assert routes[["start_object_id", "start_anchor_id", "target_object_id"]].to_numpy().tolist() == [[3, 0, 5]] * 2
    assert report.notes["task_id appears twice in the scene: named by partition and episode"] == 1
