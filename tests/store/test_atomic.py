"""Kills at every step of an atomic write, leases that tell the living from the dead, and recovery."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support.preload import killed_at, preloaded, unshared

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.store import staging
from aerialdojo_gen.store.atomic import atomic_file, atomic_folder
from aerialdojo_gen.store.root import LocalRoot
from aerialdojo_gen.store.staging import AREA, scratch_folder, staged, sweep

PRELUDE = """
import os, signal, sys, time
from pathlib import Path
from aerialdojo_gen.store.atomic import atomic_file, atomic_folder
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.staging import scratch_folder, staged
root = Path(sys.argv[1]) if len(sys.argv) > 1 else None
"""
HOLDING = f"""{PRELUDE}
with atomic_file(root, "f.bin") as path:
    path.write_text("x")
    print(path, flush=True)
    time.sleep(300)
"""
STAGING = f"""{PRELUDE}
for _ in range(100):
    with staged(root, root / "f"):
        pass
"""
WRITING = f"""{PRELUDE}
with atomic_file(root, "deep/er/f.txt") as path:
    path.write_text("new")
"""
REPLACING = f"""{PRELUDE}
with atomic_folder(root / "f") as path:
    (path / "a").write_text("new")
    (path / "b").write_text("new")
"""
LOCKED_AND_KILLED = f"""{PRELUDE}
with open_root(root).lock():
    os.kill(os.getpid(), signal.SIGKILL)
"""
SCRATCH_AND_KILLED = f"""{PRELUDE}
with scratch_folder() as folder:
    (folder / "0.obj").write_text("v")
    os.kill(os.getpid(), signal.SIGKILL)
"""
WRITING_TWICE = f"""{PRELUDE}
for text in ("one", "two"):
    with atomic_folder(root / "media" / "f", root=root) as path:
        (path / "a").write_text(text)
    with atomic_file(root, "media/b") as path:
        path.write_text(text)
"""


def started(code, *arguments, before=(), **options):
    """Start a program."""
    return subprocess.Popen([*before, sys.executable, "-c", code, *map(str, arguments)], **options)


def ended(code, *arguments, **options):
    """Run a program to its end; gives its exit status."""
    return started(code, *arguments, **options).wait()


def names(folder):
    return {p.relative_to(folder).as_posix(): p.read_text() for p in folder.rglob("*") if p.is_file()}


def test_a_killed_writer_s_file_is_swept_while_it_is_still_a_zombie_and_a_living_one_s_is_not(tmp_path):
    process = started(HOLDING, tmp_path, stdout=subprocess.PIPE, text=True)
    assert Path(process.stdout.readline().strip()).is_file()
    sweep(tmp_path)
    assert len(list((tmp_path / AREA).iterdir())) == 1
    process.send_signal(signal.SIGKILL)
    # Not waited for: its number is still taken, and it holds nothing any more.
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
    sweep(tmp_path)
    assert list(tmp_path.iterdir()) == []
    process.wait()


def test_a_number_that_is_taken_again_keeps_no_rubbish(tmp_path):
    # What a killed writer left, whose number this very process has now: no lease is held.
    item = tmp_path / AREA / str(os.getpid())
    item.mkdir(parents=True)
    (item / "lease").write_text("f.bin")
    (item / "new.bin").write_text("half")
    (tmp_path / AREA / "born").mkdir()
    sweep(tmp_path)
    assert list(tmp_path.iterdir()) == []


WRITTEN = {"deep/er/f.txt": "new"}
OLD, NEW = {"f/a": "old", "f/c": "old"}, {"f/a": "new", "f/b": "new"}


@pytest.mark.kill
@pytest.mark.parametrize(
    ("program", "variables", "old", "new"),
    [(REPLACING, {}, OLD, NEW), (REPLACING, {"NO_EXCHANGE": "1"}, OLD, NEW), (WRITING, {}, {}, WRITTEN)],
    ids=["folder", "folder by two renames", "file"],
)
def test_what_is_killed_at_any_step_is_the_old_one_or_the_new_one(tmp_path, program, variables, old, new):
    seen, code, n = [], -signal.SIGKILL, 0
    with killed_at(program, WRITES="1", **variables) as run:
        while code == -signal.SIGKILL:
            n += 1
            root = tmp_path / str(n)
            root.mkdir()
            for name, text in old.items():
                (root / name).parent.mkdir(exist_ok=True)
                (root / name).write_text(text)
            code = run(n, root)
            if old and not variables:
                # A reader that comes at any time finds one of the two.
                assert (root / "f" / "a").is_file()
            sweep(root)
            seen.append(names(root))
            assert seen[-1] in (old, new)
    assert (code, seen[-1]) == (0, new)
    assert n > 8
    assert old in seen


def calls_of(tmp_path, code, *arguments):
    """Run a program; gives its calls that sync, rename and make folders, in their order: kind, path, path before."""
    log = tmp_path / "log"
    assert ended(code, *arguments, env=preloaded(LOG=str(log))) == 0
    return [tuple(line.split("\t")) for line in log.read_text().splitlines()]


def assert_on_the_disk(calls, target, inside=()):
    """Before a name is given all that bears it is synced, and after it the folder of the name."""
    at = next(k for k, (kind, path, _) in enumerate(calls) if kind.startswith("rename") and path == str(target))
    made = calls[at][2]
    synced = {path for kind, path, _ in calls[:at] if kind == "fsync"}
    assert {made, *(f"{made}/{name}" for name in inside)} <= synced
    last = max(k for k, (kind, path, _) in enumerate(calls) if kind.startswith("rename") and path == str(target))
    assert ("fsync", str(target.parent)) in {call[:2] for call in calls[last:]}


def test_a_file_is_on_the_disk_before_it_has_its_name_and_its_folders_after(tmp_path):
    root = tmp_path / "root"
    root.mkdir()
    calls = calls_of(tmp_path, WRITING, root)
    assert_on_the_disk(calls, root / "deep" / "er" / "f.txt")
    for folder in root / "deep", root / "deep" / "er":
        after = calls[calls.index(("mkdir", str(folder), "")) :]
        assert ("fsync", str(folder.parent), "") in after


@pytest.mark.parametrize("how", ["new", "exchange", "many"])
def test_a_folder_is_on_the_disk_before_it_has_its_name_and_its_parent_after(tmp_path, how):
    root = tmp_path / "root"
    (root / "f").mkdir(parents=True)
    if how == "exchange":
        (root / "f" / "a").write_text("old")
    many = "    for number in range(40):\n        (path / str(number)).write_text('new')\n"
    calls = calls_of(tmp_path, REPLACING + many * (how == "many"), root)
    if how == "many":
        at = next(k for k, (kind, path, _) in enumerate(calls) if kind == "rename" and path == str(root / "f"))
        assert ("syncfs", calls[at][2], "") in calls[:at]
    else:
        assert_on_the_disk(calls, root / "f", ["a", "b"])


def test_where_there_are_no_locks_files_are_written_and_nobody_s_are_removed(tmp_path):
    code = HOLDING.replace("time.sleep(300)", "pass")
    left = tmp_path / AREA / "unknown"
    left.mkdir(parents=True)
    (left / "lease").write_text("g.bin")
    assert ended(code, tmp_path, env=preloaded(FLOCK_ERRNO="37"), stdout=subprocess.DEVNULL) == 0
    assert (tmp_path / "f.bin").read_text() == "x"
    assert (left / "lease").is_file()


def test_a_lease_that_names_a_place_elsewhere_moves_nothing_there(tmp_path):
    root = tmp_path / "root"
    item = root / AREA / "item"
    (item / "new").mkdir(parents=True)
    (item / "old").mkdir()
    (item / "lease").write_text("../stolen")
    sweep(root)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["root"]
    assert list(root.iterdir()) == []


def test_writers_of_one_folder_do_not_mix(tmp_path):
    def write(text):
        with atomic_folder(tmp_path / "f") as path:
            (path / "a").write_text(text)
            (path / "b").write_text(text)

    with ThreadPoolExecutor(4) as pool:
        for _ in range(10):
            list(pool.map(write, "0123"))
            found = names(tmp_path)
            assert found.keys() == {"f/a", "f/b"}
            assert len(set(found.values())) == 1


def test_the_staging_folder_can_go_while_another_process_makes_it(tmp_path):
    area = tmp_path / AREA
    processes = [started(STAGING, tmp_path) for _ in range(2)]
    while any(process.poll() is None for process in processes):
        for change in (os.mkdir, os.rmdir):
            with contextlib.suppress(OSError):
                change(area)
    assert [process.returncode for process in processes] == [0, 0]


def test_the_staging_folder_stays_as_long_as_a_run(tmp_path):
    with LocalRoot(tmp_path).lock():
        before = (tmp_path / AREA).stat()
        for _ in range(3):
            with staged(tmp_path, tmp_path / "f"):
                pass
        assert os.path.samestat(before, (tmp_path / AREA).stat())
    assert [path.name for path in tmp_path.iterdir()] == [".lock"]


@pytest.mark.kill
def test_a_killed_run_s_staging_folder_is_gone_after_the_next(tmp_path):
    assert ended(LOCKED_AND_KILLED, tmp_path) == -signal.SIGKILL
    assert len(list((tmp_path / AREA).iterdir())) == 1
    with LocalRoot(tmp_path).lock():
        assert len(list((tmp_path / AREA).iterdir())) == 1
    assert [path.name for path in tmp_path.iterdir()] == [".lock"]


def test_another_disk_below_the_root_gets_what_it_is_to_have(tmp_path):
    # A folder of another disk under a staging root of this one, as a mount is: /dev/shm is a disk of its own.
    with staging.tempfile.TemporaryDirectory(dir="/dev/shm") as other:
        (tmp_path / "media").symlink_to(other)
        for text in ("one", "two"):
            with atomic_folder(tmp_path / "media" / "f", root=tmp_path) as path:
                (path / "a").write_text(text)
        assert names(Path(other)) == {"f/a": "two"}
        assert sorted(p.name for p in tmp_path.iterdir()) == ["media"]


def test_the_same_disk_mounted_twice(tmp_path):
    (tmp_path / "root" / "media").mkdir(parents=True)
    (tmp_path / "far").mkdir()
    script = f'mount --bind {tmp_path / "far"} {tmp_path / "root" / "media"} && exec "$@"'
    mounting = [*unshared("--mount"), "sh", "-c", script, "sh"]
    assert ended(WRITING_TWICE, tmp_path / "root", before=mounting) == 0
    assert names(tmp_path) == {"far/f/a": "two", "far/b": "two"}


@pytest.mark.kill
def test_scratch_folders_of_killed_runs_are_gone_at_the_next(tmp_path, monkeypatch):
    assert ended(SCRATCH_AND_KILLED, env=os.environ | {"TMPDIR": str(tmp_path)}) == -signal.SIGKILL
    assert len(list(tmp_path.rglob("*.obj"))) == 1
    monkeypatch.setattr(staging.tempfile, "tempdir", str(tmp_path))
    with scratch_folder() as folder:
        assert list(folder.iterdir()) == []
        assert list(tmp_path.rglob("*.obj")) == []
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]


@pytest.mark.parametrize("place", ["file/f", "folder"])
def test_a_place_that_cannot_be_written_is_one_line(tmp_path, place):
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder" / "full").mkdir(parents=True)
    before = names(tmp_path)
    with pytest.raises(StoreError, match=f"cannot write {tmp_path / place}: a"), atomic_file(tmp_path, place) as path:
        path.write_text("y")
    assert names(tmp_path) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def test_a_place_where_nothing_can_be_made_is_one_line_and_no_endless_try():
    with pytest.raises(StoreError, match="cannot write /proc/out"), atomic_file(Path("/proc"), "out"):
        pass
