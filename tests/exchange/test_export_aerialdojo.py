"""The authors' layout: its folders, its words, its numbers."""

import io
import json
import math
import os
import re
import shutil
import tarfile
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from support.command_line import called
from support.releases import copy_release, files_of, released, replace_rows

from aerialdojo_gen.base.errors import AssetError, StoreError, UsageError
from aerialdojo_gen.dataset.contents import existing_scenes, scenes_in_release
from aerialdojo_gen.exchange import exporting
from aerialdojo_gen.exchange.exporting import estimate_size, export_release
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.staging import AREA


@pytest.fixture(scope="module")
def layout(smoke, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("layout") / "out"
    export_release("aerialdojo", smoke, out)
    return out


@pytest.fixture(scope="module")
def plain(smoke, tmp_path_factory) -> tuple[Path, str]:
    """The layout with the release's own pictures, and what is said of its size beforehand."""
    out, said = tmp_path_factory.mktemp("plain") / "out", io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exporting, "_MANY_FILES", 100)
        export_release("aerialdojo", smoke, out, picture_px=0, reporter=Reporter(stream=said))
    return out, said.getvalue()


def task_files(layout: Path) -> list[Path]:
    return sorted(layout.glob("*OGS/*/*/*/Task.json"))


@pytest.fixture(scope="module")
def tasks(layout, smoke) -> list[tuple[Path, dict, dict, dict]]:
    """Every task, with the file that it stands in, its row and its route."""
    rows, routes = (released(smoke, table).to_dict("index") for table in ("tasks", "routes"))
    written = [(path, task) for path in task_files(layout) for task in json.loads(path.read_text())]
    assert len(written) == len(rows)
    ids = [(task["trajectory_id"], "i" if "ImageOGS" in path.parts else "s") for path, task in written]
    return [(*one, rows[f"{nav}-{goal}"], routes[nav]) for one, (nav, goal) in zip(written, ids, strict=True)]


def test_folders_are_those_of_the_authors(layout, smoke):
    shape = re.compile(
        r"(Semantic|Image)OGS/(IID|OOD)_(TRAINS|TESTS)/(1_BaseTasks|2_StandardTasks|3_LongHorizonTasks)/"
        r"U_Courtyard_[01]_[BSL]_(Train|Test)/Task\.json"
    )
    found = [path.relative_to(layout).as_posix() for path in task_files(layout)]
    # Two kinds, two scenes, three settings, train and test: those without tasks too, as in the authors' data.
    assert len(found) == 24
    assert len(list(layout.glob("TrajectoryDATA/*/*/*"))) == 12
    empty = [path for path in found if json.loads((layout / path).read_text()) == []]
    tasks = released(smoke, "tasks")
    groups = tasks.groupby(["scene", "setting", "subset"]).ngroups
    assert 0 < 2 * groups == 24 - len(empty)
    assert all("/1_BaseTasks/" not in path for path in empty)
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
            assert "description" not in image
            picture = other.parent / image.pop("image")
            assert picture.read_bytes().startswith(b"\x89PNG")
            assert semantic == image


def test_a_task_has_the_fields_of_the_authors(tasks):
    for path, task, row, _ in tasks:
        assert set(task) == {
            "episode_id", "trajectory_id", "map_name", "coordinate_system", "task", "used-in-train",
            "start_true_name", "goal_true_name", "start_object_name", "goal_object_name",
            "category", "Landmark", "Direction", "start_pose", "goal_pose", "info",
            "image" if row["modality"] == "image" else "description",
        }  # fmt: skip
        assert task["coordinate_system"] == "ProjectAirSim NED"
        assert set(task["info"]) == {"geodesic_distance", "euclidean_distance", "complexity"}
        assert task["map_name"] == path.parent.name.rsplit("_", 2)[0]
        setting = path.parent.parent.name
        assert task["task"] == {"1": "base_task", "2": "standard_task", "3": "long_task"}[setting[0]]
        assert task["used-in-train"] == int(path.parent.name.endswith("Train"))
        pose = task["start_pose"]
        assert set(pose) == {"start_position", "start_quaternion_xyzw", "start_quaternionr"}
        assert pose["start_quaternionr"] == pose["start_quaternion_xyzw"]


def evaluator_reads(task: dict) -> dict:
    """What the authors' online evaluator makes of a task: it refuses one without these fields.

    Written after the public client's task loader: the first non-empty one of several names, and a text for a
    description, which is the landmark's where there is none.
    """
    start, goal = task.get("start_pose", {}), task.get("goal_pose", {})
    quaternion = start.get("start_quaternionr") or task.get("start_quaternionr") or task.get("start_orientation")
    position = start.get("start_position") or task.get("start_position")
    end = goal.get("goal_position") or task.get("object_position") or task.get("pose")
    assert position is not None
    assert quaternion is not None
    assert end is not None
    return {
        "position": [float(v) for v in position[:3]],
        "quaternion": [float(v) for v in quaternion[:4]],
        "goal": end,
        "description": str(task.get("description", task.get("Landmark", ""))),
    }


def test_the_authors_evaluator_reads_every_task(tasks):
    for _, task, row, _ in tasks:
        seen = evaluator_reads(task)
        assert seen["description"] == row["description" if row["modality"] == "semantic" else "landmark"]
        assert np.linalg.norm(seen["quaternion"]) == pytest.approx(1)


def test_a_task_states_its_route_and_its_objects_turned_into_ned(tasks, smoke):
    objects = pd.read_parquet(smoke / "release/objects").set_index(["scene", "mesh_node"])["name"].to_dict()
    for _, task, row, route in tasks:
        assert objects[task["map_name"], task["goal_object_name"]] == task["goal_true_name"] == row["target_name"]
        assert objects[task["map_name"], task["start_object_name"]] == task["start_true_name"]
        assert (task["Landmark"], task["Direction"]) == (row["landmark"], row["direction"])
        info = [task["info"][name] for name in ("geodesic_distance", "euclidean_distance", "complexity")]
        assert info == [route[name] for name in ("length_m", "euclidean_m", "detour_ratio")]
        assert task["start_pose"]["start_position"] == [row["start_y_m"], row["start_x_m"], -row["start_z_m"]]
        assert task["goal_pose"]["goal_position"] == [route["goal_y_m"], route["goal_x_m"], -route["goal_z_m"]]
        north, east, _ = rotate_x(task["start_pose"]["start_quaternion_xyzw"])
        assert [east, north] == pytest.approx([math.cos(row["start_yaw_rad"]), math.sin(row["start_yaw_rad"])])


def test_pictures_are_as_large_as_the_authors_and_show_the_same_view(layout, smoke):
    objects = pd.read_parquet(smoke / "release/objects").set_index("reference_image_id")
    pictures = {p.stem: p for p in layout.glob("ImageOGS/**/Images/*.png")}
    assert len(pictures) > 10
    small = {
        name: cv2.imdecode(np.frombuffer(objects["reference_image"][name], np.uint8), cv2.IMREAD_COLOR)
        for name in pictures
    }
    for name, path in pictures.items():
        large = cv2.imread(str(path))
        assert large.shape == (640, 640, 3)
        shrunk = cv2.resize(large, (320, 320), interpolation=cv2.INTER_AREA).astype(float)
        off = {other: np.abs(shrunk - picture).mean() for other, picture in small.items()}
        # As like its own as a picture at another size can be, and more like it than any other.
        assert off[name] < 6
        assert min(off, key=off.get) == name
        # Drawn at that size, not enlarged: an enlarged picture has nothing that shrinking loses.
        again = cv2.resize(shrunk, (640, 640), interpolation=cv2.INTER_CUBIC)
        assert np.abs(again - large).mean() > 0.3


def test_the_size_is_announced_and_the_releases_own_pictures_are_exported_on_demand(smoke, plain):
    out, said = plain
    size = estimate_size("aerialdojo", open_root(smoke), scenes_in_release(smoke), 0)
    written = [path.stat() for path in out.rglob("*") if path.is_file()]
    assert size.files == len(written), "to the file"
    # Links to one file count once.
    assert size.bytes == pytest.approx(sum({file.st_ino: file.st_size for file in written}.values()), rel=0.25)
    told = f"export: {size}; --shards writes 3 files in their place, into {out}"
    assert said.startswith(told)
    objects = pd.read_parquet(smoke / "release/objects").set_index("reference_image_id")["reference_image"]
    pictures = list(out.glob("ImageOGS/**/Images/*.png"))
    assert pictures
    assert all(path.read_bytes() == objects[path.stem] for path in pictures)


def test_pictures_of_another_mesh_are_refused(smoke, tmp_path):
    data = copy_release(smoke, tmp_path / "data", ["U_Courtyard_0"])
    with pytest.raises(AssetError, match=r"U_Courtyard_0\.glb is missing.*--picture-size 0"):
        export_release("aerialdojo", data, tmp_path / "out")
    shutil.copytree(smoke / "meshes", data / "meshes")
    mesh = data / "meshes/U_Courtyard_0.glb"
    raw = bytearray(mesh.read_bytes())
    raw[-5] ^= 1
    mesh.write_bytes(raw)
    with pytest.raises(AssetError, match=r"is not the mesh that the release was made from"):
        export_release("aerialdojo", data, tmp_path / "out")
    # The right mesh, and another object's picture in the release.
    shutil.copy(smoke / "meshes/U_Courtyard_0.glb", mesh)
    rows = store.read_scene(data, "release/objects", "U_Courtyard_0").to_pylist()
    rows[0]["reference_image"], rows[3]["reference_image"] = rows[3]["reference_image"], rows[0]["reference_image"]
    replace_rows(data, "release/objects", "U_Courtyard_0", rows)
    with pytest.raises(StoreError, match=r"does not look as its picture does"):
        export_release("aerialdojo", data, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["data"]


def rotate_x(q):
    """The body's x axis in the frame of a quaternion xyzw."""
    return Rotation.from_quat(q).apply([1, 0, 0])


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
        ahead = rotate_x([s["quaternion_xyzw"] for s in steps])
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
            ways = {"forward": ahead[k], "left": -right[k], "right": right[k]}
            ways |= {"ascend": [0, 0, -1], "descend": [0, 0, 1]}
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


def test_archives_unpacked_are_the_files(plain, smoke, tmp_path):
    """Those of an export before, to the byte; the archives tell nothing of when and where they were made."""
    counts = export_release("aerialdojo", smoke, tmp_path / "tars", shards=True, picture_px=0)
    archives = sorted((tmp_path / "tars").glob("*.tar"))
    assert [path.stem for path in archives] == scenes_in_release(smoke)
    assert {path.name for path in (tmp_path / "tars").iterdir()} == {*(p.name for p in archives), "export.json"}
    for path in archives:
        with tarfile.open(path) as tar:
            assert all((m.uid, m.gid, m.mtime, m.uname, m.gname) == (0, 0, 0, "", "") for m in tar)
            assert {m.mode for m in tar} == {0o755, 0o644}
            names = [Path(name) for name in tar.getnames()]
            assert names == sorted(names)
            tar.extractall(tmp_path / "unpacked", filter="data")
    files = files_of(plain[0])
    document = json.loads(files.pop("export.json"))
    assert document == json.loads((tmp_path / "tars" / "export.json").read_text())
    assert document["counts"] == counts
    assert files_of(tmp_path / "unpacked") == files


def test_a_picture_is_on_the_disk_once(layout):
    pictures = list(layout.glob("ImageOGS/**/*.png"))
    assert len({p.stat().st_ino for p in pictures}) == len({p.name for p in pictures}) < len(pictures)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("reference_image", None, r"object \d+ of U_Courtyard_0 has no reference image"),
        *(("reference_image_id", name, "cannot name a file") for name in ("../../outside", "/etc/x", "a/b", "")),
    ],
)
def test_nothing_is_there_when_a_picture_is_missing_or_leads_out(smoke, tmp_path, column, value, message):
    data = copy_release(smoke, tmp_path / "data", ["U_Courtyard_0"])
    rows = store.read_scene(data, "release/objects", "U_Courtyard_0").to_pylist()
    replace_rows(data, "release/objects", "U_Courtyard_0", [row | {column: value} for row in rows])
    with pytest.raises(StoreError, match=message):
        export_release("aerialdojo", data, tmp_path / "out", picture_px=0)
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


def test_an_export_is_replaced_by_force_alone_and_there_again_after_a_kill(smoke, tmp_path):
    out, item = tmp_path / "out", tmp_path / AREA / "dead"
    export_release("aerialdojo", smoke, out, ["U_Courtyard_0"], picture_px=0)
    before = {p.relative_to(out) for p in out.rglob("*")}
    for killed in (False, True):
        if killed:
            # As a kill leaves it where two names cannot be exchanged.
            item.mkdir(parents=True)
            (item / "lease").write_text("out")
            out.rename(item / "old")
        with pytest.raises(UsageError, match="--force replaces it"):
            export_release("aerialdojo", smoke, out, ["U_Courtyard_1"])
        assert {p.relative_to(out) for p in out.rglob("*")} == before
        assert os.listdir(tmp_path) == ["out"]
    export_release("aerialdojo", smoke, out, ["U_Courtyard_1"], force=True, picture_px=0)
    assert not list(out.rglob("U_Courtyard_0*"))
    assert os.listdir(tmp_path) == ["out"]


def test_the_command_says_what_it_wrote(smoke, tmp_path):
    out = tmp_path / "o"
    done = called("export", "--format", "aerialdojo", "--data", smoke, "--picture-size", 0, "--out", out)
    assert done.returncode == 0, done.stderr
    scenes = existing_scenes(smoke)
    n = sum(store.count_rows(smoke, table, scene) for table in ("routes/train", "routes/test") for scene in scenes)
    assert n > 100
    told = f"2 scenes, 24 task files, {2 * n} tasks, {n} trajectories, 16 pictures"
    assert done.stdout.strip().endswith(told)
    assert "min_clearance_m" in json.loads((out / "export.json").read_text())["lost"]["routes"]
