"""The authors' layout: its folders, its words, its numbers."""

import json
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
from releases import copy_release, released, replace_rows
from typer.testing import CliRunner

from aerialdojo_gen import store
from aerialdojo_gen.atomic import atomic_folder
from aerialdojo_gen.cli import app
from aerialdojo_gen.errors import StoreError, UsageError
from aerialdojo_gen.exchange.exporting import export_release
from aerialdojo_gen.staging import AREA


@pytest.fixture(scope="module")
def layout(smoke, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("layout") / "out"
    export_release("aerialdojo", smoke, out)
    return out


def task_files(layout: Path) -> list[Path]:
    return sorted(layout.glob("*OGS/*/*/*/Task.json"))


def test_folders_are_those_of_the_authors(layout):
    shape = re.compile(
        r"(Semantic|Image)OGS/(IID|OOD)_(TRAINS|TESTS)/(1_BaseTasks|2_StandardTasks|3_LongHorizonTasks)/"
        r"U_Courtyard_[01]_[BSL]_(Train|Test)/Task\.json"
    )
    found = [path.relative_to(layout).as_posix() for path in task_files(layout)]
    assert len(found) == 8
    assert all(shape.fullmatch(path) for path in found), found
    for path in found:
        assert ("_1_" in path.split("/")[3]) == path.split("/")[1].startswith("OOD")
        assert path.split("/")[1].endswith("TRAINS") == path.split("/")[3].endswith("Train")


def test_episodes_are_numbered_and_each_has_its_trajectory(layout):
    for path in task_files(layout):
        tasks = json.loads(path.read_text())
        assert [task["episode_id"] for task in tasks] == [str(k) for k in range(len(tasks))]
        trajectories = layout / "TrajectoryDATA" / path.parent.relative_to(layout / path.relative_to(layout).parts[0])
        assert {p.name for p in trajectories.iterdir()} == {f"{k}.json" for k in range(len(tasks))}


def test_both_instances_are_the_same_episode(layout):
    for path in sorted(layout.glob("SemanticOGS/*/*/*/Task.json")):
        other = layout / "ImageOGS" / path.relative_to(layout / "SemanticOGS")
        pairs = zip(json.loads(path.read_text()), json.loads(other.read_text()), strict=True)
        for semantic, image in pairs:
            assert semantic.pop("description")
            assert image.pop("description") == ""
            picture = other.parent / image.pop("image")
            assert picture.read_bytes().startswith(b"\x89PNG")
            assert semantic == image


def test_a_task_has_the_fields_of_the_authors(layout):
    for path in task_files(layout):
        train = path.parent.name.endswith("Train")
        for task in json.loads(path.read_text()):
            image = {"image"} if "ImageOGS" in path.parts else set()
            assert set(task) == {
                "episode_id", "map_name", "task", "used-in-train", "start_object_name", "goal_object_name",
                "description", "category", "Landmark", "Direction", "start_pose", "goal_pose",
            } | image  # fmt: skip
            assert task["map_name"] == path.parent.name.rsplit("_", 2)[0]
            assert task["task"] == "base_task"
            assert task["used-in-train"] == int(train)
            assert set(task["start_pose"]) == {"start_position", "start_quaternion_xyzw"}


def rotate_x(q):
    """The body's x axis in the frame of a quaternion xyzw, by the rotation matrix's first column."""
    x, y, z, w = q
    return np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])


def test_trajectories_fly_as_their_words_say_in_ned(layout, smoke):
    routes = released(smoke, "routes")
    lengths = []
    for path in sorted(layout.glob("TrajectoryDATA/*/*/*/*.json")):
        document = json.loads(path.read_text())
        assert document["schema_version"] == "hybrid_astar_trajectory_v6"
        assert document["status"] == "planned"
        assert re.fullmatch(r"\d+_\d+__\d+", document["task_id"])
        steps = document["trajectory"]
        assert steps[0]["action"] == "start"
        positions = np.array([s["position_ned_m"] for s in steps])
        ahead = np.array([rotate_x(s["quaternion_xyzw"]) for s in steps])
        assert np.allclose(np.linalg.norm([s["quaternion_xyzw"] for s in steps], axis=1), 1)
        # z points down: above the ground it is negative.
        assert (positions[:, 2] < 0).all()
        right = np.cross([0, 0, 1], ahead)
        for k, step in enumerate(steps[1:], 1):
            moved, word = positions[k] - positions[k - 1], step["action"]
            turned = math.atan2(np.cross(ahead[k - 1], ahead[k])[2], ahead[k - 1] @ ahead[k])
            if word in ("rotl", "rotr"):
                # rotr is +yaw.
                assert math.degrees(turned) == pytest.approx(15 if word == "rotr" else -15)
                assert np.allclose(moved, 0)
                continue
            ways = {
                "forward": ahead[k],
                "left": -right[k],
                "right": right[k],
                "ascend": [0, 0, -1],
                "descend": [0, 0, 1],
            }
            along = {name: float(moved @ np.asarray(way)) for name, way in ways.items()}
            assert turned == pytest.approx(0, abs=1e-9)
            # None of the others goes farther: a move along an axis is called by it, an approach by its longest.
            assert along[word] == pytest.approx(max(along.values()), abs=1e-9)
            if k < len(steps) - 1:
                assert np.linalg.norm(moved - along[word] * np.asarray(ways[word])) < 1e-6
                assert min(abs(along[word] - size) for size in (1, 2, 3, 5)) < 1e-5
            else:
                assert np.linalg.norm(moved) <= 1 + 1e-9
        lengths.append(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    assert sorted(lengths) == pytest.approx(sorted(routes["length_m"]), abs=1e-9)


def test_numbers_are_ours_turned(layout, smoke):
    routes, tasks = released(smoke, "routes"), released(smoke, "tasks")
    path = layout / "SemanticOGS/IID_TRAINS/1_BaseTasks/U_Courtyard_0_B_Train/Task.json"
    mine = tasks[
        (tasks["scene"] == "U_Courtyard_0") & (tasks["subset"] == "train") & (tasks["modality"] == "semantic")
    ]
    mine = mine.sort_values("nav_id")
    for task, (_, row) in zip(json.loads(path.read_text()), mine.iterrows(), strict=True):
        route = routes.loc[row["nav_id"]]
        assert task["start_pose"]["start_position"] == [row["start_y_m"], row["start_x_m"], -row["start_z_m"]]
        assert task["goal_pose"]["goal_position"] == [route["goal_y_m"], route["goal_x_m"], -route["goal_z_m"]]
        assert task["goal_object_name"] == row["target_name"]
        assert (task["Landmark"], task["Direction"]) == (row["landmark"], row["direction"])
        north, east, _ = rotate_x(task["start_pose"]["start_quaternion_xyzw"])
        assert [east, north] == pytest.approx([math.cos(row["start_yaw_rad"]), math.sin(row["start_yaw_rad"])])


def test_the_same_release_gives_the_same_bytes(layout, smoke, tmp_path):
    export_release("aerialdojo", smoke, tmp_path / "again")
    first = {p.relative_to(layout): p.read_bytes() for p in layout.rglob("*") if p.is_file()}
    second = {
        p.relative_to(tmp_path / "again"): p.read_bytes() for p in (tmp_path / "again").rglob("*") if p.is_file()
    }
    assert first == second


def test_a_picture_is_on_the_disk_once(layout):
    pictures = list(layout.glob("ImageOGS/**/*.png"))
    assert len({p.stat().st_ino for p in pictures}) == len({p.name for p in pictures}) < len(pictures)


def test_nothing_is_there_when_a_picture_is_missing(smoke, tmp_path):
    data = copy_release(smoke, tmp_path / "data", ["U_Courtyard_0"])
    rows = store.read_scene(data, "release/objects", "U_Courtyard_0").to_pylist()
    replace_rows(data, "release/objects", "U_Courtyard_0", [row | {"reference_image": None} for row in rows])
    with pytest.raises(StoreError, match=r"object \d+ of U_Courtyard_0 has no reference image"):
        export_release("aerialdojo", data, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["data"]


@pytest.mark.parametrize("name", ["../../outside", "/etc/x", "a/b", ""])
def test_a_picture_name_does_not_leave_its_folder(smoke, tmp_path, name):
    data = copy_release(smoke, tmp_path / "data", ["U_Courtyard_0"])
    rows = store.read_scene(data, "release/objects", "U_Courtyard_0").to_pylist()
    replace_rows(data, "release/objects", "U_Courtyard_0", [row | {"reference_image_id": name} for row in rows])
    with pytest.raises(StoreError, match="cannot name a file"):
        export_release("aerialdojo", data, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["data"]


def test_a_folder_of_others_is_never_replaced(smoke, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.tex").write_text("mine")
    for force in (False, True):
        with pytest.raises(UsageError, match=r"holds no export\.json"):
            export_release("aerialdojo", smoke, out, force=force)
    assert [p.name for p in out.iterdir()] == ["thesis.tex"]
    assert os.listdir(tmp_path) == ["out"]


def test_an_export_is_replaced_by_force_alone(smoke, tmp_path):
    out = tmp_path / "out"
    export_release("aerialdojo", smoke, out, ["U_Courtyard_0"])
    before = {p.relative_to(out) for p in out.rglob("*")}
    with pytest.raises(UsageError, match="--force replaces it"):
        export_release("aerialdojo", smoke, out, ["U_Courtyard_1"])
    assert {p.relative_to(out) for p in out.rglob("*")} == before
    export_release("aerialdojo", smoke, out, ["U_Courtyard_1"], force=True)
    assert not list(out.rglob("U_Courtyard_0*"))
    assert os.listdir(tmp_path) == ["out"]


def test_what_a_killed_export_left_is_swept_and_a_living_one_s_is_not(smoke, tmp_path):
    left = tmp_path / AREA / "dead"
    left.mkdir(parents=True)
    (left / "lease").write_text("out")
    (left / "new").mkdir()
    with atomic_folder(tmp_path / "other") as living:
        export_release("aerialdojo", smoke, tmp_path / "out", ["U_Courtyard_0"])
        assert living.is_dir()
        assert not left.exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["other", "out"]


def test_an_export_killed_while_it_replaced_another_is_there_again(smoke, tmp_path):
    out, item = tmp_path / "out", tmp_path / AREA / "dead"
    export_release("aerialdojo", smoke, out, ["U_Courtyard_0"])
    # As a kill leaves it where two names cannot be exchanged.
    item.mkdir(parents=True)
    (item / "lease").write_text("out")
    out.rename(item / "old")
    with pytest.raises(UsageError, match="--force replaces it"):
        export_release("aerialdojo", smoke, out, ["U_Courtyard_1"])
    assert list(out.rglob("U_Courtyard_0*"))
    assert os.listdir(tmp_path) == ["out"]


def test_the_command_says_what_it_wrote_and_what_is_wrong(smoke, tmp_path):
    runner = CliRunner()
    done = runner.invoke(
        app, ["export", "--format", "aerialdojo", "--data", str(smoke), "--out", str(tmp_path / "o")]
    )
    assert done.exit_code == 0
    scenes = store.release_scenes(smoke)
    n = sum(store.count_rows(smoke, table, scene) for table in ("routes/train", "routes/test") for scene in scenes)
    assert n > 100
    assert done.output.strip().endswith(f"2 scenes, 8 task files, {2 * n} tasks, {n} trajectories, 16 pictures")
    lost = json.loads((tmp_path / "o/export.json").read_text())["lost"]
    assert "min_clearance_m" in lost["routes"]
    for arguments, error in (
        (["--format", "xml", "--data", str(smoke)], "no format 'xml': it is one of aerialdojo, habitat"),
        (["--format", "habitat", "--data", str(tmp_path)], "there is no release in"),
        (["--format", "habitat", "--data", str(smoke), "--scene", "Nowhere"], "Nowhere"),
    ):
        failed = runner.invoke(app, ["export", *arguments, "--out", str(tmp_path / "p")])
        assert isinstance(failed.exception, UsageError)
        assert error in str(failed.exception)
        assert not (tmp_path / "p").exists()
