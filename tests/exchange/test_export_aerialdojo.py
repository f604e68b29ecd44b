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
from support.releases import copy_release, files_of, released, replace_rows

from aerialdojo_gen.base.errors import AssetError, StoreError, UsageError
from aerialdojo_gen.dataset.contents import scenes_in_release
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


def test_folders_and_episodes_are_those_of_the_authors(layout, smoke):
    shape = re.compile(
        r"(Semantic|Image)OGS/(IID|OOD)_(TRAINS|TESTS)/(1_BaseTasks|2_StandardTasks|3_LongHorizonTasks)/"
        r"U_Courtyard_[01]_[BSL]_(Train|Test)/Task\.json"
    )
    sizes = {}
    for path in task_files(layout):
        place, tasks = path.relative_to(layout), json.loads(path.read_text())
        assert shape.fullmatch(place.as_posix())
        kind, split, _, name, _ = place.parts
        assert ("_1_" in name) == split.startswith("OOD")
        assert split.endswith("TRAINS") == name.endswith("Train")
        assert [task["episode_id"] for task in tasks] == [str(k) for k in range(len(tasks))]
        trajectories = layout / "TrajectoryDATA" / place.parent.relative_to(kind)
        assert {p.name for p in trajectories.iterdir()} == {f"{k}.json" for k in range(len(tasks))}
        sizes[place] = len(tasks)
    # Two kinds, two scenes, three settings, train and test: those without tasks too, as in the authors' data.
    assert len(sizes) == 24
    assert len(list(layout.glob("TrajectoryDATA/*/*/*"))) == 12
    groups = released(smoke, "tasks").groupby(["scene", "setting", "subset"]).ngroups
    assert 0 < 2 * groups == sum(n > 0 for n in sizes.values())
    assert all(n for place, n in sizes.items() if "1_BaseTasks" in place.parts)


def test_a_task_says_what_its_row_and_its_route_do_turned_into_ned(tasks, smoke):
    """By the names that the authors' data has, and that their evaluator asks for besides: ``start_quaternionr``."""
    objects = pd.read_parquet(smoke / "release/objects").set_index(["scene", "object_id"])
    episodes = {}
    for path, task, row, route in tasks:
        # Both instances of a navigation task are one episode.
        assert episodes.setdefault(row["nav_id"], task["episode_id"]) == task["episode_id"]
        start, target = (objects.loc[(row["scene"], route[f"{end}_object_id"])] for end in ("start", "target"))
        quaternion = task["start_pose"]["start_quaternion_xyzw"]
        north, east, _ = rotate_x(quaternion)
        assert np.linalg.norm(quaternion) == pytest.approx(1)
        assert [east, north] == pytest.approx([math.cos(row["start_yaw_rad"]), math.sin(row["start_yaw_rad"])])
        # A description, were it but empty, would be taken for the goal: an image task has none.
        goal = {"description": row["description"]}
        if row["modality"] == "image":
            goal = {"image": f"Images/{row['reference_image_id']}.png"}
            assert (path.parent / task["image"]).read_bytes().startswith(b"\x89PNG")
        assert task == goal | {
            "episode_id": task["episode_id"], "trajectory_id": row["nav_id"], "map_name": row["scene"],
            "coordinate_system": "ProjectAirSim NED",
            "task": {"1": "base_task", "2": "standard_task", "3": "long_task"}[path.parent.parent.name[0]],
            "used-in-train": int(path.parent.name.endswith("Train")),
            "start_true_name": start["name"], "goal_true_name": row["target_name"],
            "start_object_name": start["mesh_node"], "goal_object_name": target["mesh_node"],
            "category": target["category"], "Landmark": row["landmark"], "Direction": row["direction"],
            "start_pose": {
                "start_position": [row["start_y_m"], row["start_x_m"], -row["start_z_m"]],
                "start_quaternion_xyzw": quaternion, "start_quaternionr": quaternion,
            },
            "goal_pose": {"goal_position": [route["goal_y_m"], route["goal_x_m"], -route["goal_z_m"]]},
            "info": {
                "geodesic_distance": route["length_m"], "euclidean_distance": route["euclidean_m"],
                "complexity": route["detour_ratio"],
            },
        }  # fmt: skip
        assert path.parent.name.rsplit("_", 2)[0] == row["scene"]
        assert target["name"] == row["target_name"]


def test_pictures_are_as_large_as_the_authors_and_show_the_same_view(layout, smoke):
    objects = pd.read_parquet(smoke / "release/objects").set_index("reference_image_id")
    files = list(layout.glob("ImageOGS/**/Images/*.png"))
    pictures = {p.stem: p for p in files}
    assert 10 < len(pictures) == len({p.stat().st_ino for p in files}) < len(files), "on the disk once"
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
    n = len(released(smoke, "routes"))
    assert document["counts"] == counts
    assert counts == {"scenes": 2, "task files": 24, "tasks": 2 * n, "trajectories": n, "pictures": 16}
    assert "min_clearance_m" in document["lost"]["routes"]
    assert files_of(tmp_path / "unpacked") == files


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
    # A folder that is no export of ours is never replaced.
    shutil.rmtree(out)
    out.mkdir()
    (out / "thesis.tex").write_text("mine")
    for force in (False, True):
        with pytest.raises(UsageError, match=r"holds no export\.json"):
            export_release("aerialdojo", smoke, out, force=force)
    assert [p.name for p in out.iterdir()] == ["thesis.tex"]
    assert os.listdir(tmp_path) == ["out"]
