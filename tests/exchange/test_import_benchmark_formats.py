"""Others' task files, by their documents, in our tables and our frame."""

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support import task_files
from support.command_line import called

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.exchange.importing import Options, import_benchmark
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.store.schemas import ACTION_NAMES


def imported(folder: Path, form: str, document: object, options: Options | None = None, name: str = "", **more):
    """Import a file; gives the report, tasks, routes and objects."""
    path = task_files.write(folder / "file.json", document)
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


def test_cityavos_without_pictures(tmp_path):
    missions = task_files.cityavos(tmp_path / "elsewhere", 3)
    _, tasks, *_ = imported(tmp_path, "cityavos", missions, Options(frame="ned", with_pictures=False))
    assert tasks["modality"].tolist() == ["semantic"] * 3
    options = Options(frame="ned", pictures=tmp_path / "elsewhere")
    _, tasks, *_ = imported(tmp_path, "cityavos", missions, options, force=True)
    assert len(tasks) == 6


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
    document = task_files.aerialvln()
    for episode in document["episodes"]:
        del episode["reference_path"], episode["actions"]
    report, tasks, routes, _ = imported(tmp_path, "aerialvln", document)
    assert len(tasks) == 2
    assert routes["x_m"].isna().all()
    assert routes["goal_x_m"].notna().all()
    assert report.replay() is None


def test_aerialvln_path_with_other_actions_keeps_the_poses(tmp_path):
    document = task_files.aerialvln()
    document["episodes"][0]["actions"] = [1, 1, 0]
    path = document["episodes"][0]["reference_path"]
    document["episodes"][0]["reference_path"] = [[*point, 0.0, 0.0, 1.5] for point in path]
    report, _, routes, _ = imported(tmp_path, "aerialvln", document)
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
    document = task_files.openfly((1, 1, 0))
    _, _, routes, _ = imported(tmp_path, "openfly", document, Options(frame="nwu"), force=True)
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
