"""Recordings of trajectories that the release no longer has: named by `validate`, removed by `render --prune`."""

from __future__ import annotations

import shutil

import pytest
from support.command_line import said

from aerialdojo_gen.store.shards import shard_name


@pytest.fixture
def data(planted, smoke):
    """The smoke run's release and recordings, and beside them two recordings of a release before it."""
    media = shutil.copytree(smoke / "media", planted.data / "media")
    recorded = next(media.glob("*/*/recording.json")).parent
    shutil.copytree(recorded, recorded.with_name("of-another-release"))
    shutil.copytree(recorded, media / "U_Gone_0" / recorded.name)
    (media / "U_Courtyard_0" / "notes.txt").write_text("mine")
    return planted.data


def files(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.name != ".lock"}


def test_recordings_without_a_trajectory_are_named_and_removed(capsys, data, smoke):
    quick = ("--no-meshes", "--pictures", "0", "--workers", "1")
    code, _, err = said(capsys, "validate", "--data", data, *quick)
    assert code == 0
    (warning,) = [line for line in err.splitlines() if "media/" in line]
    assert "media/ has 2 recordings of trajectories that the release does not have" in warning
    assert f"render --prune --data {data}" in warning
    code, out, _ = said(capsys, "render", "--prune", "--data", data)
    assert (code, out) == (0, "2 recordings removed: the release does not have their trajectories\n")
    assert files(data / "media") == files(smoke / "media") | {"U_Courtyard_0/notes.txt"}
    code, _, err = said(capsys, "validate", "--data", data, *quick)
    assert "media/" not in err
    assert said(capsys, "render", "--prune", "--data", data)[1].startswith("0 recordings removed")


@pytest.mark.parametrize("damage", ["lost part", "damaged part", "no release"])
def test_nothing_is_removed_where_the_release_cannot_tell(capsys, data, damage):
    path = data / shard_name("routes/test", "U_Courtyard_0")
    if damage == "lost part":
        path.unlink()
    elif damage == "damaged part":
        path.write_bytes(path.read_bytes()[:-9])
    else:
        shutil.rmtree(data / "release")
    before = files(data)
    code, _, err = said(capsys, "render", "--prune", "--data", data)
    assert code == 1
    assert err.startswith("error: ")
    assert files(data) == before
