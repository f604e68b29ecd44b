"""Shards are whole, checked, the same bytes every time, never outside their folder; damage is told, to the bit."""

import contextlib
import io
import itertools
import json
import resource

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import filled

from aerialdojo_gen.base.errors import DamagedFile, StoreError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import atomic_file
from aerialdojo_gen.store.footers import ShardFile, ShardInfo, _checksum, decode, encode
from aerialdojo_gen.store.tables import (
    check_table,
    content_digest,
    from_rows,
    read_file,
    read_footer,
    write_clustered,
)

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


def test_pandas_reads_table_and_scene_and_units_stand_in_the_file(tmp_path):
    for scene in ("U_Test_0", "U_Test_1"):
        table = from_rows(schemas.PAIRS, [pair(i, scene) for i in range(3)])
        path = store.write_shard(tmp_path, "pairs", scene, 0, table)
    assert pd.read_parquet(tmp_path / "pairs")["scene"].value_counts().to_dict() == {"U_Test_0": 3, "U_Test_1": 3}
    assert len(pd.read_parquet(tmp_path / "pairs" / "U_Test_1")) == 3
    field = pq.read_schema(path).field("euclidean_m")
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


def cut(keep):
    return lambda raw: raw[:keep]


def flipped(raw):
    return raw[:200] + bytes(byte ^ 0xFF for byte in raw[200:260]) + raw[260:]


def no_footer_of_ours(raw):
    return raw.replace(store.META, bytes(len(store.META)))


def by_pandas(raw):
    return pd.read_parquet(io.BytesIO(raw)).to_parquet()


READERS = {
    "count_rows": store.count_rows, "content": store.content, "read_scene": store.read_scene,
    "read_stored": lambda *where: store.read_stored(*where, ["pair_id"]),
}  # fmt: skip


@pytest.mark.parametrize(
    ("damage", "read"),
    # Flipped bits in the pages are found by who reads them.
    [*itertools.product([cut(0), cut(3), cut(200), cut(-1), by_pandas, no_footer_of_ours], READERS.values()),
     (flipped, store.read_scene)],
)  # fmt: skip
def test_a_damaged_part_is_named(tmp_path, damage, read):
    where = tmp_path, "pairs", "U_Test_0"
    for part in range(3):
        store.write_shard(*where, part, from_rows(schemas.PAIRS, [pair(50 * part + i) for i in range(40)]), parts=3)
    assert store.count_rows(*where) == 120
    path = where[0] / store.shard_name(*where[1:], 1)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(DamagedFile, match=rf"{path} is damaged \(.*\): delete it and run"):
        read(*where)


@pytest.mark.parametrize("divisions", [[(0, 2)], [(0, 2), (2, 3)]])
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_missing_part_says_what_to_run_and_one_of_another_division_does_not_stand_for_it(tmp_path, read, divisions):
    where = tmp_path, "pairs", "U_Test_0"
    for part, parts in divisions:
        store.write_shard(*where, part, from_rows(schemas.PAIRS, [pair(part)]), parts=parts)
    told = "pairs of U_Test_0 is missing or incomplete.*run aerialdojo-gen pair-objects --scene U_Test_0"
    with pytest.raises(StoreError, match=told):
        read(*where)


@contextlib.contextmanager
def limited(kind, most):
    """Hold this process to a limit."""
    before = resource.getrlimit(kind)
    resource.setrlimit(kind, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(kind, before)


@pytest.mark.parametrize("read", [read_file, read_footer])
def test_a_file_that_the_system_does_not_open_is_not_called_damaged(tmp_path, read):
    path = write(tmp_path, [pair(0)])
    with pytest.raises(StoreError) as told, limited(resource.RLIMIT_NOFILE, 3):
        read(path)
    assert str(told.value) == f"cannot read {path}: Too many open files"


def test_no_room_is_one_line_and_nothing_half_written(tmp_path):
    """Files of 4 kB at most stand for a full disk: the write fails half-way for real."""
    table = from_rows(schemas.PAIRS, [pair(i) for i in range(5000)])
    told = r"^cannot write \S+: [^\n]*would exceed the allowed size[^\n]*$"
    with pytest.raises(StoreError, match=told), limited(resource.RLIMIT_FSIZE, 4096):
        store.write_shard(tmp_path, "pairs", "U_Test_0", 0, table)
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]


@pytest.mark.parametrize("scene", ["../outside", "/etc", "a/b", "", ".hidden", "x" * 65, "a\n"])
def test_scene_names_cannot_leave_the_folder(tmp_path, scene):
    with pytest.raises(StoreError, match="not a scene name"):
        store.shard_name("pairs", scene)


@pytest.mark.parametrize("relative", ["../x", "/tmp/x", "a/../../x", "link/x"])
def test_file_outputs_cannot_leave_the_folder(tmp_path, relative):
    data = tmp_path / "data"
    data.mkdir()
    (data / "link").symlink_to(tmp_path)
    with pytest.raises(StoreError, match="points outside the data directory"), atomic_file(data, relative):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["data"]


def test_digest_sees_every_change_and_no_metadata_chunks_or_what_lies_under_a_null():
    table = from_rows(schemas.PAIRS, [pair(i) for i in range(5)])
    digest = content_digest(table)
    assert content_digest(table.replace_schema_metadata({"a": "b"})) == digest
    assert content_digest(pa.concat_tables([table[:2], table[2:]])) == digest
    changed = table.set_column(5, "euclidean_m", pa.array([4.5, 5.5, 6.5, 7.5, 8.500001]))
    assert content_digest(changed) != digest
    masked = pa.array(np.array([1.0, 7.0]), mask=np.array([False, True]))
    assert content_digest(pa.table({"a": masked})) == content_digest(pa.table({"a": [1.0, None]}))
    assert content_digest(pa.table({"a": [1.0, None]})) != content_digest(pa.table({"a": [None, 1.0]}))


@pytest.mark.parametrize("table", sorted(store.LAYOUT))
def test_pruning_one_scene_leaves_the_others(tmp_path, table):
    mine, other = (tmp_path / store.shard_name(table, scene) for scene in ("U_A_0", "U_B_0"))
    extra = mine.with_name("part-00001.parquet")
    for path in (mine, other, extra):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    store.prune(tmp_path, table, "U_A_0", 1)
    assert mine.exists()
    assert other.exists()
    assert extra.exists() == ("{part:" not in store.LAYOUT[table].template)


SCENE = "U_Test_0"
INFO = ShardInfo(
    "f" * 64, "c" * 64, {"scene": "0" * 32, "x_m": "1" * 32}, 3, 2,
    {"rows_in": 3, "rows_out": 2, "counts": {"no_path": 1}},
    {"meshes/a.glb": ShardFile(7, "a" * 64), "b": ShardFile(8, "")},
)  # fmt: skip
STRANGE = [
    b"null", b"[]", b"", b"{}", b"\xff\xfe", b'{"rows": NaN}', b'{"rows": ' + b"9" * 5000 + b"}", b"[" * 100_000,
]  # fmt: skip


def flips(raw):
    for at in range(len(raw)):
        for bit in range(8):
            yield raw[:at] + bytes([raw[at] ^ 1 << bit]) + raw[at + 1 :]


def shard(data, n=60):
    rows = [
        {"scene": SCENE, "pair_id": f"p{k:04}", "start_object_id": k % 7, "start_anchor_id": k % 3,
         "target_object_id": k % 5 + 7, "euclidean_m": 3.0 + k / 8, "target_visible_at_start": k / n,
         "visible_view_at_start": "down" if k else None}
        for k in range(n)
    ]  # fmt: skip
    table = from_rows(schemas.PAIRS, rows)
    return store.write_shard(data, "pairs", SCENE, 0, table, fingerprint="f" * 64, summary=INFO.summary)


def test_a_footer_says_what_was_written_and_every_flipped_bit_is_found():
    raw = encode(INFO)
    assert decode(raw) == INFO
    assert encode(decode(raw)) == raw
    for damaged in (*flips(raw), *STRANGE):
        with pytest.raises(ValueError, match="its footer"):
            decode(damaged)


@pytest.mark.parametrize(
    "change",
    [{"rows": "3"}, {"rows": True}, {"rows": -1}, {"parts": 1.0}, {"content": "short"}, {"fingerprint": None},
     {"columns": []}, {"columns": {"a": 1}}, {"summary": []}, {"summary": {"rows_in": 1}},
     {"summary": {"rows_in": 1, "rows_out": 1, "counts": {"x": "1"}}}, {"files": {"a": [1]}}, {"files": {"a": 1}}],
)  # fmt: skip
def test_values_of_a_wrong_type_are_refused_also_under_a_right_checksum(change):
    facts = json.loads(encode(INFO)) | change
    facts.pop("checksum")
    with pytest.raises(ValueError, match="impossible values"):
        decode(json.dumps(facts | {"checksum": _checksum(facts)}).encode())


def test_bits_flipped_anywhere_in_the_footer_give_an_error_or_the_rows(tmp_path):
    path = shard(tmp_path)
    raw = path.read_bytes()
    begin = len(raw) - 8 - int.from_bytes(raw[-8:-4], "little")
    wanted = store.read_scene(tmp_path, "pairs", SCENE)
    drawn = generator(5, "flips", 0).choice(8 * (len(raw) - begin), 120, replace=False)
    spots = [(begin + int(k) // 8, int(k) % 8) for k in drawn]
    # Before columns had digests, 3 of 8,000 such flips gave other rows without a word: at the end of the row groups,
    # which stands before the metadata.
    meta = raw.index(b'{"checksum"')
    spots += [(at, bit) for at in range(meta - 40, meta) for bit in range(8)]
    found = 0
    for at, bit in spots:
        path.write_bytes(raw[:at] + bytes([raw[at] ^ 1 << bit]) + raw[at + 1 :])
        try:
            read = store.read_scene(tmp_path, "pairs", SCENE)
        except StoreError:
            found += 1
        else:
            assert read.equals(wanted), (at - begin, bit)
            assert read.schema.equals(wanted.schema, check_metadata=True), (at - begin, bit)
    assert found > len(spots) / 3


def test_a_page_that_stands_for_another_column_is_found(tmp_path):
    """Every checksum of Parquet is right: only the digests of the columns tell."""
    path = shard(tmp_path)
    table = store.read_scene(tmp_path, "pairs", SCENE)
    info = store.read_info(path.parent, path.name)
    swapped = check_table(schemas.PAIRS, table.set_column(4, "target_object_id", table["start_object_id"]))
    write_clustered(schemas.PAIRS, swapped.replace_schema_metadata({store.META: encode(info)}), path)
    with pytest.raises(StoreError, match=r"is damaged \(other rows than were written\)"):
        store.read_scene(tmp_path, "pairs", SCENE)
    with pytest.raises(StoreError, match="other rows"):
        store.read_scene(tmp_path, "pairs", SCENE, ["target_object_id"])
    assert store.read_scene(tmp_path, "pairs", SCENE, ["euclidean_m"]).num_rows == table.num_rows
