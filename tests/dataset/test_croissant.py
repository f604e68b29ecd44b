"""croissant.json: MLCommons' own library finds nothing to complain of in it, and reads the release by it."""

import json
import logging

import mlcroissant
import pyarrow.parquet as pq
import pytest

from aerialdojo_gen.dataset.contents import TABLES, check_release
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store


@pytest.fixture(scope="module")
def document(smoke):
    return json.loads((smoke / "release" / "croissant.json").read_text())


@pytest.fixture(scope="module")
def dataset(smoke):
    return mlcroissant.Dataset(jsonld=str(smoke / "release" / "croissant.json"))


def test_mlcroissant_has_no_error_and_no_warning(smoke, caplog):
    with caplog.at_level(logging.WARNING):
        dataset = mlcroissant.Dataset(jsonld=str(smoke / "release" / "croissant.json"))
    issues = dataset.metadata.ctx.issues
    assert not issues.errors
    assert not issues.warnings
    assert not [r.getMessage() for r in caplog.records if "croissant" in r.pathname]


@pytest.mark.parametrize("table", [name for name in TABLES if name != "objects"])
def test_records_are_the_rows(smoke, dataset, table):
    spec = TABLES[table].spec
    names = [
        name for name, place in store.LAYOUT.items() if place.spec is spec and place.template.startswith("release/")
    ]
    wanted = {}
    for scene in check_release(smoke):
        for name in names:
            for row in store.read_scene(smoke, name, scene).to_pylist():
                wanted[tuple(row[k] for k in spec.key)] = row
    seen = set()
    for record in dataset.records(table):
        row = {k.removeprefix(f"{table}/"): v.decode() if isinstance(v, bytes) else v for k, v in record.items()}
        key = tuple(row[k] for k in spec.key)
        split = row.pop("split", None)
        assert row == wanted[key]
        if table == "tasks":
            assert split == f"{row['partition'].lower()}_{row['subset']}"
        seen.add(key)
    assert seen == set(wanted)


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
