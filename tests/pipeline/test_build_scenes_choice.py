"""Which layout a recipe names is found without reading its lists of things, as reading all of it would."""

import pytest

from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.pipeline.stage import ProjectPaths
from aerialdojo_gen.pipeline.stages.hooks import layout_of
from aerialdojo_gen.scenes import layouts


def chosen(folder, scene):
    return layout_of(ProjectPaths(folder, folder, folder, folder), scene)


def test_every_recipe_names_its_own(project):
    folder = project / "scene_assets" / "scenes"
    known = layouts.layout_modules()
    recipes = sorted(folder.glob("*.toml"))
    assert len(recipes) >= 42
    for path in recipes:
        body = read_toml(path)
        named = () if "plan" in body else (f"aerialdojo_gen.scenes.layouts.{known[body['layout']]}",)
        assert chosen(folder, path.stem) == named, path


@pytest.mark.parametrize(
    ("text", "modules"),
    [
        ("plan = 1\n", ()),
        ('note = """\n[x]\nlayout = "park"\n"""\nplan = 1\n', ()),
        ('layout = "town"\n[imported]\nmesh = "a.glb"\n', ()),
        ('[parameters]\nlayout = "town"\n', None),
        ('layout = "none"\n', None),
        ("layout = [\n", None),
    ],
)
def test_a_table_begins_where_toml_says(tmp_path, text, modules):
    (tmp_path / "S_0.toml").write_text(text)
    assert chosen(tmp_path, "S_0") == modules
    (tmp_path / "S_1.toml").write_bytes(b"layout = '\xff'")
    assert chosen(tmp_path, "S_1") is None
    assert chosen(tmp_path, "S_2") is None
