"""What is no file, and readers that die: one line that says what it is, at once."""

import os
import re
import signal
import socket
import threading
import time
from pathlib import Path

import pytest
import trimesh
from support import foreign, maps
from support.command_line import said
from support.hills import hills

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.imports.files import read_into, read_mesh

OBJ = "v 0 0 0\nv 30 0 0\nv 30 20 0\nv 0 20 0\nv 9 9 8\nf 1 2 3\nf 3 4 1\nf 1 2 5\nf 2 3 5\n"


def listener(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(os.path.relpath(path))  # the system takes 107 bytes


MAKE = {
    "is a FIFO": os.mkfifo, "is a device": lambda path: path.symlink_to("/dev/zero"), "is a socket": listener,
    "is a folder": Path.mkdir, "": Path.touch,
}  # fmt: skip


def command(verb: str, path: Path, tmp_path: Path) -> list[object]:
    good, project, data = tmp_path / "good.obj", ["--project", tmp_path / "mine"], ["--data", tmp_path / "data"]
    good.write_text(OBJ)
    return {
        "mesh": ["add-scene", "Mine", path, "--up", "z", *project],
        "list": ["add-scene", "Mine", path, "--list"],
        "names": ["add-scene", "Mine", good, "--up", "z", *project, "--names", path],
        "annotations": ["add-scene", "Mine", good, "--up", "z", *project, "--annotations", path],
        "map": ["add-map", "Mine", path, f"--bbox={','.join(map(str, maps.box()))}", *project],
        "dem": ["add-terrain", "Mine", path, *project],
        "import": ["import-benchmark", path, "--format", "cityavos", "--frame", "enu", *data],
        "pipeline": ["split", "--pipeline", path, *data],
    }[verb]


USES = [
    ("mesh", "a.glb"), ("list", "a.fbx"), ("names", "a.csv"), ("annotations", "a.json"), ("map", "a.osm.pbf"),
    ("dem", "a.tif"), ("dem", "a.asc"), ("dem", "a.npz"), ("import", "a.json"), ("pipeline", "a.toml"),
]  # fmt: skip


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    ("verb", "name", "kind"),
    # An empty pipeline file is one of defaults.
    [*((*USES[0], kind) for kind in MAKE), *((*use, "is a FIFO") for use in USES[1:]),
     *((*use, "") for use in USES[1:-1])],
)  # fmt: skip
def test_what_is_no_file_is_one_line_at_once(tmp_path, capsys, monkeypatch, verb, name, kind):
    monkeypatch.chdir(tmp_path)
    MAKE[kind](tmp_path / name)
    code, out, err = said(capsys, *command(verb, tmp_path / name, tmp_path))
    assert code in (1, 2), out
    assert err.count("\n") == 1, err
    assert str(tmp_path / name) in err
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
    path, module = tmp_path / "good.obj", "aerialdojo_gen.imports.files"
    if verb == "map":
        path, module = maps.write_town(tmp_path / "a.osm.pbf"), "aerialdojo_gen.imports.osm"
    killer = threading.Thread(target=kill_child, args=(module, number))
    killer.start()
    code, _, err = said(capsys, *command(verb, path, tmp_path))
    killer.join()
    assert code == 1
    assert re.fullmatch(rf"error: {re.escape(str(path))}: {re.escape(words)}[^\n]*\n", err)
    assert not (tmp_path / "mine").exists()


ZIP = b"PK\x03\x04\x14\0"
MISTAKEN = [
    ("a.glb", b"", r"is empty \(0 bytes\)"),
    ("a.obj", b"\0" * 5000, "begins with zeros alone"),
    ("a.glb", b"\x1f\x8b\x08" + b"x" * 40, "compressed by gzip: unpack it first"),
    ("a.obj", ZIP + b"\0\0" + b"x" * 40, "is a ZIP archive: unpack it"),
    ("a.obj", ZIP + b"\1\0" + b"x" * 40, "is an encrypted ZIP archive: unpack it with its password"),
    ("a.ply", b"glTF\x02\0\0\0" + b"x" * 40, r"is a GLB file by its content: rename it to a\.glb"),
    ("a.glb", b"ply\nformat ascii 1.0\nend_header\n", r"is a PLY file by its content: rename it to a\.ply"),
    ("a.glb", b"<!DOCTYPE html><html>sign in</html>", "is a web page"),
    ("a.glb", b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n", "Git LFS pointer.*git lfs pull"),
    ("a.stl", b"BLENDER-v300" + b"\0" * 40, "is a Blender file: export it as GLB"),
    ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n", "points and no faces"),
    ("a.dwg", b"AC1032", "meshes are read from"),
]
DRACO = foreign.glb(b'{"asset":{"version":"2.0"},"extensionsRequired":["KHR_draco_mesh_compression"]}')
BLUE = foreign.three_ds([("Box", trimesh.creation.box((4, 3, 3)))], (9, 90, 200))
HILLS = trimesh.Scene(hills(1, cells=10).mesh()).export(file_type="glb")
DAMAGED = [
    ("a.glb", DRACO, r"is compressed \(KHR_draco_mesh_compression\): export it without compression"),
    ("a.glb", b"glTF", "is not a GLB file"),
    ("a.3ds", b"MM\xff\xff\xff\xff", "damaged 3DS"),
    ("a.3ds", b"hello, this is text", "damaged 3DS"),
    *(("a.3ds", BLUE[:end], "3DS") for end in (7, 30, len(BLUE) // 2, len(BLUE) - 3)),
    ("a.obj", b"# nothing\n", "."),
    ("a.dae", b"no mesh " * 20, "Assimp cannot read it"),
    ("a.fbx", b"no mesh " * 20, "Assimp cannot read it"),
    *(("a.glb", HILLS[:end], ".") for end in (10, 30, len(HILLS) // 2, len(HILLS) - 40)),
]


@pytest.mark.parametrize(("name", "content", "message"), MISTAKEN)
def test_files_that_are_something_else_are_told_before_they_are_read(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(AssetError, match=rf"^{re.escape(str(tmp_path / name))}: [^\n]*({message})[^\n]*\Z"):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize(("name", "content", "message"), DAMAGED)
def test_files_that_cannot_be_read_are_one_line(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    assert re.fullmatch(rf"[^\n]*{message}[^\n]*", read_into(tmp_path / name, tmp_path / "nodes.npz"))


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.obj", b"v nan nan nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
     ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 99999999999\nend_header\n")],
)  # fmt: skip
def test_a_mesh_of_nothing_is_one_line_and_leaves_nothing(tmp_path, capsys, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    code, _, err = said(capsys, "add-scene", "Odd", path, "--up", "z", "--project", tmp_path / "mine")
    assert code == 1
    assert re.fullmatch(rf"error: {re.escape(str(path))}: [^\n]+\n", err)
    assert sorted(p.name for p in tmp_path.iterdir()) == [name]


def test_a_file_of_ten_gigabytes_is_not_opened(tmp_path):
    path = tmp_path / "huge.obj"
    path.touch()
    os.truncate(path, 10 << 30)
    with pytest.raises(AssetError, match=r"huge\.obj: 10240 MiB, the maximum is 1024: simplify or split the mesh"):
        read_mesh(path)
