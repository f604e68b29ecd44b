"""How much an export will be is said before it is written, and one archive a scene holds the same files."""

import io
import json
import tarfile

import pytest
from support.releases import files_of

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.dataset.contents import release_scenes
from aerialdojo_gen.exchange.exporting import Size, check_room, estimate_size, export_release
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store.root import open_root


@pytest.mark.parametrize(("form", "most_off"), [("aerialdojo", 0.25), ("habitat", 0.6)])
def test_what_is_announced_is_what_is_written(smoke, tmp_path, form, most_off):
    said = io.StringIO()
    size = estimate_size(form, open_root(smoke), release_scenes(smoke), 0)
    export_release(form, smoke, tmp_path / "out", picture_px=0 if form == "aerialdojo" else None,
                   reporter=Reporter(stream=said))  # fmt: skip
    written = [path.stat() for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert size.files == len(written), "to the file"
    # Links to one file count once.
    assert abs(size.bytes / sum({file.st_ino: file.st_size for file in written}.values()) - 1.0) < most_off
    assert said.getvalue().startswith(f"export: {size}, into {tmp_path / 'out'}")


def test_archives_unpacked_are_the_files(smoke, tmp_path):
    counts = export_release("aerialdojo", smoke, tmp_path / "files", picture_px=0)
    for k in (1, 2):
        assert export_release("aerialdojo", smoke, tmp_path / f"tars-{k}", picture_px=0, shards=True) == counts
    archives = sorted((tmp_path / "tars-1").glob("*.tar"))
    assert [path.stem for path in archives] == release_scenes(smoke)
    assert {path.name for path in (tmp_path / "tars-1").iterdir()} == {*(p.name for p in archives), "export.json"}
    for path in archives:
        assert path.read_bytes() == (tmp_path / "tars-2" / path.name).read_bytes(), "the same bytes every time"
        with tarfile.open(path) as tar:
            assert all((m.uid, m.gid, m.mtime, m.uname) == (0, 0, 0, "") for m in tar)
            tar.extractall(tmp_path / "unpacked", filter="data")
    files = files_of(tmp_path / "files")
    document = json.loads(files.pop("export.json"))
    assert document == json.loads((tmp_path / "tars-1" / "export.json").read_text())
    assert files_of(tmp_path / "unpacked") == files


def test_archives_are_of_one_format(smoke, tmp_path):
    with pytest.raises(UsageError, match="--shards is for --format aerialdojo"):
        export_release("habitat", smoke, tmp_path / "out", shards=True)
    assert not (tmp_path / "out").exists()


def test_many_files_are_told_with_the_other_way(smoke, tmp_path, monkeypatch):
    from aerialdojo_gen.exchange import exporting

    monkeypatch.setattr(exporting, "_MANY_FILES", 100)
    said = io.StringIO()
    export_release("aerialdojo", smoke, tmp_path / "out", picture_px=0, reporter=Reporter(stream=said))
    assert "; --shards writes 3 files in their place, into " in said.getvalue().splitlines()[0]


def test_a_disk_without_room_is_told_before_anything_is_written(tmp_path):
    check_room(tmp_path / "a" / "b", 1)
    with pytest.raises(StoreError, match=r"MB are needed, [\d,]+ MB are free: name another disk by --out"):
        check_room(tmp_path / "a" / "b", 1 << 60)
    assert not (tmp_path / "a").exists()
    assert str(Size(113_362, 947_000_000, 0)) == "113,362 files, about 947 MB"
    assert str(Size(9, 65_000, 0)) == "9 files, about 0.1 MB"
