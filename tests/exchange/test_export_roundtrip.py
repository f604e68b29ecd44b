"""The release through the authors' layout and back: nothing is lost but what the layout has no field for."""

import json
import shutil

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.releases import assert_same, copy_release, imported, released, replace_rows, schema_of

from aerialdojo_gen.exchange.aerialdojo_writer import LOST
from aerialdojo_gen.exchange.exporting import export_release
from aerialdojo_gen.exchange.importing import import_benchmark
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import RELEASE_OBJECTS, ROUTES, TASKS

# Recomputed from the poses, which come back to the last bit.
RECOMPUTED = {"euclidean_m": 1e-9, "length_m": 1e-9, "detour_ratio": 1e-9}


@pytest.fixture(scope="module")
def there_and_back(smoke, tmp_path_factory):
    """The release in the authors' layout, what is imported from it, and the report."""
    folder = tmp_path_factory.mktemp("roundtrip")
    export_release("aerialdojo", smoke, folder / "layout", picture_px=0)
    return folder / "layout", folder, import_benchmark("aerialdojo", [folder / "layout"], folder)


def assert_comes_back(data, back, table):
    ours, theirs = released(data, table), imported(back, table)
    assert ours.index.tolist() == theirs.index.tolist() != []
    for column in ours.columns:
        if column in LOST.get(table, ()):
            assert theirs[column].isna().all(), f"{column} is said to be lost"
        else:
            assert_same(column, ours[column], theirs[column], RECOMPUTED.get(column, 0.0))


def test_tasks_and_routes_come_back_with_every_column_and_its_type(smoke, there_and_back):
    _, back, _ = there_and_back
    for table in ("tasks", "routes"):
        assert_comes_back(smoke, back, table)
    for spec in (TASKS, ROUTES, RELEASE_OBJECTS):
        schema = schema_of(back / "imported/aerialdojo" / spec.name)
        for field in spec.schema:
            mine = schema.field(field.name)
            assert (mine.type, mine.metadata) == (field.type, field.metadata)


def test_objects_come_back_as_far_as_tasks_name_them(smoke, there_and_back):
    _, back, _ = there_and_back
    landmarks = pd.read_parquet(smoke / "release/landmarks").set_index(["scene", "landmark_id"])["name"]
    routes = released(smoke, "routes")
    targets = set(zip(routes["scene"], routes["target_object_id"], strict=True))
    ours = pd.read_parquet(smoke / "release/objects").set_index(["scene", "object_id"])
    ours = ours[[key in targets for key in ours.index]].sort_index()
    theirs = pd.read_parquet(back / "imported/aerialdojo/objects").set_index(["scene", "object_id"]).loc[ours.index]
    lost = {name for name in LOST["objects"] if name in ours.columns}
    for column in ours.columns:
        if column in lost:
            assert theirs[column].isna().all(), f"{column} is said to be lost"
        elif column == "description":
            # Tasks have any of the object's texts.
            for texts, told in zip(ours["paraphrases"], theirs[column], strict=True):
                assert told in {text["text"] for text in texts}
        else:
            assert ours[column].tolist() == theirs[column].tolist(), column
    named = [landmarks[scene, k] for (scene, _), k in zip(ours.index, ours["landmark_id"], strict=True)]
    assert theirs["landmark"].tolist() == named


def test_the_report_says_what_is_lost(there_and_back):
    _, _, report = there_and_back
    assert report.n_bad == 0
    assert not report.unmapped
    assert not report.notes
    whole = {name for name, n in report.empty.items() if n == report.rows[name.split(".")[0]]}
    said = {f"{table}.{c}" for table in ("tasks", "routes", "objects") for c in LOST[table] if " " not in c}
    assert whole == said
    assert report.rows["routes"] > 100
    assert report.replay() == {"routes": report.rows["routes"], "median_m": 0.0, "max_m": 0.0, "over_3_m": 0}


letters = st.characters(codec="utf-8", exclude_categories=("Cs", "Cc", "Zs", "Zl", "Zp"))
names = st.text(letters, min_size=1, max_size=12)


@settings(max_examples=6)
@given(names, names)
def test_any_name_and_any_description_come_back(smoke, tmp_path_factory, target, description):
    folder = tmp_path_factory.mktemp("any")
    scene = "U_Courtyard_0"
    data = copy_release(smoke, folder / "data", [scene])
    rows = {table: store.read_scene(data, table, scene).to_pylist() for table in ("routes/train", "release/objects")}
    rows["routes/train"] = rows["routes/train"][:3]
    kept = {row["nav_id"] for row in rows["routes/train"]}
    rows["tasks/train"] = [
        task | {"target_name": target, "description": description if task["modality"] == "semantic" else None}
        for task in store.read_scene(data, "tasks/train", scene).to_pylist()
        if task["nav_id"] in kept
    ]
    rows["release/objects"] = [row | {"name": target, "description": description} for row in rows["release/objects"]]
    for table, own in {**rows, "routes/test": [], "tasks/test": []}.items():
        replace_rows(data, table, scene, own)
    export_release("aerialdojo", data, folder / "layout", picture_px=0)
    import_benchmark("aerialdojo", [folder / "layout"], folder / "back")
    assert_comes_back(data, folder / "back", "tasks")


PART = "ImageOGS/OOD_TESTS/1_BaseTasks/U_Courtyard_1_B_Test/Task.json"


@pytest.mark.parametrize("named", [True, False])
def test_a_navigation_task_has_the_same_name_whatever_part_is_imported(smoke, there_and_back, tmp_path, named):
    """Its own, or where the files have none, one by its objects."""
    layout, folder, _ = there_and_back
    if not named:
        layout, folder = shutil.copytree(layout, tmp_path / "layout"), tmp_path / "all"
        for path in layout.glob("*OGS/*/*/*/Task.json"):
            tasks = json.loads(path.read_text())
            path.write_text(json.dumps([{k: v for k, v in t.items() if k != "trajectory_id"} for t in tasks]))
        import_benchmark("aerialdojo", [layout], folder)
    import_benchmark("aerialdojo", [layout / PART], tmp_path / "part")
    every, some = (imported(data, "routes").drop(columns=["source_file", "source_row"])
                   for data in (folder, tmp_path / "part"))  # fmt: skip
    assert len(some) > 10
    pd.testing.assert_frame_equal(some, every.loc[some.index])
    assert (set(some.index) <= set(released(smoke, "routes").index)) == named
