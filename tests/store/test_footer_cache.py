"""What is kept of footers is what they say: never of shards that have changed, never in the way."""

import os
import shutil

import pytest
from support.handmade import filled

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.store import footers, schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.footers import cached_footers
from aerialdojo_gen.store.root import LocalRoot
from aerialdojo_gen.store.tables import from_rows

pytestmark = pytest.mark.usefixtures("cache")

SCENE = "U_Test_0"


class Counted(LocalRoot):
    """Says which of its files were opened."""

    opened: list[str] = []  # noqa: RUF012

    def open(self, relative):
        self.opened.append(relative)
        return super().open(relative)


@pytest.fixture
def at_once(monkeypatch):
    """What has just been written is kept too, so that no test waits for it to come of age."""
    monkeypatch.setattr(footers, "_TIME_RESOLUTION_NS", -1)


def shard(folder, fingerprint="f" * 64, rows=3):
    made = [filled(schemas.LANDMARKS, {"scene": SCENE, "landmark_id": k}) for k in range(rows)]
    table = from_rows(schemas.LANDMARKS, made)
    files = {"meshes/a.glb": store.ShardFile(7, "a" * 64)}
    summary = {"rows_in": rows, "rows_out": rows, "counts": {"kept": rows}}
    store.write_shard(folder, "landmarks", SCENE, 0, table, fingerprint=fingerprint, summary=summary, files=files)
    return folder / store.shard_name("landmarks", SCENE)


def asked(folder):
    """What a process that begins now reads of the shard, and whether it had to open it."""
    store._read_info.cache_clear()
    Counted.opened.clear()
    root = Counted(folder)
    with cached_footers(root):
        info = store.read_info(root, store.shard_name("landmarks", SCENE))
    return info, bool(Counted.opened)


def test_a_footer_is_read_once(tmp_path, at_once):
    shard(tmp_path / "data")
    first, again, third = (asked(tmp_path / "data") for _ in range(3))
    assert first == (again[0], True)
    assert again == third == (first[0], False)
    assert first[0].files["meshes/a.glb"] == store.ShardFile(7, "a" * 64)
    assert first[0].summary["counts"] == {"kept": 3}


def test_a_shard_that_was_replaced_is_read_again_and_damage_that_keeps_size_and_time_is_found(tmp_path, at_once):
    path = shard(tmp_path / "data")
    asked(tmp_path / "data")
    shard(tmp_path / "data", "e" * 64)
    assert asked(tmp_path / "data")[0].fingerprint == "e" * 64
    before, raw = path.stat(), path.read_bytes()
    with path.open("r+b") as file:
        file.seek(raw.index(b'{"checksum"') + 20)
        file.write(b"?")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    after = path.stat()
    assert (after.st_size, after.st_mtime_ns, after.st_ino) == (before.st_size, before.st_mtime_ns, before.st_ino)
    with pytest.raises(StoreError, match="is damaged"):
        asked(tmp_path / "data")


@pytest.mark.parametrize("why", ["written just now", "a copy elsewhere", "no room for a memory"])
def test_where_nothing_is_kept_footers_are_read(tmp_path, cache, monkeypatch, why):
    if why != "written just now":
        monkeypatch.setattr(footers, "_TIME_RESOLUTION_NS", -1)
    if why == "no room for a memory":
        cache.write_text("a file where the folder should be")
    shard(tmp_path / "data")
    asked(tmp_path / "data")
    again = tmp_path / "data"
    if why == "a copy elsewhere":
        again = shutil.copytree(again, tmp_path / "copy")
    assert asked(again)[1]


@pytest.mark.parametrize("text", [b"", b"x\n{}", b"null", b"\xff\n\xff"])
def test_a_damaged_memory_is_none(tmp_path, cache, at_once, text):
    shard(tmp_path / "data")
    first = asked(tmp_path / "data")
    (memory,) = (cache / "footers").iterdir()
    memory.write_bytes(text)
    assert asked(tmp_path / "data") == first
    assert asked(tmp_path / "data") == (first[0], False)


def test_shards_that_are_gone_are_forgotten(tmp_path, cache, at_once):
    path = shard(tmp_path / "data")
    asked(tmp_path / "data")
    (memory,) = (cache / "footers").iterdir()
    assert SCENE.encode() in memory.read_bytes()
    path.rename(path.with_name("part-00001.parquet"))
    root = Counted(tmp_path / "data")
    with cached_footers(root):
        store.cache_footers(root, store.shards(root, "landmarks", SCENE))
    said = memory.read_bytes()
    assert b"part-00001.parquet" in said
    assert b"part-00000.parquet" not in said
