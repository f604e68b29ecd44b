"""Bad task files: each record named with file, row and field; the rest kept only on request; paths stay in theirs."""

import json
import os
import shutil
from collections import Counter
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support import task_files
from support.command_line import called

from aerialdojo_gen.base.errors import ImportRefused
from aerialdojo_gen.exchange.exporting import export_release
from aerialdojo_gen.exchange.folder import inside
from aerialdojo_gen.exchange.importing import FORMATS, Options, import_benchmark

NAN = float("nan")
FRAME = {"openfly": "enu", "cityavos": "ned"}


def records_of(format_name: str, folder: Path, n: int = 3) -> tuple[object, list[dict]]:
    """A good file's document, and the records in it."""
    if format_name == "aerialvln":
        document = task_files.aerialvln(n=n)
        return document, document["episodes"]
    rows = {"uav-on": task_files.uav_on, "openfly": lambda n: task_files.openfly(n=n),
            "cityavos": lambda n: task_files.cityavos(folder, n)}[format_name](n)  # fmt: skip
    return rows, rows


def put(record: dict, path: str, value: object) -> None:
    """Set a field by its path; a number is an index."""
    *parents, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    for key in parents:
        record = record[key]
    if value is KeyError:
        del record[last]
    else:
        record[last] = value


BAD = [
    # format, field, value, the field that is named, why
    ("uav-on", "start_pose.start_position", [1, 2, 3, 4], "start_pose.start_position", "expected 3 numbers, found 4"),
    ("uav-on", "start_pose.start_position", [1, NAN, 3], "start_pose.start_position", "nan is no finite number"),
    ("uav-on", "start_pose.start_position.1", "307", "start_pose.start_position", "expected a number, found '307'"),
    ("uav-on", "start_pose.start_position.1", True, "start_pose.start_position", "expected a number, found True"),
    ("uav-on", "start_pose.start_position.1", 10**400, "start_pose.start_position", "is too large a number"),
    ("uav-on", "start_pose.start_position.1", 1e9, "start_pose.start_position", "1e+09 m is no place on earth"),
    ("uav-on", "start_pose.start_quaternionr", [0, 0, 0, 0], "start_pose.start_quaternionr", "length is 0"),
    ("uav-on", "start_pose.start_quaternionr", [0, 0, 90, 0], "start_pose.start_quaternionr", "length is 90"),
    ("uav-on", "start_pose", KeyError, "start_pose", "is missing"),
    ("uav-on", "start_pose", None, "start_pose", "expected an object, found None"),
    ("uav-on", "pose", [], "pose", "is empty"),
    ("uav-on", "pose", [[0, 0, 0], [1, 2]], "pose[1]", "expected 3 numbers, found 2"),
    ("uav-on", "used-in-train", 2, "used-in-train", "expected 0 or 1, found 2"),
    ("uav-on", "true_name", 5, "true_name", "expected a text, found 5"),
    ("uav-on", "true_name", "\ud800", "true_name", "half a Unicode character"),
    ("uav-on", "map_name", "../outside", "scene", "'../outside' is not a scene name"),
    ("uav-on", "map_name", "/etc", "scene", "'/etc' is not a scene name"),
    ("uav-on", "episode_id", "0", "id", "BrushifyRoad_test/0 appears twice"),
    ("cityavos", "initial_pos.5", 90, "initial_pos[5]", "yaw 90 is more than a turn in radians"),
    ("cityavos", "initial_pos", [1, 2, 3], "initial_pos", "expected 6 numbers, found 3"),
    ("cityavos", "target_pos", [1, 2, NAN], "target_pos", "nan is no finite number"),
    ("cityavos", "target_image_path", "data/target_image/none.png", "target_image_path", "there is no file"),
    ("cityavos", "target_image_path", "../secret.png", "target_image_path", "'../secret.png' points outside"),
    ("cityavos", "target_image_path", "/etc/passwd", "target_image_path", "is no path relative to"),
    ("cityavos", "target_image_path", "C:\\x.png", "target_image_path", "is no path relative to"),
    ("cityavos", "target_text", " ", "target_text", "is empty"),
    ("cityavos", "mission_id", 1, "id", "1 appears twice"),
    ("aerialvln", "actions.2", 9, "actions[2]", "unknown action 9: known are 0, 1, 2, 3, 4, 5, 6, 7"),
    ("aerialvln", "actions.2", 1.5, "actions", "expected whole numbers, found 1.5"),
    ("aerialvln", "actions.2", 0, "actions[2]", "stop before the end"),
    ("aerialvln", "start_rotation", [1, 0, 0], "start_rotation", "expected 4 numbers, found 3"),
    ("aerialvln", "reference_path.1", [1, 2, 3, 4], "reference_path[1]", "expected x, y, z"),
    ("aerialvln", "reference_path.1.2", NAN, "reference_path[1]", "nan is no finite number"),
    ("aerialvln", "goals", [], "goals", "is empty"),
    ("aerialvln", "goals.0", 7, "goals[0]", "expected an object, found 7"),
    ("aerialvln", "instruction.instruction_text", None, "instruction.instruction_text", "expected a text"),
    ("aerialvln", "episode_id", "A0", "id", "A0 appears twice"),
    ("openfly", "action.1", -1, "action[1]", "unknown action -1"),
    ("openfly", "pos.2", [1, 2, 3, 4], "pos[2]", "expected 3 numbers, found 4"),
    ("openfly", "yaw.3", 90.0, "yaw[3]", "90 is more than a turn in radians"),
    ("openfly", "yaw", [0.0], "yaw", "has 1 values for 6 positions"),
    ("openfly", "image_path", "../../etc/x", "scene", "'..' is not a scene name"),
]


@pytest.mark.parametrize("format_name", ["uav-on", "cityavos", "aerialvln", "openfly"])
def test_bad_records_are_named_and_the_others_are_kept_on_request(tmp_path, format_name):
    """A file with a good record at either end, and a record for every fault between them."""
    faults = [fault[1:] for fault in BAD if fault[0] == format_name]
    document, rows = records_of(format_name, tmp_path / "in", len(faults) + 2)
    for row, (field, value, *_) in zip(rows[1:], faults, strict=False):
        put(row, field, value)
    path = task_files.write(tmp_path / "in/file.json", document, ascii_only=True)
    frame = FRAME.get(format_name)
    with pytest.raises(ImportRefused) as refused:
        import_benchmark(format_name, [path], tmp_path / "data", Options(frame=frame))
    head, *lines = str(refused.value).splitlines()
    told = f"{len(faults)} of {len(rows)} records are bad, nothing is written (--skip-bad keeps the rest):"
    assert head == told
    assert not list((tmp_path / "data").rglob("*.parquet"))
    assert not list((tmp_path / "data/imported").iterdir())
    report = import_benchmark(format_name, [path], tmp_path / "data", Options(frame=frame, skip_bad=True))
    folder = tmp_path / "data/imported" / format_name
    for table in ("tasks", "routes"):
        assert sorted(set(pd.read_parquet(folder / table)["source_row"])) == [0, len(rows) - 1]
    assert (report.n_bad, report.records) == (len(faults), len(rows))
    bad = (folder / "bad_records.txt").read_text().splitlines()
    assert [f"  {line}" for line in bad] == lines
    for row, (line, (_, _, named, why)) in enumerate(zip(bad, faults, strict=True), 1):
        assert line.startswith(f"file.json: row {row}: {named}: ")
        assert why in line
    counted = Counter(named.split("[")[0] for _, _, named, _ in faults)
    assert json.loads((folder / "import.json").read_text())["bad_fields"] == counted


@pytest.mark.parametrize("format_name", ["uav-on", "aerialvln"])
def test_records_of_the_wrong_kind_are_named(tmp_path, format_name):
    """In a list, and in an object that has the list."""
    document, rows = records_of(format_name, tmp_path)
    rows += [None, 3, "x", [], NAN]
    path = task_files.write(tmp_path / "file.json", document)
    with pytest.raises(ImportRefused) as refused:
        import_benchmark(format_name, [path], tmp_path, Options(frame=FRAME.get(format_name)))
    _, *lines = str(refused.value).splitlines()
    for row, line in zip(range(3, 8), lines, strict=True):
        assert line.startswith(f"  file.json: row {row}: the row: expected an object, found")


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(["uav-on", "cityavos", "aerialvln", "openfly"]), st.data())
def test_whatever_stands_in_a_field_is_read_or_named(tmp_path, format_name, data):
    document, rows = records_of(format_name, tmp_path, 2)
    key = data.draw(st.sampled_from(sorted(rows[1])))
    target = rows[1]
    if isinstance(target[key], dict) and data.draw(st.booleans()):
        target = target[key]
        key = data.draw(st.sampled_from(sorted(target)))
    elif isinstance(target[key], list) and data.draw(st.booleans()):
        target, key = target[key], data.draw(st.integers(0, len(target[key]) - 1))
    target[key] = data.draw(task_files.ANYTHING)
    rows[0][data.draw(st.text(st.characters(), min_size=1), label="a key")] = 1
    path = task_files.write(tmp_path / "file.json", document, ascii_only=True)
    options = Options(frame=FRAME.get(format_name), skip_bad=True)
    report = import_benchmark(format_name, [path], tmp_path, options, name="any", force=True)
    assert report.records == 2
    kept = set(pd.read_parquet(tmp_path / "imported/any/tasks")["source_row"])
    assert kept == ({0} if report.n_bad else {0, 1})


@pytest.fixture(scope="module")
def exported(smoke, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("exported") / "layout"
    export_release("aerialdojo", smoke, out, ["U_Courtyard_1"], picture_px=0)
    return out


@pytest.fixture
def layout(exported, tmp_path) -> Path:
    """A copy of an export that a test may spoil."""
    return shutil.copytree(exported, tmp_path / "layout")


PART = "OOD_TESTS/1_BaseTasks/U_Courtyard_1_B_Test"
LAYOUT_BAD = [
    ("episode_id", "../0", "episode_id", "'../0' cannot name a file"),
    ("episode_id", "0", "episode_id", "0 appears twice"),
    ("episode_id", "100000", "episode_id", f"TrajectoryDATA/{PART}/100000.json: No such file"),
    ("map_name", "U_Courtyard_0", "map_name", "in a folder of U_Courtyard_1"),
    ("task", "long_task", "task", f"'long_task' in {PART}"),
    ("task", "easy", "task", "'easy' is none of base_task, standard_task, long_task"),
    ("used-in-train", 1, "used-in-train", f"1 in {PART}"),
    ("goal_object_name", "another", "goal_object_name", "is not that of the episode's other instance"),
    ("goal_pose.goal_position", [1, 2], "goal_pose.goal_position", "expected 3 numbers, found 2"),
    ("start_pose.start_quaternion_xyzw", [0, 0, 1], "start_pose.start_quaternion_xyzw", "expected 4 numbers"),
    ("start_pose.start_quaternionr", [1, 0, 0, 0], "start_pose.start_quaternionr", "is not start_quaternion_xyzw"),
    ("info.complexity", "high", "info.complexity", "expected"),
]


def bad_lines(layout: Path, data: Path) -> list[str]:
    report = import_benchmark("aerialdojo", [layout], data, Options(skip_bad=True))
    lines = (data / "imported/aerialdojo/bad_records.txt").read_text().splitlines()
    assert report.n_bad == len(lines)
    return lines


def test_bad_tasks_of_the_authors_layout_are_named(layout, tmp_path):
    """Each in a row of its own, after a good one."""
    path = layout / "SemanticOGS" / PART / "Task.json"
    tasks = json.loads(path.read_text())
    for task, (field, value, *_) in zip(tasks[1:], LAYOUT_BAD, strict=False):
        put(task, field, value)
    path.write_text(json.dumps(tasks))
    lines = bad_lines(layout, tmp_path / "data")
    for row, (line, (_, _, named, why)) in enumerate(zip(lines, LAYOUT_BAD, strict=True), 1):
        assert line.startswith(f"SemanticOGS/{PART}/Task.json: row {row}: {named}")
        assert why in line


def test_a_task_and_its_trajectory_agree_on_the_target(layout, tmp_path):
    shutil.rmtree(layout / "ImageOGS")
    path = layout / "SemanticOGS" / PART / "Task.json"
    tasks = json.loads(path.read_text())
    tasks[1]["goal_object_name"] = "another"
    task_files.write(path, tasks)
    why = rf"TrajectoryDATA/{PART}/1\.json\.goal\.Object_name: .* is not the task's goal_object_name"
    with pytest.raises(ImportRefused, match=why):
        import_benchmark("aerialdojo", [layout], tmp_path / "data")


def spoil_trajectory(layout: Path, number: int, change) -> None:
    path = layout / "TrajectoryDATA" / PART / f"{number}.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


STEP = "trajectory[1]"
TRAJECTORY_BAD = [
    ("trajectory.1.action", "hover", f"{STEP}.action", "unknown action 'hover'"),
    ("trajectory.1.action", "stop", f"{STEP}.action", "unknown action 'stop'"),
    ("trajectory.1.action", ["forward"], f"{STEP}.action", "unknown action ['forward']"),
    ("trajectory.0.action", "forward", "trajectory[0].action", "known here are start"),
    ("trajectory.1.position_ned_m", [0, 0, NAN], f"{STEP}.position_ned_m", "no finite number"),
    ("trajectory.1.position_ned_m", [0] * 4, f"{STEP}.position_ned_m", "expected 3 numbers, found 4"),
    ("trajectory.1.quaternion_xyzw", KeyError, f"{STEP}.quaternion_xyzw", "is missing"),
    ("trajectory.1", 1, STEP, "expected an object, found 1"),
    ("trajectory", [], "trajectory", "is empty"),
    ("schema_version", "v7", "schema_version", "'v7', expected 'hybrid_astar_trajectory_v6'"),
    ("status", "failed", "status", "'failed', expected 'planned'"),
    ("map_name", "N_Island_0", "map_name", "is not the task's, U_Courtyard_1"),
]


def test_bad_trajectories_are_named_for_both_instances(layout, tmp_path):
    for number, (place, value, *_) in enumerate(TRAJECTORY_BAD):
        spoil_trajectory(layout, number, lambda d, place=place, value=value: put(d, place, value))
    lines = bad_lines(layout, tmp_path / "data")
    expected = [(kind, number) for kind in ("ImageOGS", "SemanticOGS") for number in range(len(TRAJECTORY_BAD))]
    for line, (kind, number) in zip(lines, expected, strict=True):
        *_, field, why = TRAJECTORY_BAD[number]
        where = f"{kind}/{PART}/Task.json: row {number}: TrajectoryDATA/{PART}/{number}.json.{field}: "
        assert line.startswith(where)
        assert why in line
    tasks = pd.read_parquet(tmp_path / "data/imported/aerialdojo/tasks")
    kept = tasks.loc[tasks["source_file"].str.contains(PART), "source_row"]
    assert kept.min() == len(TRAJECTORY_BAD)


def test_trajectories_may_be_missing_altogether_or_stop_where_they_are(layout, tmp_path):
    spoil_trajectory(layout, 3, lambda d: d["trajectory"].append(d["trajectory"][-1] | {"action": "stop"}))
    import_benchmark("aerialdojo", [layout], tmp_path / "data")
    with_stop = pd.read_parquet(tmp_path / "data/imported/aerialdojo/routes").set_index("nav_id")
    shutil.rmtree(layout / "TrajectoryDATA")
    report = import_benchmark("aerialdojo", [layout], tmp_path / "data", force=True)
    without = pd.read_parquet(tmp_path / "data/imported/aerialdojo/routes")
    assert len(without) == len(with_stop)
    assert without["x_m"].isna().all()
    assert without["euclidean_m"].notna().all()
    assert with_stop["action"].map(lambda a: a[-1] == 0 and (a[:-1] > 0).all()).all()
    assert report.notes == {"no folder in TrajectoryDATA for its partition: no route": len(without)}


def test_pictures_stay_in_their_folder_and_are_pictures(layout, tmp_path):
    folder = layout / "ImageOGS" / PART
    tasks = json.loads((folder / "Task.json").read_text())
    secret = tmp_path / "secret.png"
    secret.write_bytes(task_files.PNG)
    outside = os.path.relpath(secret, folder)
    absent, link, text, elsewhere = sorted({task["image"] for task in tasks})[:4]
    for name in (absent, link, text):
        (folder / name).unlink()
    (folder / link).symlink_to(secret)
    (folder / text).write_text("no picture")
    tasks = [task | {"image": outside} if task["image"] == elsewhere else task for task in tasks]
    (folder / "Task.json").write_text(json.dumps(tasks))
    why = dict.fromkeys((link, outside), "points outside")
    why |= {absent: "there is no file", text: "neither PNG nor JPEG"}
    with pytest.raises(ImportRefused) as refused:
        import_benchmark("aerialdojo", [layout], tmp_path / "data")
    lines = str(refused.value).splitlines()[1:]
    wanted = [row for row, task in enumerate(tasks) if task["image"] in why]
    for row, line in zip(wanted, lines, strict=True):
        assert line.startswith(f"  ImageOGS/{PART}/Task.json: row {row}: ")
        assert why[tasks[row]["image"]] in line
    # Without the pictures there is nothing wrong.
    import_benchmark("aerialdojo", [layout], tmp_path / "data", Options(with_pictures=False))
    assert pd.read_parquet(tmp_path / "data/imported/aerialdojo/objects")["reference_image"].isna().all()


def test_task_files_behind_links_out_of_the_folder_are_not_read(layout, tmp_path):
    outside = tmp_path / "outside.json"
    source = layout / "SemanticOGS" / PART / "Task.json"
    shutil.move(source, outside)
    source.symlink_to(outside)
    report = import_benchmark("aerialdojo", [layout], tmp_path / "data")
    assert f"SemanticOGS/{PART}/Task.json" not in report.files
    assert len(report.files) == 11


@given(st.text(alphabet="ab./\\:\0 C", max_size=12))
def test_no_path_leaves_its_folder(name):
    root = Path("/tmp/root")
    try:
        path = inside(root, name)
    except ValueError:
        return
    assert path.resolve().is_relative_to(root)
    assert ".." not in path.parts


def test_what_is_no_task_file_is_said_in_one_line(tmp_path):
    good = task_files.write(tmp_path / "good.json", task_files.uav_on(1))
    (tmp_path / "empty").mkdir()
    for arguments, error in (
        ((tmp_path / "none.json", "--format", "uav-on"), "there is no file"),
        ((tmp_path / "empty", "--format", "uav-on"), "is no file"),
        ((tmp_path / "empty", "--format", "aerialdojo"), "has no Task.json below it"),
        ((good, "--format", "habitat"), "no format 'habitat': there are " + ", ".join(FORMATS)),
        ((good, "--format", "cityavos", "--frame", "ned", "--angles", "turns"), "angles are radians"),
    ):
        failed = called("import-benchmark", *arguments, "--data", tmp_path)
        assert (failed.returncode, failed.stderr.count("\n")) == (2, 1), failed.stderr
        assert error in failed.stderr
    assert not (tmp_path / "imported").exists()


@pytest.mark.parametrize("what", ["key", "broken", "value"])
def test_a_key_and_a_value_of_any_length_are_named_short(tmp_path, what):
    whole = task_files.aerialvln(n=2)
    whole["episodes"][0]["scene_id"] = "x" * 50_000
    long = '{"' + "e" * 50_000 + '": '
    text = {"key": long + "[]}", "broken": long + "[1,}", "value": json.dumps(whole)}[what]
    (tmp_path / "tasks.json").write_text(text)
    with pytest.raises(ImportRefused, match=r"tasks\.json") as refused:
        import_benchmark("aerialvln", [tmp_path / "tasks.json"], tmp_path / "d")
    assert len(str(refused.value)) < 1000
