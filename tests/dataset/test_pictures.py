"""Reference pictures with their objects: of the pipeline's tables, or of a release that came without them."""

from __future__ import annotations

import shutil

import pytest
from support.command_line import said

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.dataset.lookup import pictured_objects, scenes_with_pictures


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
