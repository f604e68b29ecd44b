"""Kills, resumes, workers and damage: the tables end with the same bytes."""

import os
import random  # noqa: TID251 - which kills, not what is generated
import shutil
import signal
import struct
import subprocess
import sys

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

PLAN = ("plan", "--pipeline", "pipelines/smoke.toml")
TABLES = ("meshes", "scenes", "landmarks", "objects", "chosen_anchors", "anchors", "viewpoints", "pairs", "plans")


@pytest.fixture(scope="module")
def bench(smoke, tmp_path_factory):
    """Its server has imported everything and becomes a command in a child: imports are not what is tried here."""
    folder = tmp_path_factory.mktemp("torture")
    bench = torture.Bench(folder, smoke)
    assert bench.server.run(["--version"], {}, folder / "said", -1.0) == 0
    yield bench
    bench.close()


@pytest.fixture
def run(bench, tmp_path):
    """Run a command in one process; gives its exit status and what it said."""

    def run(data, **env):
        code = bench.server.run([*PLAN, "--data", data, "--workers", 1], env, tmp_path / "said", -1.0)
        return code, (tmp_path / "said").read_text()

    return run


@pytest.fixture
def copy(smoke, tmp_path):
    """A copy of the smoke data that a test may damage."""
    return shutil.copytree(smoke, tmp_path / "copy")


def snapshot(data):
    files = (p for table in TABLES for p in (data / table).rglob("*") if p.is_file())
    return {str(p.relative_to(data)): p.read_bytes() for p in files}


def shards_of(data):
    return [path for table in TABLES for path in data.glob(f"{table}/*/part-*.parquet")]


def test_what_was_killed_and_interrupted_goes_on_to_the_same_bytes(project, run, smoke, copy):
    """One process begins, two go on, one ends: the bytes are those of a run by as many as there are cores."""
    # Anchors stay: computed again, what they were made from has the same bytes.
    for table in set(TABLES) - {"anchors", "viewpoints"}:
        shutil.rmtree(copy / table)
    kept = {path: path.stat().st_mtime_ns for path in shards_of(copy)}
    # At the pairs of the first scene. What a kill at any one call leaves, test_atomic and the torture try.
    assert run(copy, PRELOAD_ONLY="rename", PRELOAD_KILL_AT="6")[0] == -signal.SIGKILL
    before = shards_of(copy)
    assert len(before) > len(kept)
    for path in before:
        assert read_info(path.parent, path.name) is not None, "a reader saw half a shard"

    # A session of its own, so that what it leaves behind can be found, and Ctrl-C can be sent to all of it.
    command = [sys.executable, "-m", "aerialdojo_gen.cli", *PLAN, "--data", copy, "--workers", "2"]
    process = subprocess.Popen(command, cwd=project, stderr=subprocess.PIPE, text=True, start_new_session=True)
    chores.until(lambda: process.poll() is not None or len(shards_of(copy)) > len(before))
    # The second scene has not been built yet: it is interrupted in the middle of much that is left.
    os.killpg(process.pid, signal.SIGSTOP)
    code, err = run(copy)
    assert code == 1
    assert err.startswith(f"error: another run is writing to {copy}: wait for it, or use another --data\n")
    os.killpg(process.pid, signal.SIGINT)
    os.killpg(process.pid, signal.SIGCONT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.strip().splitlines()[-1].startswith("interrupted: finished shards are kept")
    assert "Traceback" not in err
    chores.until_empty(process.pid)
    finished = snapshot(copy)
    assert len(shards_of(copy)) > len(before)
    assert finished.items() < snapshot(smoke).items()
    assert not list(copy.rglob(f"{AREA}*")), "what killed runs left half-made is swept"

    code, err = run(copy)
    assert code == 0, err
    assert snapshot(copy) == snapshot(smoke)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept

    before = {path: path.stat().st_mtime_ns for path in copy.rglob("*.*")}
    code, err = run(copy)
    assert (code, err.count("; nothing to do; ")) == (0, 1), "what was asked for, not what it builds on"
    assert {path: path.stat().st_mtime_ns for path in before} == before, "nothing changed, nothing is written"


def test_a_little_of_the_torture(bench, monkeypatch):
    """A command is killed at one of its calls and repeated, and every byte compared: a file left over is noticed."""
    assert bench.case("export", random.Random("export"), aimed=True) == "killed"
    kind = torture.KINDS["export"]

    def litter(data, rng):
        kind.prepare(data, rng)
        (data / "exports").mkdir(exist_ok=True)
        (data / "exports" / f"{rng.random()}").write_text("half")

    monkeypatch.setitem(torture.KINDS, "export", torture.Kind(kind.arguments, litter))
    with pytest.raises(AssertionError, match=r"export, killed .*: exports/0\."):
        bench.case("export", random.Random(0), aimed=True)


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


def test_whatever_is_damaged_is_named_and_made_again(run, smoke, copy):
    """One thing of a quick stage and scene; what else may be wrong with a shard, tests/store tells."""
    cut, flipped, rewritten = shard(copy, "pairs", 0), shard(copy, "pairs", 1), shard(copy, "objects", 0)
    os.truncate(cut, 100)
    raw = bytearray(flipped.read_bytes())
    raw[raw.index(b'{"checksum"') + 20] ^= 1
    flipped.write_bytes(raw)
    table = pq.read_table(rewritten, partitioning=None)
    pq.write_table(table.slice(0, 3).replace_schema_metadata(None), rewritten)
    mesh, other = sorted(copy.glob("meshes/*.glb"))
    move_a_vertex(mesh)
    os.truncate(other, 1000)
    with pytest.raises(AssetError, match="is not the mesh that the tables were made from"):
        read_glb(mesh, store.read_scene(copy, "scenes", mesh.stem)["mesh_sha256"][0].as_py())
    code, err = run(copy)
    assert code == 0, err
    assert f"{cut} is damaged" in err
    assert f"{flipped} is damaged (its footer" in err
    assert f"{rewritten} is damaged (not written by aerialdojo-gen): computed again" in err
    for path in mesh, other:
        assert f"{path} is missing or damaged: computed again" in err
    assert snapshot(copy) == snapshot(smoke)
