"""Recordings and pictures that belong to a release, and what commands say where there is none."""

from __future__ import annotations

import shutil

import pytest
from support.command_line import said

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.dataset.lookup import pictured_objects, scenes_with_pictures
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


def test_a_release_alone_has_the_same_pictures(smoke, tmp_path):
    shutil.copytree(smoke / "release", tmp_path / "release")
    scenes = scenes_with_pictures(smoke)
    assert scenes == scenes_with_pictures(tmp_path)
    assert len(scenes) == 2
    told = ("object_id", "name", "description", "reference_image", "tells_missing")
    for scene in scenes:
        staged, released = pictured_objects(smoke, scene), pictured_objects(tmp_path, scene)
        assert len(staged) > 2
        assert [[row[name] for name in told] for row in staged] == [[row[name] for name in told] for row in released]
    assert scenes_with_pictures(tmp_path, ["*_0"]) == [name for name in scenes if name.endswith("_0")]
    with pytest.raises(UsageError, match="no scene 'U_Nowhere_0'"):
        scenes_with_pictures(tmp_path, ["U_Nowhere_0"])


def test_the_gallery_takes_the_scenes_that_are_there(smoke, tmp_path, capsys):
    code, out, _ = said(capsys, "gallery", "--references", "--small", "--data", smoke, "--out", tmp_path / "sheets")
    assert code == 0
    made = sorted((tmp_path / "sheets").iterdir())
    assert [path.name for path in made] == [f"references-{name}-1.jpg" for name in scenes_with_pictures(smoke)]
    assert out.split() == [str(path) for path in made]


TASK = "U_Courtyard_0-0123456789ab"
COMMANDS = {
    "stats": ["stats"],
    "stats --csv": ["stats", "--csv", "figures.csv"],
    "stats --pool": ["stats", "--pool"],
    "report": ["report"],
    "report of a run": ["report", "mine", "--out", "told"],
    "gallery --references": ["gallery", "--references", "--out", "pictured"],
    "render --estimate": ["render", "--estimate"],
    "validate": ["validate"],
    "show": ["show", TASK],
    "view": ["view", "--scene", "U_Courtyard_0", "--no-browser"],
    "export": ["export", "--format", "habitat", "--out", "exported"],
    "evaluate": ["evaluate", "--agent", "stop"],
    "fly": ["fly", "--name", "pilot-1"],
    "evaluate --estimate": ["evaluate", "--agent", "openai", "--option", "model=m", "--estimate"],
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_every_command_says_the_same_line(command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = "name its folder with --data, or make one with make dataset\n"
    where = f"error: there is no release in {tmp_path}/data: "
    asked = (*command, "--data", "data")
    code, _, err = said(capsys, *asked)
    assert (code, err) == (1, f"{where}the folder does not exist; {told}")
    (tmp_path / "data" / "meshes").mkdir(parents=True)
    lack = "it has no folder release" + (
        ", nor tasks, routes, objects, landmarks, anchors, viewpoints or scenes" if command[0] == "validate" else ""
    )
    assert said(capsys, *asked)[2] == f"{where}{lack}; {told}"
    (tmp_path / "data" / "release" / "tasks").mkdir(parents=True)
    lack = "tasks without a file part-<scene>.parquet"
    assert said(capsys, *asked)[2] == f"{where}{lack}; {told}"
    assert {path.name for path in tmp_path.iterdir()} == {"data"}
