"""Digests of files: right whoever read them, and whatever was done to a file in between."""

import hashlib
import os

import pytest

from aerialdojo_gen.store.files import file_digest, prefetch_files


def test_what_a_thread_reads_ahead_is_found(tmp_path):
    paths = [tmp_path / str(k) for k in range(20)]
    for k, path in enumerate(paths):
        path.write_bytes(os.urandom(k * 700_000))
    prefetch_files([*paths, tmp_path / "none"])
    prefetch_files(paths)
    for path in paths:
        assert file_digest(path) == hashlib.sha256(path.read_bytes()).hexdigest()
    with pytest.raises(FileNotFoundError):
        file_digest(tmp_path / "none")


def test_a_file_that_was_changed_since_is_read_again(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"one")
    prefetch_files([path])
    before = path.stat()
    path.write_bytes(b"two")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert file_digest(path) == hashlib.sha256(b"two").hexdigest()
