"""JSON of any size in bounded memory: records whole, damage named, no record beyond the limit."""

import json
import subprocess
import sys

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import task_files

from aerialdojo_gen.base.errors import ImportRefused
from aerialdojo_gen.exchange import records as records_module
from aerialdojo_gen.exchange.importing import Options, import_benchmark
from aerialdojo_gen.exchange.records import records, small_document

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(), inner, max_size=5),
    max_leaves=20,
)


@settings(max_examples=25)
@given(st.lists(values, max_size=8), st.sampled_from([1, 2, 7, 64]), st.sampled_from([None, 0, 3]), st.booleans())
def test_records_are_what_json_reads_whatever_the_chunks(tmp_path_factory, rows, chunk, indent, ascii_only):
    path = tmp_path_factory.mktemp("json") / "rows.json"
    path.write_bytes(json.dumps(rows, indent=indent, ensure_ascii=ascii_only).encode("utf-8", "replace"))
    expected = json.loads(path.read_bytes())
    under = path.with_name("under.json")
    under.write_text(json.dumps({"before": [1, {"episodes": 2}], "episodes": expected, "after": "x"}))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(records_module, "_CHUNK", chunk)
        assert list(records(path)) == expected
        assert list(records(under, "episodes")) == expected


@pytest.mark.parametrize(
    ("text", "key", "error"),
    [
        ("", None, "the beginning: expected a list of records, found ''"),
        ("{}", None, "the beginning: expected a list of records, found '{'"),
        ('[{"a": 1}, {"a": ', None, r"row 1: damaged or truncated"),
        ('[{"a": 1}', None, r"row 0: expected , or \], found the end of the file \(is it truncated\?\)"),
        ('[{"a": 1} {"a": 2}]', None, r"row 0: expected , or \], found '{'"),
        ('[{"a": 1},]', None, "row 1: damaged or truncated"),
        ('{"episodes": [1],}', "episodes", "the end: damaged or truncated"),
        ('[{"a": 1}] x', None, "the end: 'x' after the end of the value"),
        ("[" * 100_000, None, "row 0: nested more than 64 deep"),
        ('[{"a": ' + "9" * 5000 + "}]", None, "row 0: damaged or truncated"),
        ('["\udcff"]', None, "is not UTF-8"),
        ('{"data": []}', "episodes", "there is no list 'episodes'"),
        ("[]", "episodes", "expected an object that has a list 'episodes'"),
    ],
)
def test_damage_is_named_by_its_row(tmp_path, text, key, error):
    path = tmp_path / "bad.json"
    path.write_text(text, errors="surrogateescape")
    with pytest.raises(ImportRefused, match=error) as refused:
        list(records(path, key))
    assert str(refused.value).startswith(f"{path}: ")
    assert "\n" not in str(refused.value)


def test_a_record_or_document_beyond_the_limit_is_refused_by_name(tmp_path, monkeypatch):
    rows = task_files.uav_on(3)
    rows[1]["description"] = "x" * 5_000_000
    path, document = task_files.write(tmp_path / "long.json", rows), task_files.write(tmp_path / "t.json", rows[1])
    import_benchmark("uav-on", [path], tmp_path, name="whole")
    assert pd.read_parquet(tmp_path / "imported/whole/tasks")["description"].str.len().max() == 5_000_000
    assert small_document(document) == rows[1]
    monkeypatch.setattr(records_module, "RECORD_LIMIT", 1 << 20)
    with pytest.raises(ImportRefused, match=r"long\.json: row 1: larger than 1,024 KiB"):
        import_benchmark("uav-on", [path], tmp_path, Options(skip_bad=True))
    assert not (tmp_path / "imported/uav-on").exists()
    # The record before it was read already: the limit is one of a record, not of the file.
    assert next(records(path))["episode_id"] == "0"
    with pytest.raises(ValueError, match="is larger than 1,024 KiB"):
        small_document(document)


MEASURE = """
import resource, sys
from pathlib import Path
from aerialdojo_gen.exchange.importing import Options, import_benchmark
for path in sys.argv[2:]:
    import_benchmark("openfly", [Path(path)], Path(sys.argv[1]), Options(frame="nwu"), force=True)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.nightly
def test_memory_does_not_grow_with_the_file(tmp_path):
    sizes = {}
    record = task_files.openfly((1, 1, 0), 1)[0] | {"index_list": ["20250109_131812_2"] * 1500}
    for n in (100, 2000):
        path = tmp_path / f"{n}.json"
        with path.open("w") as file:
            for i in range(n):
                record["image_path"] = f"env_airsim_16/astar_data/high_long/{i}"
                file.write(("," if i else "[") + json.dumps(record))
            file.write("]")
        sizes[path] = path.stat().st_size
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, tmp_path, *sizes], capture_output=True, text=True, check=True
    )
    small, large = (int(line) * 1024 for line in done.stdout.split())
    grown = max(sizes.values()) - min(sizes.values())
    assert grown > 50e6
    assert large - small < grown / 4
