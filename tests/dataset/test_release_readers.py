"""The release in the readers that people have, MLCommons' own library among them: equal values in all, offline."""

import itertools
import json
import logging
import os
import re
import shutil
import subprocess
import sys

import cv2
import duckdb
import mlcroissant
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.dataset as pads
import pyarrow.feather as feather
import pyarrow.parquet as pq
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import filled

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.dataset.contents import SHARDS, TABLES, check_release, counts, existing_scenes, table_and_split
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import from_rows

FOLDERS = {
    (table, split): f"{table}/{split}" if TABLES[table].split else table
    for table in TABLES
    for split in (schemas.SUBSETS if TABLES[table].split else ("all",))
}


@pytest.fixture(scope="module")
def stored(smoke):
    """Every table and split of the small release as the store itself reads it."""
    parts = {}
    for scene, name in itertools.product(check_release(smoke), SHARDS):
        parts.setdefault(table_and_split(name, scene), []).append(store.read_scene(smoke, name, scene))
    return {key: pa.concat_tables(tables) for key, tables in parts.items()}


def rows(table, spec):
    """Rows as Python values, in the order of the key."""
    return table.sort_by([(k, "ascending") for k in spec.key]).to_pylist()


@pytest.fixture(scope="module")
def dataset(smoke):
    return mlcroissant.Dataset(jsonld=str(smoke / "release" / "croissant.json"))


def described(dataset, table, split):
    """Rows as MLCommons' library reads them by croissant.json."""
    for record in dataset.records(table):
        row = {k.removeprefix(f"{table}/"): v.decode() if isinstance(v, bytes) else v for k, v in record.items()}
        if row.pop("split", split) == split:
            yield row


@pytest.mark.parametrize(("table", "split"), list(FOLDERS))
def test_pandas_polars_duckdb_pyarrow_and_mlcroissant_read_equal_values(smoke, stored, dataset, table, split):
    folder, spec = smoke / "release" / FOLDERS[table, split], TABLES[table].spec
    wanted = rows(stored[table, split], spec)
    assert wanted
    read = {
        "pandas": pa.Table.from_pandas(pd.read_parquet(folder), schema=spec.schema, preserve_index=False),
        "polars": pl.read_parquet(folder / "*.parquet").to_arrow(),
        "duckdb": duckdb.connect().sql(f"SELECT * FROM '{folder}/*.parquet'").to_arrow_table(),
        "pyarrow.dataset": pads.dataset(folder, format="parquet").to_table(),
    }
    if table != "objects":  # whose pictures it decodes
        read["mlcroissant"] = pa.Table.from_pylist([*described(dataset, table, split)], schema=spec.schema)
    for reader, got in read.items():
        assert got.column_names == spec.schema.names, reader
        assert rows(got, spec) == wanted, reader


OFFLINE = """
import json, os, socket, sys
from pathlib import Path

def refuse(*args, **kwargs):
    raise AssertionError(f"the network was asked for: {args}")

socket.socket.connect = socket.create_connection = socket.getaddrinfo = refuse
import pyarrow.feather as feather
from datasets import load_dataset

release, out = Path(sys.argv[1]), Path(sys.argv[2])
for table, split in json.loads(sys.argv[3]):
    data = load_dataset(str(release), table, split="train" if split == "all" else split)
    if table == "objects":
        sizes = [data[k]["reference_image"].convert("RGB").tobytes() for k in range(len(data))]
        (out / "pictures.bin").write_bytes(b"".join(sizes))
        (out / "kind.txt").write_text(type(data[0]["reference_image"]).__name__)
        data = data.remove_columns("reference_image")
    feather.write_feather(data.with_format("arrow")[:], str(out / f"{table}-{split}.feather"))
whole = load_dataset(str(release))
assert {name: set(part.unique("subset")) for name, part in whole.items()} == {
    "id_train": {"train"}, "id_test": {"test"}, "ood_train": {"train"}, "ood_test": {"test"}
}
os.chdir(release)
for block in json.loads(sys.argv[4]):
    exec(block, {})
"""


def test_datasets_loads_every_config_offline_and_the_cards_examples_run(smoke, stored, tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", (smoke / "release" / "README.md").read_text(), re.DOTALL)
    assert len(blocks) == 6
    environment = os.environ | {
        "HF_HUB_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1", "HF_HOME": str(tmp_path / "hf"),
        "HF_DATASETS_CACHE": str(tmp_path / "cache"), "HF_HUB_DISABLE_TELEMETRY": "1",
    }  # fmt: skip
    arguments = [str(smoke / "release"), str(tmp_path), json.dumps(list(FOLDERS)), json.dumps(blocks)]
    done = subprocess.run(
        [sys.executable, "-c", OFFLINE, *arguments], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for (table, split), whole in stored.items():
        spec = TABLES[table].spec
        kept = whole.drop_columns("reference_image") if table == "objects" else whole
        assert rows(feather.read_table(tmp_path / f"{table}-{split}.feather"), spec) == rows(kept, spec)
    pictures = [
        cv2.cvtColor(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB).tobytes()
        for png in stored["objects", "all"]["reference_image"].to_pylist()
    ]
    assert (tmp_path / "pictures.bin").read_bytes() == b"".join(pictures)
    assert (tmp_path / "kind.txt").read_text() == "PngImageFile"


def test_the_cards_head_names_every_split_and_its_files(smoke, stored):
    head = yaml.safe_load((smoke / "release" / "README.md").read_text().split("---\n")[1])
    named = {}
    for config in head["configs"]:
        for part in config["data_files"]:
            split = part["split"] if TABLES[config["config_name"]].split else "all"
            files = sorted((smoke / "release").glob(part["path"]))
            named[config["config_name"], split] = sum(pq.read_metadata(path).num_rows for path in files)
    counted = {(t, s): n for t, splits in counts(smoke, check_release(smoke)).items() for s, n in splits.items()}
    assert named == counted == {key: table.num_rows for key, table in stored.items()}
    assert [c["config_name"] for c in head["configs"] if c.get("default")] == ["tasks"]
    assert head["license"] == "apache-2.0"


def task(k, setting, modality):
    told = {"description": "It is red."} if modality == "semantic" else {"image_distance_m": 4.5}
    key = {"task_id": f"U_Test_0-{k:04}-{modality[0]}", "nav_id": f"U_Test_0-{k:04}", "scene": "U_Test_0"}
    return filled(schemas.TASKS, key | told | {"setting": setting, "modality": modality, "start_x_m": k * 0.1})


@settings(max_examples=15)
@given(picked=st.lists(st.sampled_from(schemas.SETTINGS), max_size=40))
def test_a_filter_on_setting_or_modality_reads_no_row_in_vain(tmp_path_factory, picked):
    data = tmp_path_factory.mktemp("data")
    made = from_rows(schemas.TASKS, [task(k, s, m) for k, s in enumerate(picked) for m in ("semantic", "image")])
    path = store.write_shard(data, "tasks/train", "U_Test_0", 0, made)
    assert store.read_scene(data, "tasks/train", "U_Test_0").equals(made)
    again = from_rows(schemas.TASKS, made.to_pylist()[::-1])
    assert store.write_shard(data / "again", "tasks/train", "U_Test_0", 0, again).read_bytes() == path.read_bytes()
    fragments = list(pads.dataset(path, format="parquet").get_fragments())
    queries = [pads.field("scene") == "U_Other_0"]
    queries += [pads.field("modality") == m for m in ("semantic", "image")]
    queries += [pads.field("setting") == s for s in schemas.SETTINGS]
    queries += [(pads.field("setting") == "base") & (pads.field("modality") == "image")]
    for query in queries:
        groups = [g for fragment in fragments for g in fragment.subset(query).row_groups]
        assert sum(g.num_rows for g in groups) == made.filter(query).num_rows


def test_poses_have_no_dictionary_and_pictures_no_second_compression(smoke):
    chunks = {}
    for table in ("routes/id_train", "objects"):
        meta = pq.read_metadata(next((smoke / "release" / table).glob("*.parquet")))
        chunks |= {c["path_in_schema"]: c for c in meta.row_group(0).to_dict()["columns"]}
    told = {name: (chunk["has_dictionary_page"], chunk["compression"]) for name, chunk in chunks.items()}
    for name in ("x_m", "y_m", "z_m", "yaw_rad", "action"):
        assert told[f"{name}.list.element"] == (False, "ZSTD")
    assert told["target_object_id"] == (True, "ZSTD")
    assert told["reference_image"] == (False, "UNCOMPRESSED")


@pytest.fixture
def broken(smoke, tmp_path):
    """A copy of the small release to break."""
    shutil.copytree(smoke / "release", tmp_path / "data" / "release")
    return tmp_path / "data"


SCENE = "U_Courtyard_0"


def part(data, table):
    return data / store.shard_name(table, SCENE)


def truncate(data):
    part(data, "tasks/train").write_bytes(part(data, "tasks/train").read_bytes()[:-20])


def drop_row(data):
    path = part(data, "tasks/train")
    pq.write_table(pq.read_table(path, partitioning=None).slice(1), path)


def mix_runs(data):
    table = store.read_scene(data, "release/landmarks", SCENE)
    store.write_shard(data, "release/landmarks", SCENE, 0, table, fingerprint="of another run")


MISSING = "is missing: run aerialdojo-gen split --scene {}$"
DELETE = "delete it and run the command again$"


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda data: part(data, "routes/test").unlink(), "routes/id_test/part-{}.parquet " + MISSING),
        (lambda data: part(data, "release/scenes").unlink(), "release/scenes/part-{}.parquet " + MISSING),
        (truncate, r"tasks/id_train/part-{}.parquet is damaged .*" + DELETE),
        (drop_row, r"tasks/id_train/part-{}.parquet has \d+ rows where \d+ were written: " + DELETE),
        (
            lambda data: pq.write_table(pa.table({"x": [1]}), part(data, "release/anchors")),
            r"anchors/part-{}.parquet is damaged \(not written by aerialdojo-gen\): delete it and ",
        ),
        (mix_runs, r"the release's parts of {} in .* are of different runs: run .* split --scene {} --force$"),
    ],
)
def test_a_broken_release_is_named_by_its_file_and_its_mend(broken, damage, message):
    check_release(broken)
    damage(broken)
    with pytest.raises(StoreError) as error:
        check_release(broken)
    assert len(str(error.value).splitlines()) == 1
    assert re.search(message.replace("{}", SCENE), str(error.value))
    assert SCENE in existing_scenes(broken)


def test_every_fault_of_a_release_is_named_and_a_scene_that_is_not_in_it(smoke, broken):
    part(broken, "routes/test").unlink()
    truncate(broken)
    with pytest.raises(StoreError) as error:
        check_release(broken)
    damaged, missing = str(error.value).splitlines()
    assert damaged.startswith(f"{part(broken, 'tasks/train')} is damaged")
    assert missing.startswith(f"{part(broken, 'routes/test')} is missing")
    with pytest.raises(StoreError, match=r"U_Mall_0 is not in the release in .*: run aerialdojo-gen split --scene"):
        check_release(smoke, ["U_Mall_0"])


@pytest.fixture(scope="module")
def document(smoke):
    return json.loads((smoke / "release" / "croissant.json").read_text())


def test_mlcroissant_has_no_error_and_no_warning(smoke, caplog):
    with caplog.at_level(logging.WARNING):
        dataset = mlcroissant.Dataset(jsonld=str(smoke / "release" / "croissant.json"))
    issues = dataset.metadata.ctx.issues
    assert not issues.errors
    assert not issues.warnings
    assert not [r.getMessage() for r in caplog.records if "croissant" in r.pathname]


def test_reference_images_are_pictures(dataset):
    records = list(dataset.records("objects"))
    assert records
    for record in records:
        picture = record["objects/reference_image"]
        assert picture.size == (320, 320)
        assert record["objects/box_u1_px"] <= picture.size[0]


def test_every_column_is_there_with_meaning_and_unit(document):
    for record_set in document["recordSet"]:
        spec = TABLES[record_set["name"]].spec
        fields = {field["name"]: field for field in record_set["field"]}
        assert list(fields)[: len(spec.schema)] == spec.schema.names
        for column in spec.schema:
            assert column.metadata[b"meaning"].decode() in fields[column.name]["description"]
            if b"unit" in column.metadata:
                assert fields[column.name]["description"].endswith(f"unit: {column.metadata[b'unit'].decode()}")
        assert [k["@id"] for k in record_set["key"]] == [f"{spec.name}/{k}" for k in spec.key]


def test_file_sets_hold_every_part_once(smoke, document):
    release = smoke / "release"
    found = [path for fs in document["distribution"] for pattern in fs["includes"] for path in release.glob(pattern)]
    assert sorted(found) == sorted(release.rglob("*.parquet"))
    splits = {s for s in schemas.SUBSETS if (release / "tasks" / s).is_dir()}
    tasks = next(r for r in document["recordSet"] if r["name"] == "tasks")
    for split in splits:
        n = sum(pq.read_metadata(p).num_rows for p in (release / "tasks" / split).glob("*.parquet"))
        assert f"{split} ({n:,} rows)" in tasks["description"]
