"""The command `export`, of whatever format: what makes no sense is refused before anything is written."""

import pytest
from support.command_line import called

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.exchange.exporting import Size, check_room

NONSENSE = [
    ("xml", "no format 'xml': there are aerialdojo, habitat"),
    ("lerobots", "did you mean 'lerobot'"),
    ("habitat --scene Nowhere", "Nowhere"),
    ("habitat --picture-size 64", "--picture-size is for --format aerialdojo"),
    ("lerobot --picture-size 64", "--picture-size is for --format aerialdojo"),
    ("aerialdojo --picture-size 9", "16 to 4096 pixels, or 0"),
    ("habitat --shards", "--shards is for --format aerialdojo"),
    ("occupancy --shards", "--shards is for --format aerialdojo"),
    ("habitat --limit 3", "--limit is for --format lerobot and webdataset, not for habitat"),
    ("occupancy --limit 1", "--limit is for --format lerobot and webdataset"),
    ("habitat --split train --view down", "--split, --view are for"),
    ("lerobot --width 31", "even --width and --height, not 31 x 31"),
    ("lerobot --jpeg-quality 80", "--jpeg-quality is for --format webdataset"),
    ("webdataset --goal txt", "did you mean 'text'"),
    ("webdataset --view up", "no view 'up'"),
    ("webdataset --split id_trian", "did you mean 'id_train'"),
    ("webdataset --source disk", "no source 'disk'"),
    ("webdataset --scene U_Nowhere_0", "no scene 'U_Nowhere_0'"),
    ("pointcloud --voxel-m 1", "--voxel-m is for --format occupancy"),
    ("habitat --points-per-m2 1", "--points-per-m2 is for --format pointcloud"),
    ("pointcloud --points-per-m2 0", "is above 0, not 0"),
    ("pointcloud --points-per-m2 1e6", "more than 50,000,000"),
    ("occupancy --voxel-m nan", "is 0.05 to 5 metres, not nan"),
    ("occupancy --scene U_Nowhere", "no scene 'U_Nowhere'"),
]


@pytest.mark.parametrize(("asked", "message"), NONSENSE)
def test_what_makes_no_sense_is_one_line(smoke, tmp_path, asked, message):
    done = called("export", "--data", smoke, "--out", tmp_path / "x", "--format", *asked.split())
    assert (done.returncode, done.stderr.count("\n")) in ((1, 1), (2, 1)), done.stderr
    assert message in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_disk_without_room_is_told_before_anything_is_written(tmp_path):
    check_room(tmp_path / "a" / "b", 1)
    with pytest.raises(StoreError, match=r"MB are needed, [\d,]+ MB are free: name another disk by --out"):
        check_room(tmp_path / "a" / "b", 1 << 60)
    assert not (tmp_path / "a").exists()
    assert str(Size(113_362, 947_000_000, 0)) == "113,362 files, about 947 MB"
    assert str(Size(9, 65_000, 0)) == "9 files, about 0.1 MB"
