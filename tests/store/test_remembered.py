"""What is kept of files is what they say: never of files that have changed, never in the way."""

from __future__ import annotations

import hashlib
import os
import shutil

import pytest

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.cli.app import app
from aerialdojo_gen.store.cache import cache_text, is_cached, memo, memo_key
from aerialdojo_gen.store.files import file_digest
from aerialdojo_gen.store.root import open_root

pytestmark = pytest.mark.usefixtures("cache")


@pytest.fixture
def root(tmp_path):
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "a").write_text("a")
    (folder / "b").write_text("b")
    return open_root(folder)


def test_a_key_is_of_the_files_and_of_what_is_asked(root, tmp_path):
    key = memo_key(root, ["a", "b"], "stats", 80)
    assert key == memo_key(root, ["b", "a"], "stats", 80)
    others = [(["a"], "stats", 80), (["a", "b"], "stats", 79), (["a", "b", "c"],)]
    keys = {key, *(memo_key(root, *asked) for asked in others)}
    os.utime(tmp_path / "data" / "a", ns=(1, 1))
    keys.add(memo_key(root, ["a", "b"], "stats", 80))
    (tmp_path / "data" / "b").unlink()
    keys.add(memo_key(root, ["a", "b"], "stats", 80))
    assert len(keys) == 6


def test_a_text_is_made_once(root):
    asked = []
    key = memo_key(root, ["a"])
    texts = [memo(key, lambda: asked.append(1) or "ärial") for _ in range(3)]
    assert texts == ["ärial"] * 3
    assert len(asked) == 1
    assert is_cached(key)
    assert not is_cached(memo_key(root, ["b"]))


def test_where_nothing_can_be_kept_it_is_made_each_time(root, cache):
    cache.write_text("a file where the folder should be")
    assert [memo(memo_key(root, ["a"]), lambda: "text") for _ in range(2)] == ["text"] * 2
    cache_text(memo_key(root, ["a"]))
    assert not is_cached(memo_key(root, ["a"]))


def test_stats_of_a_changed_release_are_its_own_and_a_truncated_part_is_told(smoke, tmp_path, capsys):
    shutil.copytree(smoke / "release", tmp_path / "copy" / "release")

    def stats():
        app(["stats", "--data", str(tmp_path / "copy")], standalone_mode=False)
        return capsys.readouterr().out

    first = stats()
    assert "U_Courtyard_0" in first
    assert stats() == first
    parts = list(tmp_path.rglob("part-U_Courtyard_0.parquet"))
    parts[0].write_bytes(parts[0].read_bytes()[:-20])
    with pytest.raises(StoreError, match=parts[0].name):
        stats()
    for path in parts:
        path.unlink()
    assert "U_Courtyard_0" not in stats()


def test_a_file_that_was_changed_since_is_read_again(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"one")
    assert file_digest(path) == hashlib.sha256(b"one").hexdigest()
    before = path.stat()
    path.write_bytes(b"two")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert file_digest(path) == hashlib.sha256(b"two").hexdigest()
