"""Faults of a store and of the way to it: asked again where that helps, else one line; nothing half-written."""

from __future__ import annotations

import os
import socket
import subprocess
import sys

import pytest
from support.command_line import called
from support.s3_server import Proxy, fill, forget_clients, read_folder, write

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.bucket import Bucket
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.tables import from_rows

# Goes up in three parts.
BIG = os.urandom(17 << 20)


@pytest.mark.parametrize("how", [503, "drop", 0.5])
def test_a_fault_that_passes_is_not_seen(cloud: str, proxy: Proxy, how: int | str | float):
    root = open_root(cloud)
    proxy.fail("^PUT", how)
    write(root, "t/a/x", b"some bytes")
    proxy.fail("^GET", how)
    again = open_root(cloud)
    again.refresh()
    assert again.digest("t/a/x", reread=True) == root.digest("t/a/x")
    assert proxy.left() == 0


def test_parts_of_an_upload_are_put_again(cloud: str, proxy: Proxy):
    root = open_root(cloud)
    proxy.fail("^PUT .*partNumber=2", 500)
    proxy.fail("^PUT .*partNumber=3", "drop")
    write(root, "t/a/x", BIG)
    assert proxy.left() == 0
    assert root.below("t").digest("a/x", reread=True) == root.digest("t/a/x")


def test_a_download_that_breaks_off_goes_on(cloud: str, proxy: Proxy, tmp_path, configure):
    write(open_root(cloud), "t/a/x", BIG[: 4 << 20])
    configure(AERIALDOJO_CACHE=tmp_path / "another")
    proxy.fail("^GET .*t/a/x", "cut", 2)
    assert open_root(cloud).local_copy("t/a/x").read_bytes() == BIG[: 4 << 20]
    assert proxy.left() == 0


def test_a_connection_that_falls_silent_is_made_anew(cloud: str, proxy: Proxy, tmp_path, configure):
    configure(AERIALDOJO_TIMEOUT_S=0.5)
    root = open_root(cloud)
    proxy.fail("^PUT", 30.0)
    write(root, "t/a/x", BIG[: 1 << 20])
    assert sum(line.startswith("PUT") for line in proxy.seen) == 2
    configure(AERIALDOJO_CACHE=tmp_path / "another")
    proxy.fail("^GET .*t/a/x", 30.0)
    proxy.fail("^GET .*t/a/x", "stall", 2)
    assert open_root(cloud).local_copy("t/a/x").read_bytes() == BIG[: 1 << 20]
    assert sum(line.startswith("GET") and "t/a/x" in line for line in proxy.seen) == 4


def test_a_store_that_takes_connections_and_never_answers_ends_a_command(cloud: str, configure):
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        configure(AERIALDOJO_TIMEOUT_S=0.5, AWS_MAX_ATTEMPTS=2, AWS_ENDPOINT_URL=url)
        done = called("stats", "--data", cloud)
    assert done.returncode == 1
    assert done.stderr.startswith("error: s3://")
    assert f"{url} cannot be reached, does not answer" in done.stderr


def test_a_download_is_tried_as_often_as_the_client_tries(cloud: str, proxy: Proxy, tmp_path, configure):
    write(open_root(cloud), "t/a/x", b"some bytes")
    configure(AERIALDOJO_TIMEOUT_S=0.3, AWS_MAX_ATTEMPTS=2, AERIALDOJO_CACHE=tmp_path / "another")
    proxy.fail("^GET .*t/a/x", 30.0, 100)
    with pytest.raises(StoreError, match="does not answer"):
        open_root(cloud).local_copy("t/a/x")
    assert proxy.left() == 98


def test_what_cannot_be_put_leaves_the_old_one(cloud: str, proxy: Proxy, configure):
    configure(AWS_MAX_ATTEMPTS=2)
    root = open_root(cloud)
    write(root, "t/a/x", b"old")
    fill(root, "media/S/n", {"a": b"old", "b": b"old"})
    proxy.fail("^PUT .*partNumber=2", 503, 100)
    proxy.fail("^PUT .*new-.*/b", 503, 100)
    with pytest.raises(StoreError, match=r"s3://.*/t/a/x: the store keeps answering .*run the command again later"):
        write(root, "t/a/x", BIG)
    with pytest.raises(StoreError, match="nothing half-written"):
        fill(root, "media/S/n", {"a": b"new", "b": b"new"})
    again = open_root(cloud)
    again.refresh()
    assert again.local_copy("t/a/x").read_bytes() == b"old"
    assert read_folder(again, "media/S/n") == {"a": b"old", "b": b"old"}
    assert "".join(proxy.seen).count("DELETE") == 1, "the upload is aborted"


@pytest.mark.parametrize("read", [store.count_rows, store.read_scene])
def test_a_shard_that_cannot_be_fetched_is_not_called_damaged(cloud: str, proxy: Proxy, configure, tmp_path, read):
    row = {"scene": "U_Test_0", "landmark_id": 0, "name": "tower", "mesh_node": "n", "x_m": 1, "y_m": 2, "z_m": 3}
    store.write_shard(cloud, "landmarks", "U_Test_0", 0, from_rows(schemas.LANDMARKS, [row]))
    configure(AWS_MAX_ATTEMPTS=1, AERIALDOJO_CACHE=tmp_path / "another")
    store._read_info.cache_clear()
    if read == store.read_scene:
        store.count_rows(cloud, "landmarks", "U_Test_0")
    proxy.fail("^GET .*landmarks.*parquet", "drop", 100)
    with pytest.raises(StoreError, match="cannot be reached, does not answer or drops the connection") as raised:
        read(cloud, "landmarks", "U_Test_0")
    assert "delete" not in str(raised.value)


KILLED = """
import os, sys
from aerialdojo_gen.store.root import open_root
root = open_root(sys.argv[1])
with root.lock():
    print("held", flush=True)
    with root.commit("t/a/x") as path:
        path.write_bytes(os.urandom(17 << 20))
"""


def test_what_a_killed_run_left_is_removed_under_the_next_lock(cloud: str, proxy: Proxy, server: str, configure):
    """A real SIGKILL in the middle of an upload in parts, by a run that holds the lock."""
    configure(AERIALDOJO_LEASE_S=2)
    write(open_root(cloud), "t/a/x", b"old")
    proxy.fail("^PUT .*partNumber=3", 60.0, 9)
    run = subprocess.Popen([sys.executable, "-c", KILLED, cloud], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    assert run.stdout.readline() == "held\n"
    with pytest.raises(StoreError, match=r"another run is writing to .* \(process \d+\) holds it until .* UTC"):
        open_root(cloud).lock().__enter__()
    while not any("partNumber=3" in line for line in proxy.seen):
        assert run.poll() is None
    run.kill()
    run.wait()
    configure(AWS_ENDPOINT_URL=server)
    bucket = Bucket(cloud.split("/")[2])
    uploads = bucket._client.list_multipart_uploads(Bucket=bucket.name)
    assert len(uploads.get("Uploads", [])) == 1
    root = open_root(cloud)
    with root.lock():
        assert not bucket._client.list_multipart_uploads(Bucket=bucket.name).get("Uploads")
        assert root.local_copy("t/a/x").read_bytes() == b"old"


def test_who_lost_the_lock_writes_nothing_more(cloud: str):
    """A holder whose lock somebody took: it stops, and so does a worker of it."""
    import pickle  # noqa: TID251 - as executors do

    root = open_root(cloud)
    bucket = Bucket(cloud.split("/")[2])
    with pytest.raises(StoreError, match="lost the lock"), root.lock():  # noqa: PT012 - it shows at the end too
        write(root, "t/a/x", b"mine")
        worker = pickle.loads(pickle.dumps(root))
        taken = b'{"token": "another", "holder": "another", "lease_s": 60}'
        bucket.put_bytes("data/.aerialdojo-lock.json", taken)
        code = (
            "import pickle, sys; import support.s3_server as s; s.write(pickle.load(sys.stdin.buffer), 't/a/x', b'y')"
        )
        done = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(worker), capture_output=True,
                              cwd=os.path.dirname(os.path.dirname(__file__)), check=False)  # fmt: skip
        assert b"this run has lost the lock of" in done.stderr
        (lease,) = root._state.leases.values()
        lease._find_whose_it_is()
        write(root, "t/a/x", b"too late")
    assert open_root(cloud).local_copy("t/a/x").read_bytes() == b"mine"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"AWS_ACCESS_KEY_ID": "", "AWS_SECRET_ACCESS_KEY": ""}, "there are no credentials: set AWS_ACCESS_KEY_ID"),
        ({"AWS_ENDPOINT_URL": "http://127.0.0.1:9", "AWS_MAX_ATTEMPTS": "1"}, "http://127.0.0.1:9 cannot be reached"),
        ({"AWS_ENDPOINT_URL": "nonsense"}, "correct the AWS configuration"),
        ({"AWS_PROFILE": "nobody"}, "there is no AWS profile"),
        ({"AERIALDOJO_TIMEOUT_S": "soon"}, "AERIALDOJO_TIMEOUT_S='soon': write a number of seconds"),
        ({"AERIALDOJO_CACHE_GB": "much"}, "AERIALDOJO_CACHE_GB='much': write a number"),
    ],
)
def test_what_the_environment_lacks_is_one_line(cloud: str, monkeypatch, tmp_path, change, told):
    for name, value in change.items():
        monkeypatch.setenv(name, value) if value else monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path))
    forget_clients()
    with pytest.raises(Exception, match=told) as raised:
        open_root(cloud).exists("t/a/x")
    assert "\n" not in str(raised.value)
    assert raised.type.__module__ == "aerialdojo_gen.base.errors"


def test_a_bucket_that_is_not_there_is_named(cloud: str):
    with pytest.raises(StoreError, match=r"s3://no-such-bucket/.*there is no bucket 'no-such-bucket' at http://127"):
        open_root("s3://no-such-bucket/data").exists("t/a/x")


def test_the_cache_is_bounded(cloud: str, configure, tmp_path):
    configure(AERIALDOJO_CACHE_GB=0.001)
    root = open_root(cloud)
    for k in range(8):
        write(root, f"t/a/{k}", os.urandom(300_000))
    assert sum(p.stat().st_size for p in (tmp_path / "cache").rglob("*") if p.is_file()) <= 1_000_000
    for k in range(8):
        assert root.local_copy(f"t/a/{k}").stat().st_size == 300_000


def test_an_upload_by_others_is_a_folder_too(cloud: str):
    bucket = Bucket(cloud.split("/")[2])
    for name in ("a", "b"):
        bucket.put_bytes(f"data/media/S/n/{name}", b"1")
    assert read_folder(open_root(cloud), "media/S/n") == {"a": b"1", "b": b"1"}


def test_a_folder_that_is_being_written_is_not_there(cloud: str, proxy: Proxy, configure):
    configure(AWS_MAX_ATTEMPTS=1)
    root = open_root(cloud)
    proxy.fail("^PUT .*n/b", 503, 9)
    with pytest.raises(StoreError):
        fill(root, "media/S/n", {"a": b"1", "b": b"1"})
    for one in (root, open_root(cloud)):
        one.refresh()
        assert not one.exists("media/S/n")
        assert not one.exists("media/S/n/a")
    fill(root, "media/S/n", {"a": b"2"})
    assert read_folder(root, "media/S/n") == {"a": b"2"}
