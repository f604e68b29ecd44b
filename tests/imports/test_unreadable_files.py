"""What is no file, and readers that die: one line that says what it is, at once."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support import foreign, maps
from support.command_line import said

OBJ = "v 0 0 0\nv 30 0 0\nv 30 20 0\nv 0 20 0\nv 9 9 8\nf 1 2 3\nf 3 4 1\nf 1 2 5\nf 2 3 5\n"


def fifo(path: Path) -> None:
    os.mkfifo(path)


def device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def listener(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(os.path.relpath(path))  # the system takes 107 bytes


def folder(path: Path) -> None:
    path.mkdir()


def empty(path: Path) -> None:
    path.write_bytes(b"")


def command(verb: str, path: Path, tmp_path: Path) -> list[object]:
    mesh = tmp_path / "good.obj"
    mesh.write_text(OBJ)
    scene = ["add-scene", "Mine", mesh, "--up", "z", "--project", tmp_path / "mine"]
    return {
        "mesh": ["add-scene", "Mine", path, "--up", "z", "--project", tmp_path / "mine"],
        "list": ["add-scene", "Mine", path, "--list"],
        "names": [*scene, "--names", path],
        "annotations": [*scene, "--annotations", path],
        "map": ["add-map", "Mine", path, f"--bbox={','.join(map(str, maps.box()))}", "--project", tmp_path / "mine"],
        "dem": ["add-terrain", "Mine", path, "--project", tmp_path / "mine"],
        "import": ["import-benchmark", path, "--format", "cityavos", "--frame", "enu", "--data", tmp_path / "data"],
        "pipeline": ["split", "--pipeline", path, "--data", tmp_path / "data"],
    }[verb]


USES = [
    ("mesh", "a.glb"), ("mesh", "a.obj"), ("list", "a.fbx"), ("names", "a.csv"), ("annotations", "a.json"),
    ("map", "a.osm.pbf"), ("dem", "a.tif"), ("dem", "a.asc"), ("dem", "a.npz"), ("import", "a.json"),
    ("pipeline", "a.toml"),
]  # fmt: skip


@pytest.fixture
def guard():
    """End a test that hangs."""

    def hangs(*_):
        raise AssertionError("hangs")

    before = signal.signal(signal.SIGALRM, hangs)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("guard")
@pytest.mark.parametrize(
    ("verb", "name", "make"),
    # An empty pipeline file is one of defaults.
    [
        (*use, make)
        for use in USES
        for make in (fifo, device, listener, folder, empty)
        if (use[0], make) != ("pipeline", empty)
    ],
)
def test_what_is_no_file_is_one_line_at_once(tmp_path, capsys, monkeypatch, verb, name, make):
    monkeypatch.chdir(tmp_path)
    make(tmp_path / name)
    code, out, err = said(capsys, *command(verb, tmp_path / name, tmp_path))
    assert code in (1, 2), out
    assert err.count("\n") == 1, err
    assert str(tmp_path / name) in err
    kind = {fifo: "is a FIFO", device: "is a device", listener: "is a socket", folder: "is a folder"}.get(make, "")
    assert verb in ("import", "pipeline") or kind in err
    assert not (tmp_path / "mine").exists()


@pytest.mark.parametrize("count", [-1, -(2**40)])
def test_a_negative_count_is_a_damaged_file(tmp_path, capsys, count):
    document = json.loads(foreign.village().export(file_type="gltf")["model.gltf"])
    document["accessors"][0]["count"] = count
    (tmp_path / "a.glb").write_bytes(foreign.glb(json.dumps(document).encode()))
    code, _, err = said(capsys, "add-scene", "Mine", tmp_path / "a.glb", "--list")
    assert code == 1
    assert err.endswith(f"is a damaged GLB file: an array of {count:,} numbers\n")


@pytest.mark.kill
@pytest.mark.parametrize(
    ("verb", "number", "words"),
    [
        ("map", signal.SIGKILL, "its reader was killed (signal 9), by the system if memory ran out"),
        ("mesh", signal.SIGKILL, "its reader was killed (signal 9), by the system if memory ran out"),
        ("mesh", signal.SIGSEGV, "its reader crashed (signal 11, Segmentation fault): the file may be damaged"),
        ("mesh", signal.SIGXCPU, "reading takes more than 300 s"),
    ],
)
def test_a_reader_that_is_killed_says_by_what(tmp_path, verb, number, words):
    path = tmp_path / "a.obj" if verb == "mesh" else maps.write_town(tmp_path / "a.osm.pbf")
    if verb == "mesh":
        path.write_text(OBJ)
    module = {"mesh": "aerialdojo_gen.imports.files", "map": "aerialdojo_gen.imports.osm"}[verb]
    arguments = map(str, command(verb, path, tmp_path))
    running = subprocess.Popen([sys.executable, "-m", "aerialdojo_gen.cli", *arguments], stderr=subprocess.PIPE)
    os.kill(_child(running, module), number)
    err = running.communicate(timeout=120)[1].decode()
    assert running.returncode == 1
    assert re.fullmatch(rf"error: {re.escape(str(path))}: {re.escape(words)}[^\n]*\n", err)
    assert not (tmp_path / "mine").exists()


def _child(parent: subprocess.Popen, module: str) -> int:
    """Wait for a child that runs a module; its id."""
    while parent.poll() is None:
        for pid in Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split():
            if module in Path(f"/proc/{pid}/cmdline").read_text().split("\0"):
                return int(pid)
        time.sleep(0.005)
    raise AssertionError(parent.stderr.read())


def test_a_height_model_and_a_map_that_are_there_are_read(tmp_path, capsys):
    """So that the refusals above are of what is no file."""
    np.savez(tmp_path / "a.npz", heights_m=maps.heights(4.0, 60.0), cell_m=4.0)
    code, out, err = said(capsys, *command("dem", tmp_path / "a.npz", tmp_path))
    assert code == 0, err
    assert out.startswith("Mine: ")
