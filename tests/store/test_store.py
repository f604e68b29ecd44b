"""Shards are whole, checked, the same bytes every time, and never outside their folder."""

import subprocess
import sys
import textwrap

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import filled

from aerialdojo_gen.base.errors import DamagedFile, StoreError
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.store.tables import content_digest, from_rows

finite = st.floats(-1e6, 1e6)


def pair(i, scene="U_Test_0"):
    own = {"scene": scene, "pair_id": f"{i}_0__{i + 1}", "euclidean_m": 4.5 + i, "target_visible_at_start": i / 1000}
    return filled(schemas.PAIRS, own | {"visible_view_at_start": "left" if i else None})


def plan(pair_id, n, value):
    lists = {name: [value] * n for name in ("x_m", "y_m", "z_m", "yaw_rad")} | {"action": [1] * n}
    own = {"scene": "U_Test_0", "pair_id": pair_id, "length_m": float(n), "free_length_m": value, **lists}
    return filled(schemas.PLANS, own | {"straight_line_free": bool(n % 2), "agent_action": [1] * n if n else None})


def write(data, rows, **kw):
    return store.write_shard(data, "pairs", "U_Test_0", 0, from_rows(schemas.PAIRS, rows), **kw)


@settings(max_examples=30, deadline=None)
@given(rows=st.lists(st.tuples(st.integers(0, 20), finite), max_size=8, unique_by=lambda r: r[0]))
def test_round_trip_with_lists(tmp_path_factory, rows):
    data = tmp_path_factory.mktemp("data")
    table = from_rows(schemas.PLANS, [plan(f"p{i:02}", i, v) for i, v in rows])
    store.write_shard(data, "plans", "U_Test_0", 0, table)
    assert store.read_scene(data, "plans", "U_Test_0").equals(table)


def test_pandas_reads_table_and_scene(tmp_path):
    for scene in ("U_Test_0", "U_Test_1"):
        table = from_rows(schemas.PAIRS, [pair(i, scene) for i in range(3)])
        store.write_shard(tmp_path, "pairs", scene, 0, table)
    whole = pd.read_parquet(tmp_path / "pairs")
    assert len(whole) == 6
    assert set(whole["scene"]) == {"U_Test_0", "U_Test_1"}
    assert len(pd.read_parquet(tmp_path / "pairs" / "U_Test_1")) == 3


def test_units_and_meanings_stand_in_the_file(tmp_path):
    field = pq.read_schema(write(tmp_path, [pair(0)])).field("euclidean_m")
    assert field.metadata[b"unit"] == b"m"
    assert b"d_E" in field.metadata[b"meaning"]


def test_every_column_is_described():
    for place in store.LAYOUT.values():
        for field in place.spec.schema:
            assert field.metadata[b"meaning"], field.name
            for suffix, unit in (("_m", b"m"), ("_rad", b"rad"), ("_px", b"px"), ("_s", b"s"), ("_deg", b"deg")):
                if field.name.endswith(suffix):
                    assert field.metadata[b"unit"] == unit, field.name


def test_same_rows_same_bytes_in_any_order_and_process(tmp_path):
    rows = [pair(i) for i in range(50)]
    first = write(tmp_path / "a", rows, fingerprint="f").read_bytes()
    assert write(tmp_path / "b", rows[::-1], fingerprint="f").read_bytes() == first


def test_rows_with_a_missing_or_unknown_column_are_refused():
    row = pair(0)
    row["euclidian_m"] = row.pop("euclidean_m")
    with pytest.raises(StoreError, match=r"lacks \['euclidean_m'\] and has unknown \['euclidian_m'\]"):
        from_rows(schemas.PAIRS, [row])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.set_column(5, "euclidean_m", pa.array([1.0, None, 2.0])), "1 nulls in column euclidean_m"),
        (lambda t: t.take([1, 0, 2]), "not sorted by scene, pair_id"),
        (lambda t: t.take([0, 0, 1]), r"duplicate key \(scene, pair_id\)"),
        (lambda t: t.drop_columns("euclidean_m"), "columns .* are not those"),
        (lambda t: t.set_column(5, "euclidean_m", pa.array([1, 2, 3])), "types differ"),
    ],
)
def test_tables_that_do_not_fit_are_refused_and_leave_nothing(tmp_path, change, message):
    table = change(from_rows(schemas.PAIRS, [pair(i) for i in range(3)]))
    with pytest.raises(StoreError, match=message):
        store.write_shard(tmp_path, "pairs", "U_Test_0", 0, table)
    assert not list(tmp_path.rglob("*.parquet"))


def test_a_null_inside_a_list_is_refused(tmp_path):
    table = from_rows(schemas.PLANS, [plan("p", 2, 1.0) | {"x_m": [1.0, None]}])
    with pytest.raises(StoreError, match="1 nulls in column x_m"):
        store.write_shard(tmp_path, "plans", "U_Test_0", 0, table)


@pytest.mark.parametrize("keep", [0, 3, 200, -1])
def test_a_truncated_shard_is_named(tmp_path, keep):
    path = write(tmp_path, [pair(i) for i in range(20)])
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(StoreError, match=f"{path} is damaged"):
        store.read_scene(tmp_path, "pairs", "U_Test_0")


def test_flipped_bits_in_the_data_are_found(tmp_path):
    path = write(tmp_path, [pair(i) for i in range(500)])
    raw = bytearray(path.read_bytes())
    for i in range(200, 260):
        raw[i] ^= 0xFF
    path.write_bytes(raw)
    with pytest.raises(StoreError, match="is damaged"):
        store.read_scene(tmp_path, "pairs", "U_Test_0")


def test_a_missing_part_says_what_to_run(tmp_path):
    write(tmp_path, [pair(0)], parts=2)
    with pytest.raises(StoreError, match=r"missing or incomplete.*run aerialdojo-gen pair-objects --scene U_Test_0"):
        store.read_scene(tmp_path, "pairs", "U_Test_0")


def by_pandas(path):
    pd.read_parquet(path).to_parquet(path)


def zeros_in_the_footer(path):
    path.write_bytes(path.read_bytes().replace(store.META, bytes(len(store.META))))


READERS = {
    "count_rows": store.count_rows, "content": store.content, "read_scene": store.read_scene,
    "read_stored": lambda *where: store.read_stored(*where, ["pair_id"]),
}  # fmt: skip


@pytest.mark.parametrize("damage", [by_pandas, zeros_in_the_footer])
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_part_without_our_footer_is_named(tmp_path, read, damage):
    where = tmp_path, "pairs", "U_Test_0"
    for part in range(3):
        store.write_shard(*where, part, from_rows(schemas.PAIRS, [pair(10 * part + i) for i in range(4)]), parts=3)
    assert store.count_rows(*where) == 12
    path = store.shard_path(*where, 1)
    damage(path)
    with pytest.raises(DamagedFile, match=rf"{path} is damaged \(.*\): delete it and run"):
        read(*where)


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_part_of_another_division_does_not_stand_for_one_that_is_missing(tmp_path, read):
    where = tmp_path, "pairs", "U_Test_0"
    for part, parts in ((0, 2), (2, 3)):
        store.write_shard(*where, part, from_rows(schemas.PAIRS, [pair(part)]), parts=parts)
    with pytest.raises(StoreError, match="pairs of U_Test_0 is missing or incomplete"):
        read(*where)


def test_a_file_that_the_system_does_not_open_is_not_called_damaged(tmp_path):
    path = write(tmp_path, [pair(0)])
    code = f"""
        import resource
        from pathlib import Path
        from aerialdojo_gen.base.errors import StoreError
        from aerialdojo_gen.store.parquet_files import read_file, read_footer
        resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))
        for read in read_file, read_footer:
            try:
                read(Path({str(path)!r}))
            except StoreError as error:
                print(error)
    """
    out = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=True)
    assert out.stdout == f"cannot read {path}: Too many open files\n" * 2


@pytest.mark.parametrize("scene", ["../outside", "/etc", "a/b", "", ".hidden", "x" * 65, "a\n"])
def test_scene_names_cannot_leave_the_folder(tmp_path, scene):
    with pytest.raises(StoreError, match="not a scene name"):
        store.shard_path(tmp_path, "pairs", scene)


@pytest.mark.parametrize("relative", ["../x", "/tmp/x", "a/../../x", "link/x"])
def test_file_outputs_cannot_leave_the_folder(tmp_path, relative):
    data = tmp_path / "data"
    data.mkdir()
    (data / "link").symlink_to(tmp_path)
    with pytest.raises(StoreError, match="points outside the data directory"), atomic_file(data, relative):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["data"]


# A process that may not write files beyond 4 kB stands for a full disk: the write fails half-way for real.
NO_ROOM = """
import resource, signal, sys
import pyarrow.parquet as pq
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.store.shards import write_shard
table = pq.read_table(sys.argv[1])
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
try:
    write_shard(sys.argv[2], "pairs", "U_Test_0", 0, table)
except StoreError as error:
    print(error)
"""


def test_no_room_is_one_line_and_nothing_half_written(tmp_path):
    rows, data = tmp_path / "rows.parquet", tmp_path / "data"
    pq.write_table(from_rows(schemas.PAIRS, [pair(i) for i in range(5000)]), rows)
    out = subprocess.run(
        [sys.executable, "-c", NO_ROOM, rows, data], capture_output=True, text=True, check=True
    ).stdout
    assert out.count("\n") == 1
    assert "cannot write" in out
    assert "would exceed the allowed size" in out
    assert not [p for p in data.rglob("*") if p.is_file()]


def test_digest_sees_every_change_and_no_metadata():
    table = from_rows(schemas.PAIRS, [pair(i) for i in range(5)])
    digest = content_digest(table)
    assert content_digest(table.replace_schema_metadata({"a": "b"})) == digest
    assert content_digest(pa.concat_tables([table[:2], table[2:]])) == digest
    changed = table.set_column(5, "euclidean_m", pa.array([4.5, 5.5, 6.5, 7.5, 8.500001]))
    assert content_digest(changed) != digest


def test_digest_does_not_see_what_lies_under_a_null(tmp_path):
    masked = pa.array(np.array([1.0, 7.0]), mask=np.array([False, True]))
    clean = pa.array([1.0, None])
    assert content_digest(pa.table({"a": masked})) == content_digest(pa.table({"a": clean}))
    assert content_digest(pa.table({"a": [1.0, None]})) != content_digest(pa.table({"a": [None, 1.0]}))


@pytest.mark.parametrize("table", sorted(store.LAYOUT))
def test_pruning_one_scene_leaves_the_others(tmp_path, table):
    mine, other = (store.shard_path(tmp_path, table, scene) for scene in ("U_A_0", "U_B_0"))
    for path in (mine, other):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    extra = mine.with_name("part-00001.parquet")
    extra.write_text("x")
    store.prune(tmp_path, table, "U_A_0", 1)
    assert mine.exists()
    assert other.exists()
    assert extra.exists() == ("{part:" not in store.LAYOUT[table].template)
