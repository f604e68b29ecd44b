"""Kills, resumes, workers and damage: the tables end with the same bytes."""

import os
import shutil
import signal
import struct
import subprocess
import sys
import time

import pyarrow.parquet as pq
import pytest
import torture
from support import chores

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.shards import read_info
from aerialdojo_gen.store.staging import AREA

pytestmark = pytest.mark.kill

TABLES = ("meshes", "scenes", "landmarks", "objects", "chosen_anchors", "anchors", "viewpoints", "pairs", "plans")


def start(project, data):
    # A session of its own, so that what it leaves behind can be found, and Ctrl-C can be sent to all of it.
    command = [sys.executable, "-m", "aerialdojo_gen.cli", "plan", "--pipeline", "pipelines/smoke.toml"]
    return subprocess.Popen(
        [*command, "--data", str(data), "--workers", "2"],
        cwd=project, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def server():
    """A process that has imported everything and becomes a command in a child: imports are not what is tried here."""
    one = torture.Server()
    yield one
    one.close()


def run(server, data, pipeline="pipelines/smoke.toml"):
    """Run a command to its end in one process; gives its exit status and what it said."""
    said = data.parent / "said"
    code = server.run(["plan", "--pipeline", str(pipeline), "--data", str(data), "--workers", "1"], {}, said, -1.0)
    return code, said.read_text()


def snapshot(data):
    files = (p for table in TABLES for p in (data / table).rglob("*") if p.is_file())
    return {str(p.relative_to(data)): p.read_bytes() for p in files}


def wait_for_shards(data, n, process):
    # Of the tables that are compared, no others: what is waited for is what the tests count.
    while process.poll() is None and sum(len(list(data.glob(f"{table}/*/part-*.parquet"))) for table in TABLES) < n:
        time.sleep(0.01)


def test_killed_again_and_again_ends_with_the_same_bytes(project, server, smoke, tmp_path):
    """Two processes begin and one ends: the bytes are those of a run by as many as there are cores."""
    data = tmp_path / "data"
    kills = 0
    # In build-scenes, and wherever the two scenes are after so many shards, each at its own stage. What a kill at any
    # one call leaves, test_atomic and the torture try.
    for shards in (1, 6, 11):
        process = start(project, data)
        wait_for_shards(data, shards, process)
        # Somewhere after the shard's commit, most often within the next one's work or write.
        time.sleep(0.02 * shards)
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            kills += 1
        process.communicate()
        chores.until_empty(process.pid)
        for path in data.rglob("part-*.parquet"):
            assert read_info(path.parent, path.name) is not None, "a reader saw half a shard"
    assert kills >= 2
    code, err = run(server, data)
    assert code == 0, err
    assert snapshot(data) == snapshot(smoke)
    assert not list(data.rglob(f"{AREA}*")), "what killed runs left half-made is swept"


def test_ctrl_c_keeps_what_was_finished_and_ends_the_workers(project, server, smoke, tmp_path):
    data = tmp_path / "data"
    process = start(project, data)
    wait_for_shards(data, 1, process)
    code, err = run(server, data)
    assert code == 1
    assert err.startswith(f"error: another run is writing to {data}: wait for it, or use another --data\n")
    wait_for_shards(data, 8, process)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.strip().splitlines()[-1].startswith("interrupted: finished shards are kept")
    assert "Traceback" not in err
    chores.until_empty(process.pid)
    finished = snapshot(data)
    assert len([name for name in finished if name.endswith(".parquet")]) >= 8
    assert finished.items() <= snapshot(smoke).items()
    assert not list(data.rglob(f"{AREA}*"))


@pytest.fixture
def copy(smoke, tmp_path):
    """A copy of the smoke data that a test may damage."""
    return shutil.copytree(smoke, tmp_path / "copy")


def mtimes(data):
    return {p: p.stat().st_mtime_ns for p in data.rglob("*") if p.is_file() and p.name != ".lock"}


def test_nothing_changed_nothing_is_written(server, copy):
    before = mtimes(copy)
    code, err = run(server, copy)
    assert code == 0
    assert mtimes(copy) == before
    assert err.count("; nothing to do; ") == 1, "what was asked for, not what it builds on"


def shard(data, table, number):
    return sorted(data.glob(f"{table}/*/part-00000.parquet"))[number]


def move_a_vertex(mesh):
    """The first coordinates of the binary chunk: a vertex goes 1.5 m to the east; size and time stay."""
    before = mesh.stat()
    raw = bytearray(mesh.read_bytes())
    at = 28 + struct.unpack_from("<I", raw, 12)[0]
    struct.pack_into("<f", raw, at, struct.unpack_from("<f", raw, at)[0] + 1.5)
    mesh.write_bytes(raw)
    os.utime(mesh, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert mesh.stat().st_size == before.st_size


def test_whatever_is_damaged_is_named_and_made_again(server, smoke, copy):
    cut = {shard(copy, "plans", 0): 0, shard(copy, "pairs", 0): 100, shard(copy, "landmarks", 1): -9}
    for path, keep in cut.items():
        path.write_bytes(path.read_bytes()[:keep])
    footers = {
        shard(copy, "pairs", 1): b"null", shard(copy, "plans", 1): b"[]", shard(copy, "objects", 0): b"x",
        shard(copy, "viewpoints", 1): None,
    }  # fmt: skip
    for path, text in footers.items():
        raw = path.read_bytes()
        at = raw.index(b'{"checksum"')
        if text is None:
            path.write_bytes(raw[: at + 20] + bytes([raw[at + 20] ^ 1]) + raw[at + 21 :])
        else:
            end = raw.index(b"}}", at) + 2
            path.write_bytes(raw[:at] + text.ljust(end - at) + raw[end:])
    rewritten = shard(copy, "anchors", 0)
    table = pq.read_table(rewritten, partitioning=None)
    pq.write_table(table.slice(0, 3).replace_schema_metadata(None), rewritten)
    mesh, other = sorted(copy.glob("meshes/*.glb"))
    move_a_vertex(mesh)
    other.write_bytes(other.read_bytes()[:1000])
    with pytest.raises(AssetError, match="is not the mesh that the tables were made from"):
        read_glb(mesh, store.read_scene(copy, "scenes", mesh.stem)["mesh_sha256"][0].as_py())
    code, err = run(server, copy)
    assert code == 0, err
    for path in cut:
        assert f"{path} is damaged" in err
    for path in footers:
        assert f"{path} is damaged (its footer" in err
    assert f"{rewritten} is damaged (not written by aerialdojo-gen): computed again" in err
    for path in mesh, other:
        assert f"{path} is missing or damaged: computed again" in err
    assert snapshot(copy) == snapshot(smoke)


def test_a_changed_config_makes_its_stage_stale_and_only_what_follows(project, server, copy, tmp_path):
    before = mtimes(copy)
    text = (project / "pipelines" / "smoke.toml").read_text()
    text = text.replace('"../', f'"{project}/') + "\n[pair-objects]\nstart_variants = 1\n"
    mine = tmp_path / "mine.toml"
    mine.write_text(text)
    code, err = run(server, copy, mine)
    assert code == 0, err
    changed = {p.relative_to(copy).parts[0] for p, t in mtimes(copy).items() if before.get(p) != t}
    assert changed == {"pairs", "plans"}


def test_a_read_only_directory_is_one_line(server, copy):
    if os.geteuid() == 0:
        # Root writes through permission bits: a folder in the shard's place stops it all the same.
        path = sorted(copy.glob("pairs/*/part-00000.parquet"))[0]
        path.unlink()
        path.mkdir()
    else:
        folder = sorted(copy.glob("pairs/*"))[0]
        sorted(folder.iterdir())[0].unlink()
        folder.chmod(0o555)
    code, err = run(server, copy)
    assert code == 1
    lines = [line for line in err.splitlines() if line.startswith("error:")]
    assert len(lines) == 1
    assert "Traceback" not in err


def test_what_versions_before_left_is_removed_once_and_an_old_recording_comes_back(server, smoke, copy):
    (copy / ".lock").write_text("")
    recording = min((copy / "media" / "U_Courtyard_0").iterdir())
    recording.rename(recording.with_name(f".{recording.name}.4242.old"))
    for left in (
        "meshes/.U_Courtyard_0.glb.4242.tmp.glb", "release/.README.md.4242.tmp.md",
        "plans/U_Courtyard_0/.part-00000.parquet.4242.tmp.parquet", "media/U_Gone_0/.nav.4242.tmp/front_rgb.mp4",
        "release/tasks/id_test/.part-U_Courtyard_0.parquet.4242.tmp.parquet",
    ):  # fmt: skip
        (copy / left).parent.mkdir(parents=True, exist_ok=True)
        (copy / left).write_bytes(b"half")
    code, err = run(server, copy)
    assert code == 0, err
    assert recording.is_dir()
    assert not [p for p in copy.rglob(".*") if p.name != ".lock"]
    (copy / "meshes" / ".mine.1.tmp").write_text("not looked for again")
    code, err = run(server, copy)
    assert (copy / "meshes" / ".mine.1.tmp").is_file()
