"""Others' task files, by their documents, in our tables and our frame; the authors' layout as it comes."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support import task_files
from support.command_line import called

from aerialdojo_gen.base.errors import ImportRefused, UsageError
from aerialdojo_gen.exchange.importing import Options, import_benchmark
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.store.schemas import ACTION_NAMES


def imported(folder: Path, form: str, given: object, options: Options | None = None, name: str = "", **more):
    """Import a file; gives the report, tasks, routes and objects."""
    path = task_files.write(folder / "file.json", given)
    report = import_benchmark(form, [path], folder, options, name=name or form, **more)
    return report, *(
        pd.read_parquet(folder / "imported" / (name or form) / table) for table in ("tasks", "routes", "objects")
    )


def off_its_replay(route: pd.Series) -> float:
    """How far our own replay, in our own frame, of our own actions is from a route's poses at most."""
    own = np.column_stack([route[name] for name in ("x_m", "y_m", "z_m", "yaw_rad")])
    poses = replay(own[0], route["action"][:-1])
    turned = np.exp(1j * poses[:, 3]) - np.exp(1j * own[:, 3])
    return max(np.abs(poses[:, :3] - own[:, :3]).max(), np.abs(turned).max())


def test_uav_on(tmp_path):
    report, tasks, routes, objects = imported(tmp_path, "uav-on", task_files.uav_on(3))
    # NED (-38.41, 307.40, -10) is 307.40 m east, 38.41 m south, 10 m up.
    assert tasks.loc[0, ["start_x_m", "start_y_m", "start_z_m"]].tolist() == [307.40, -38.41, 10.0]
    # Headings of 0, 45 and 90 degrees: north, north-east, east.
    assert np.degrees(tasks["start_yaw_rad"].to_numpy()) == pytest.approx([90, 45, 0], abs=0.1)
    said = ["MonkeyBars", "A playground structure of blue bars.", "BrushifyRoad_test"]
    assert tasks[["target_name", "description", "scene"]].to_numpy().tolist() == [said] * 3
    assert tasks["subset"].tolist() == ["test", "train", "test"]
    goal = ["goal_x_m", "goal_y_m", "goal_z_m", "stated_length_m"]
    assert routes[goal].to_numpy().tolist() == [[267.50, -56.23, -29.62, 91.0]] * 3
    assert routes["euclidean_m"][0] == pytest.approx(math.dist([-38.41, 307.40, -10.0], [-56.23, 267.50, 29.62]))
    assert routes["x_m"].isna().all()
    assert objects[["mesh_node", "name"]].to_numpy().tolist() == [["SM_PullupBar01_2", "MonkeyBars"]]
    assert objects["category"].isna().all()
    assert report.unmapped == {"size": 3, "commonsenible": 3, "info.euclidean_distance": 3}
    assert report.notes == {"pose has several places of the target: the nearest to the start is the goal": 3}
    assert report.replay() is None


def test_cityavos(tmp_path):
    missions = task_files.cityavos(tmp_path, 3)
    report, tasks, routes, objects = imported(tmp_path, "cityavos", missions, Options(frame="ned"))
    assert tasks["modality"].tolist() == ["image", "semantic"] * 3
    assert tasks.loc[0, ["start_x_m", "start_y_m", "start_z_m"]].tolist() == [-4160, 6360, 5]
    semantic = tasks[tasks["modality"] == "semantic"]
    assert semantic["start_yaw_rad"].tolist() == pytest.approx([math.pi / 2 - 0.5 * i for i in range(3)])
    assert semantic["description"].unique().tolist() == ["A coffee shop named CENTRAL ALL-STAR"]
    pictures = tasks.merge(objects[["reference_image_id", "reference_image"]], on="reference_image_id")
    assert pictures["modality"].tolist() == ["image"] * 3
    assert pictures["reference_image"].tolist() == [task_files.PNG] * 3
    assert routes["goal_z_m"].tolist() == [5.98] * 3
    assert objects["z_m"].tolist() == [5.98] * 3
    assert report.unmapped == {"mission_grade": 3}
    # The other reading of x, which the documents leave open, is the same scene turned.
    _, _, other, _ = imported(tmp_path, "cityavos", missions, Options(frame="esd"), "east")
    assert other["euclidean_m"].tolist() == pytest.approx(routes["euclidean_m"].tolist())
    assert other["goal_x_m"].tolist() == [6382.97, 6383.97, 6384.97]
    assert json.loads((tmp_path / "imported/east/import.json").read_text())["frame"] == "esd"
    # Pictures left aside, and elsewhere.
    missions, elsewhere = task_files.cityavos(tmp_path / "elsewhere", 3), tmp_path / "elsewhere"
    ways = {("semantic",): {"with_pictures": False}, ("image", "semantic"): {"pictures": elsewhere}}
    for modalities, way in ways.items():
        _, tasks, *_ = imported(tmp_path, "cityavos", missions, Options("ned", **way), force=True)
        assert tasks["modality"].tolist() == [*modalities] * 3


@pytest.mark.parametrize(
    ("angles", "yaws", "expected"),
    [
        ("radians", [0.5, -1.0], [0.5, -1.0]),
        ("degrees", [90, 2], [math.pi / 2, math.radians(2)]),
        ("mixed", [90, 2], [math.pi / 2, 2.0]),
    ],
)
def test_cityavos_angles_are_as_one_says(tmp_path, angles, yaws, expected):
    rows = task_files.cityavos(tmp_path, 2)
    for row, yaw in zip(rows, yaws, strict=True):
        row["initial_pos"][5] = yaw
    options = Options(frame="enu", angles=angles, with_pictures=False)
    report, tasks, *_ = imported(tmp_path, "cityavos", rows, options)
    assert tasks["start_yaw_rad"].tolist() == pytest.approx(expected)
    assert sum(report.notes.values()) == (1 if angles == "mixed" else 0)


def test_aerialvln(tmp_path):
    report, tasks, routes, objects = imported(tmp_path, "aerialvln", task_files.aerialvln())
    assert tasks[["scene", "description"]].to_numpy().tolist() == [["5", "Rise, then fly to the red roof."]] * 2
    assert tasks["target_name"].isna().all()
    assert tasks["source_id"].tolist() == ["A0", "A1"]
    names = ["MoveForward5", "TurnLeft15", "MoveForward5", "MoveUp2", "MoveRight5", "TurnRight15", "MoveLeft5",
             "MoveDown2", "Stop"]  # fmt: skip
    for _, route in routes.iterrows():
        assert [ACTION_NAMES[a] for a in route["action"]] == names
        # The file has its poses in NED.
        assert off_its_replay(route) < 1e-9
        assert route["n_actions"] == 9
        assert route["replay_error_m"] < 1e-9
    assert len(objects) == 0
    assert report.unmapped == {"instruction.instruction_tokens": 2}
    assert not report.notes


def test_aerialvln_without_paths_still_has_tasks(tmp_path):
    flights = task_files.aerialvln()
    for episode in flights["episodes"]:
        del episode["reference_path"], episode["actions"]
    report, tasks, routes, _ = imported(tmp_path, "aerialvln", flights)
    assert len(tasks) == 2
    assert routes["x_m"].isna().all()
    assert routes["goal_x_m"].notna().all()
    assert report.replay() is None


def test_aerialvln_path_with_other_actions_keeps_the_poses(tmp_path):
    flights = task_files.aerialvln()
    path = flights["episodes"][0]["reference_path"]
    flights["episodes"][0] |= {"actions": [1, 1, 0], "reference_path": [[*p, 0.0, 0.0, 1.5] for p in path]}
    report, _, routes, _ = imported(tmp_path, "aerialvln", flights)
    route = routes.iloc[0]
    assert route["action"] is None
    assert route["source_action"].tolist() == ["forward 5 m", "forward 5 m", "stop"]
    assert len(route["x_m"]) == len(path)
    assert route["replay_error_m"] == pytest.approx(math.dist(np.add(path[0], [10, 0, 0]), path[-1]))
    assert set(report.notes) == {
        "not one action a pose: action is null, source_action has them",
        "reference_path has attitudes: yaws are taken from start_rotation and the turns",
    }


def test_openfly(tmp_path):
    report, tasks, routes, _ = imported(tmp_path, "openfly", task_files.openfly(drift_m=4.0), Options(frame="enu"))
    assert tasks["scene"].tolist() == ["env_airsim_16"] * 2
    assert tasks.loc[0, ["start_x_m", "start_y_m", "start_z_m", "start_yaw_rad"]].tolist() == [5, 6, 30, 1.57]
    route = routes.iloc[0]
    assert route["action"] is None
    assert route["source_action"].tolist() == [
        "forward 9 m", "turn left 30°", "forward 6 m", "turn right 30°", "forward 3 m", "stop",
    ]  # fmt: skip
    # The poses stand, and say how far the actions miss them.
    assert route["replay_error_m"] == pytest.approx(4.0)
    assert [route["goal_x_m"], route["goal_y_m"]] == [route["x_m"][-1], route["y_m"][-1]]
    assert report.replay() == {"routes": 2, "median_m": 4.0, "max_m": 4.0, "over_3_m": 2}
    assert report.unmapped == {"index_list": 2}
    # Actions that are ours keep their numbers; x points north in nwu: (5, 6) is 6 m west and 5 m north.
    _, _, routes, _ = imported(tmp_path, "openfly", task_files.openfly((1, 1, 0)), Options(frame="nwu"), force=True)
    route = routes.iloc[0]
    assert [ACTION_NAMES[a] for a in route["action"]] == ["MoveForward3", "MoveForward3", "Stop"]
    assert route["replay_error_m"] < 1e-9
    assert [route["x_m"][0], route["y_m"][0]] == [-6, 5]


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.integers(1, 7), min_size=1, max_size=20), st.integers(1, 4))
def test_any_aerialvln_flight_replays_in_our_frame(tmp_path, actions, n):
    _, tasks, routes, _ = imported(tmp_path, "aerialvln", task_files.aerialvln((*actions, 0), n), force=True)
    assert len(tasks) == len(routes) == n
    assert routes["replay_error_m"].max() < 1e-9
    assert all(off_its_replay(route) < 1e-9 for _, route in routes.iterrows())


def test_files_come_in_together_each_with_its_own_rows(tmp_path):
    one = task_files.write(tmp_path / "f/one.json", task_files.uav_on(2))
    two = task_files.write(tmp_path / "f/sub/two.json", task_files.uav_on(1))
    import_benchmark("uav-on", [two, one, two], tmp_path)
    tasks = pd.read_parquet(tmp_path / "imported/uav-on/tasks")
    assert sorted(zip(tasks["source_file"], tasks["source_row"], strict=True)) == [
        ("one.json", 0), ("one.json", 1), ("sub/two.json", 0),
    ]  # fmt: skip
    assert tasks["task_id"].is_unique


def test_frames_are_asked_for_where_a_format_does_not_state_its_own(tmp_path):
    path = task_files.write(tmp_path / "t.json", task_files.openfly())
    for format_name in ("openfly", "cityavos"):
        with pytest.raises(UsageError, match=r"do not say which way their axes point: --frame enu\|nwu\|ned\|esd"):
            import_benchmark(format_name, [path], tmp_path)
    with pytest.raises(UsageError, match="uav-on files are ned by their format: leave --frame out"):
        import_benchmark("uav-on", [path], tmp_path, Options(frame="enu"))
    with pytest.raises(UsageError, match="no frame 'left': it is one of enu, nwu, ned, esd"):
        import_benchmark("openfly", [path], tmp_path, Options(frame="left"))
    assert not (tmp_path / "imported").exists()


def test_an_import_is_replaced_by_force_alone(tmp_path):
    imported(tmp_path, "uav-on", task_files.uav_on(2))
    with pytest.raises(UsageError, match="--force replaces it"):
        imported(tmp_path, "uav-on", task_files.uav_on(2))
    _, tasks, *_ = imported(tmp_path, "uav-on", task_files.uav_on(1), force=True)
    assert len(tasks) == 1
    assert [p.name for p in (tmp_path / "imported").iterdir()] == ["uav-on"]
    with pytest.raises(UsageError, match="cannot name an import"):
        imported(tmp_path, "uav-on", task_files.uav_on(1), name="../../outside")


def test_the_command_reports(tmp_path):
    path = task_files.write(tmp_path / "t.json", task_files.openfly(drift_m=4.0))
    done = called("import-benchmark", path, "--format", "openfly", "--frame", "enu", "--data", tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == str(tmp_path / "imported/openfly")
    assert lines[1] == "  openfly, frame enu: 2 records in 1 files; 2 tasks, 2 routes, 0 objects"
    assert "  not mapped: index_list 2" in lines
    assert lines[-1] == "  replay_error_m over 2 routes: median 4, largest 4, over 3 m 2"


@pytest.mark.parametrize("split", ["IID_TRAINS", "ID_TRAINS"])
def test_a_file_of_theirs_is_read_with_what_it_lacks(tmp_path, split):
    task_files.put_authors(tmp_path / "root", *task_files.authors(turn_deg=15), split)
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


def test_a_turn_of_another_size_is_none_of_ours_and_the_evaluators_name_of_the_quaternion_is_read(tmp_path):
    tasks, trajectory = task_files.authors()
    pose = tasks[0]["start_pose"]
    pose["start_quaternionr"] = pose.pop("start_quaternion_xyzw")
    task_files.put_authors(tmp_path / "root", tasks, trajectory)
    report = import_benchmark("aerialdojo", [tmp_path / "root"], tmp_path)
    route = pd.read_parquet(tmp_path / "imported/aerialdojo/routes").iloc[0]
    assert route["action"] is None
    assert route["yaw_rad"].tolist()[2] == pytest.approx(route["yaw_rad"][1] - 1.0471975512)
    assert "has moves that are none of ours: action is null, source_action has them" in report.notes


def test_a_task_file_out_of_its_tree_has_tasks_without_routes(tmp_path):
    path = task_files.put_authors(tmp_path / "root", *task_files.authors())
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
    tasks, _ = task_files.authors()
    path = task_files.write(tmp_path / "mine.json", [*tasks, tasks[0] | {"episode_id": "7", "map_name": name}])
    with pytest.raises(ImportRefused, match=r"mine\.json: row 1: map_name: "):
        import_benchmark("aerialdojo", [path], tmp_path)


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_whatever_stands_in_a_task_or_its_trajectory_is_read_or_named(tmp_path, data):
    tasks, trajectory = task_files.authors()
    target = data.draw(st.sampled_from([tasks[0], tasks[0]["start_pose"], trajectory, trajectory["trajectory"][1]]))
    target[data.draw(st.sampled_from([*sorted(target), "another"]))] = data.draw(task_files.ANYTHING)
    root = tmp_path / "any"
    task_files.put_authors(root, tasks, trajectory)
    report = import_benchmark("aerialdojo", [root], tmp_path, Options(skip_bad=True), force=True)
    kept = pd.read_parquet(tmp_path / "imported/aerialdojo/tasks")
    assert (report.records, len(kept)) == (1, 1 - report.n_bad)
    assert report.n_bad or kept["source_id"][0] == "42"


def test_tasks_of_one_pair_are_told_apart(tmp_path):
    tasks, trajectory = task_files.authors()
    tasks.append(tasks[0] | {"episode_id": "7"})
    trajectory["task_id"] = "3_0__5"
    path = task_files.put_authors(tmp_path / "root", tasks, trajectory)
    folder = tmp_path / "root/TrajectoryDATA" / path.parent.relative_to(tmp_path / "root/SemanticOGS")
    shutil.copy(folder / "42.json", folder / "7.json")
    report = import_benchmark("aerialdojo", [tmp_path / "root"], tmp_path)
    routes = pd.read_parquet(tmp_path / "imported/aerialdojo/routes")
    assert routes["nav_id"].nunique() == 2
    assert routes[["start_object_id", "start_anchor_id", "target_object_id"]].to_numpy().tolist() == [[3, 0, 5]] * 2
    assert report.notes["task_id appears twice in the scene: named by partition and episode"] == 1
