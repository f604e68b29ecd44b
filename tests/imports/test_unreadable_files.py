"""What is no file, and readers that die: one line that says what it is, at once."""

import os
import re
import signal
import socket
import struct
import threading
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support import foreign, maps
from support.command_line import said
from support.hills import hills, write_hills

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.imports.files import read_into, read_mesh

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


def kill_child(module: str, number: int) -> None:
    """Wait for a child of this process that runs a module, and send it a signal."""
    until = time.monotonic() + 60
    while time.monotonic() < until:
        for listed in Path("/proc/self/task").glob("*/children"):
            for pid in listed.read_text().split():
                if module in Path(f"/proc/{pid}/cmdline").read_text().split("\0"):
                    os.kill(int(pid), number)
                    return
        time.sleep(0.005)


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
def test_a_reader_that_is_killed_says_by_what(tmp_path, capsys, verb, number, words):
    path = tmp_path / "a.obj" if verb == "mesh" else maps.write_town(tmp_path / "a.osm.pbf")
    if verb == "mesh":
        path.write_text(OBJ)
    module = {"mesh": "aerialdojo_gen.imports.files", "map": "aerialdojo_gen.imports.osm"}[verb]
    killer = threading.Thread(target=kill_child, args=(module, number))
    killer.start()
    code, _, err = said(capsys, *command(verb, path, tmp_path))
    killer.join()
    assert code == 1
    assert re.fullmatch(rf"error: {re.escape(str(path))}: {re.escape(words)}[^\n]*\n", err)
    assert not (tmp_path / "mine").exists()


def test_a_height_model_that_is_there_is_read(tmp_path, capsys):
    """So that the refusals above are of what is no file."""
    np.savez(tmp_path / "a.npz", heights_m=maps.heights(4.0, 12.0), cell_m=4.0)
    code, out, err = said(capsys, *command("dem", tmp_path / "a.npz", tmp_path))
    assert code == 0, err
    assert out.startswith("Mine: ")


def locked_zip(path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("m.obj", "v 0 0 0\n")
    data = bytearray(path.read_bytes())
    struct.pack_into("<H", data, 6, 1)
    path.write_bytes(data)


BAD = [
    ("a.glb", b"", r"is empty \(0 bytes\)"),
    ("a.obj", b"\0" * 5000, "begins with zeros alone"),
    ("a.glb", b"\x1f\x8b\x08" + b"x" * 40, "compressed by gzip: unpack it first"),
    ("a.obj", b"PK\x03\x04\x14\0\0\0" + b"x" * 40, "is a ZIP archive: unpack it"),
    ("a.obj", None, "is an encrypted ZIP archive: unpack it with its password"),
    ("a.ply", b"glTF\x02\0\0\0" + b"x" * 40, r"is a GLB file by its content: rename it to a\.glb"),
    ("a.glb", b"ply\nformat ascii 1.0\nend_header\n", r"is a PLY file by its content: rename it to a\.ply"),
    ("a.glb", b"<!DOCTYPE html><html>sign in</html>", "is a web page"),
    ("a.glb", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n", "Git LFS pointer.*git lfs pull"),
    ("a.stl", b"BLENDER-v300" + b"\0" * 40, "is a Blender file: export it as GLB"),
    ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n", "points and no faces"),
    ("a.glb", foreign.glb(b'{"asset":{"version":"2.0"},"extensionsRequired":["KHR_draco_mesh_compression"]}'),
     r"is compressed \(KHR_draco_mesh_compression\): export it without compression"),
    ("a.obj", b"v nan nan nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "empty or degenerate|no triangle"),
    ("a.dwg", b"AC1032", "meshes are read from"),
    ("a.glb", b"glTF", "not a GLB file"),
    ("a.3ds", b"MM\xff\xff\xff\xff", "damaged 3DS"),
    ("a.3ds", b"hello, this is text", "damaged 3DS"),
    ("a.obj", b"# nothing\n", "a.obj"),
    ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n", "a.ply"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content", "message"), BAD)
def test_bad_files_are_one_line_with_the_mend_and_leave_nothing(tmp_path, capsys, name, content, message):
    path = tmp_path / name
    if content is None:
        locked_zip(path)
    else:
        path.write_bytes(content)
    code, _, err = said(capsys, "add-scene", "Odd", path, "--up", "z", "--project", tmp_path / "mine")
    assert code == 1
    assert re.fullmatch(rf"error: {re.escape(str(path))}:? [^\n]*\n", err)
    assert re.search(message, err)
    assert sorted(p.name for p in tmp_path.iterdir()) == [name]


def test_a_file_of_ten_gigabytes_is_not_opened(tmp_path):
    path = tmp_path / "huge.obj"
    with path.open("wb") as file:
        file.truncate(10 << 30)
    with pytest.raises(AssetError, match=r"huge\.obj: 10240 MiB, the maximum is 1024: simplify or split the mesh"):
        read_mesh(path)


def test_a_cut_glb_is_named(tmp_path):
    whole = write_hills(hills(1, cells=10), [], tmp_path / "hills.glb").read_bytes()
    for end in (10, 30, len(whole) // 2, len(whole) - 40):
        (tmp_path / "cut.glb").write_bytes(whole[:end])
        assert read_into(tmp_path / "cut.glb", tmp_path / "nodes.npz")
