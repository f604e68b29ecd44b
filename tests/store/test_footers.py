"""Damage to a shard's footer: told as damage, whatever bit it is; never a traceback, never a wrong row."""

import json

import pytest

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.footers import ShardFile, ShardInfo, _checksum, decode, encode
from aerialdojo_gen.store.parquet_files import write_clustered
from aerialdojo_gen.store.tables import check_table, from_rows

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
