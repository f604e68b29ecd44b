"""What holds for every data root, be it a directory or a prefix on an S3 server."""

from __future__ import annotations

import hashlib
import os
import pickle  # noqa: TID251 - executors send roots to other processes
from pathlib import Path

import pytest
from support.handmade import filled
from support.s3_server import fill, read_folder, write

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.dataset.contents import existing_scenes, prune_release
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import LocalRoot, open_root
from aerialdojo_gen.store.tables import from_rows

SCENE = "U_Test_0"
PAIR = filled(schemas.PAIRS, {"scene": SCENE, "pair_id": "1_0__2", "euclidean_m": 5.0})


def test_a_file_is_what_was_committed(root):
    for data in (b"one", b"", b"another"):
        write(root, "meshes/a.glb", data)
        assert root.local_copy("meshes/a.glb").read_bytes() == data
        assert root.size("meshes/a.glb") == len(data)
        for reread in (False, True):
            assert root.digest("meshes/a.glb", reread=reread) == hashlib.sha256(data).hexdigest()
        with root.open("meshes/a.glb") as file:
            file.seek(1)
            assert file.read() == data[1:]
        assert root.is_whole("meshes/a.glb", len(data), hashlib.sha256(data).hexdigest())
        assert not root.is_whole("meshes/a.glb", len(data) + 1)
    assert root.local_copy("meshes/a.glb").name == "a.glb", "readers go by suffixes"


def test_what_fails_leaves_the_old_one_and_what_is_made_is_not_there_before_it_is_whole(root, tmp_path):
    write(root, "meshes/a.glb", b"old")
    fill(root, "media/S/n", {"a": b"old"})
    version = root.version("meshes/a.glb")
    for commit in (root.commit("meshes/a.glb"), root.commit_folder("media/S/n")):
        path = commit.__enter__()
        (path / "b" if path.is_dir() else path).write_bytes(b"half")
        assert read_folder(root, "media/S/n") == {"a": b"old"}
        assert not commit.__exit__(ZeroDivisionError, ZeroDivisionError(), None)
    assert root.local_copy("meshes/a.glb").read_bytes() == b"old"
    assert root.version("meshes/a.glb") == version
    assert read_folder(root, "media/S/n") == {"a": b"old"}
    left = {p.relative_to(tmp_path / "data").as_posix() for p in (tmp_path / "data").rglob("*")}
    whole = {"meshes", "meshes/a.glb", "media", "media/S", "media/S/n", "media/S/n/a"}
    assert left == (whole if isinstance(root, LocalRoot) else set()), "nothing temporary"


def test_a_folder_is_replaced_with_all_that_is_in_it(root):
    fill(root, "media/S/n", {"a.mp4": b"1", "b/0.png": b"2", "b/1.png": b"3"})
    assert read_folder(root, "media/S/n") == {"a.mp4": b"1", "b/0.png": b"2", "b/1.png": b"3"}
    assert read_folder(root, "media/S/n/b") == {"0.png": b"2", "1.png": b"3"}
    assert root.digest("media/S/n/b") == hashlib.sha256(b"23").hexdigest()
    fill(root, "media/S/n", {"a.mp4": b"11", "c.mp4": b"4"})
    again = open_root(root.url)
    again.refresh()
    for one in (root, again):
        assert read_folder(one, "media/S/n") == {"a.mp4": b"11", "c.mp4": b"4"}
        assert one.size("media/S/n") == 3
        assert one.local_copy("media/S/n/a.mp4").read_bytes() == b"11"
        assert not one.exists("media/S/n/b/0.png")
    assert root.list("media/S/n") == ["media/S/n/a.mp4", "media/S/n/c.mp4"], "no generation is left"


def test_what_is_not_there_is_not_found(root):
    write(root, "meshes/a.glb", b"1")
    for name in ("meshes/b.glb", "meshes/a", "plans/S/part-00000.parquet", "a", "media/S/n", "media/S/n/a.mp4"):
        assert not root.exists(name)
        for ask in (root.local_copy, root.size, root.digest, root.version, root.open):
            with pytest.raises(FileNotFoundError):
                ask(name)
    assert root.list("plans") == root.list("media/S") == []
    for name in ("../a", "/a", "meshes/../../a"):
        with pytest.raises(StoreError, match="points outside"):
            root.local_copy(name)


def test_names_are_listed_as_paths_are_globbed(root):
    names = ["t/U_A_0/part-00000.parquet", "t/U_A_0/part-00001.parquet", "t/U_B_1/part-00000.parquet", "t/note.json"]
    for name in names:
        write(root, name, b"x")
    assert root.list("t") == ["t/U_A_0", "t/U_B_1", "t/note.json"]
    assert root.list("t", "*/part-*.parquet") == names[:3]
    assert root.list("t/U_A_0", "part-0000[1-9].parquet") == names[1:2]
    assert root.list("t", "U_?_0") == ["t/U_A_0"]
    assert "t" in root.list("")
    assert root.below("t").list("U_A_0") == ["U_A_0/part-00000.parquet", "U_A_0/part-00001.parquet"]


def test_what_is_deleted_is_gone(root):
    write(root, "t/a/x", b"1")
    write(root, "t/a/y", b"1")
    write(root, "t/ab", b"1")
    fill(root, "media/S/n", {"a": b"1"})
    for name in ("t/a", "media/S/n", "t/nothing"):
        root.delete(name)
        assert not root.exists(name)
    assert root.list("t") == ["t/ab"]
    assert not root.list("media/S/n")


def test_tables_are_the_same_in_every_root(root, tmp_path):
    table = from_rows(schemas.PAIRS, [PAIR])
    written = store.write_shard(root, "pairs", SCENE, 0, table, fingerprint="f" * 64, parts=1)
    other = store.write_shard(tmp_path / "other", "pairs", SCENE, 0, table, fingerprint="f" * 64, parts=1)
    assert written.read_bytes() == other.read_bytes()
    (name,) = store.shards(root, "pairs", SCENE)
    assert name == store.shard_name("pairs", SCENE) == other.relative_to(tmp_path / "other").as_posix()
    assert store.read_info(root, name) == store.read_info(other.parent, other.name)
    assert store.read_scene(root, "pairs", SCENE).equals(table.replace_schema_metadata(None))
    assert store.count_rows(root, "pairs", SCENE) == 1
    store.prune(root, "pairs", SCENE, 0)
    assert store.shards(root, "pairs", SCENE) == []
    with pytest.raises(StoreError, match=r"pairs of U_Test_0 is missing or incomplete in .*run aerialdojo-gen pair"):
        store.read_scene(root, "pairs", SCENE)


def test_the_release_knows_its_scenes(root):
    for scene in ("U_A_0", "U_B_1"):
        write(root, store.shard_name("tasks/train", scene), b"x")
        write(root, store.shard_name("release/scenes", scene), b"x")
    assert existing_scenes(root) == ["U_A_0", "U_B_1"]
    assert prune_release(root, ["U_A_0"]) == ["U_B_1"]
    assert existing_scenes(root) == ["U_A_0"]


def test_a_root_travels(root):
    write(root, "t/a/x", b"1")
    other = pickle.loads(pickle.dumps(root))
    assert other == root
    assert hash(other) == hash(root)
    assert other.local_copy("t/a/x").read_bytes() == b"1"


def test_one_run_holds_a_root(root, monkeypatch):
    # Who asks waits for a renewal: a third of so many seconds.
    monkeypatch.setenv("AERIALDOJO_LEASE_S", "8")
    with root.lock():
        write(root, "t/a/x", b"1")
        with pytest.raises(StoreError, match="another run is writing to"), open_root(root.url).lock():
            pass
        with root.below("runs/a").lock():
            pass
    with root.lock():
        assert root.exists("t/a/x")


def test_where_data_may_lie(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert open_root("data") == open_root(Path("data")) == LocalRoot(tmp_path / "data")
    assert open_root(f"file://{tmp_path}") == LocalRoot(tmp_path)
    assert open_root("s3://bucket/a//b/").url == "s3://bucket/a/b"
    for wrong in ("memory://a", "http://host/a", "s3://", "s3:///a", "file://a", "gopher://a/b"):
        with pytest.raises(UsageError):
            open_root(wrong)
    with pytest.raises(UsageError, match="credentials do not belong in a URL") as told:
        open_root("s3://AKIAX:verysecret@bucket/a")
    assert "verysecret" not in str(told.value)
    assert "AKIAX" not in str(told.value)


def test_a_large_file_goes_up_in_parts(cloud):
    root, data = open_root(cloud), os.urandom(17 << 20)
    write(root, "meshes/a.glb", data)
    assert root.version("meshes/a.glb").rstrip('"').endswith("-3")
    assert hashlib.sha256(data).hexdigest() == root.digest("meshes/a.glb", reread=True)
