"""`config show` and `config init`: every key of the models, and files that say what the models say."""

import json
import re

import pytest
from support.command_line import said

from aerialdojo_gen.base.config.keys import config_keys, section_meanings
from aerialdojo_gen.base.config.pipeline import Pipeline, load_pipeline
from aerialdojo_gen.base.errors import AerialDojoError, ConfigError, UsageError
from aerialdojo_gen.pipeline.template import init_config, pipeline_text


def schema_keys():
    """Every key by what Pydantic itself says of the models."""
    whole = Pipeline.model_json_schema(by_alias=True)
    found = set()

    def follow(section, node):
        for name, value in node.get("properties", {}).items():
            if "shared" in value:
                continue
            found.add((section, name))
            for option in (value, *value.get("anyOf", ()), *value.get("allOf", ())):
                many = "items" in option
                reference = (option.get("items") or option).get("$ref")
                if reference:
                    inner = whole["$defs"][reference.rpartition("/")[2]]
                    where = f"{section}.{name}" if section else name
                    follow(f"{where}[]" if many else where, inner)

    follow("", whole)
    return {(section, name) for section, name in found if section or name not in section_meanings()}


def test_every_key_of_the_models_is_listed_once_with_its_meaning():
    keys = config_keys()
    listed = [(key.section, key.name) for key in keys]
    assert set(listed) == schema_keys()
    assert len(listed) == len(set(listed)) > 90
    assert [f"{key.section} {key.name}" for key in keys if not key.meaning] == []
    assert all(section_meanings().values())


def test_values_are_the_pipelines_and_defaults_the_models(project):
    keys = {(key.section, key.name): key for key in config_keys(project / "pipelines/aerialdojo-hard.toml")}
    assert keys["filter", "min_plan_detour"].value == 1.05
    assert keys["filter", "min_plan_detour"].default == 1.0
    assert keys["filter", "min_plan_detour"].bounds == "≥ 1, ≤ 1000"
    assert keys["task.long_horizon", "action_budget"].value == 300
    changed = {at for at, key in keys.items() if key.changed}
    assert ("filter", "base") not in changed
    assert ("split", "salt") in changed


@pytest.mark.parametrize("name", [None, "smoke", "aerialdojo-200k", "aerialdojo-hard"])
def test_what_is_written_is_read_as_it_was(name, project, tmp_path):
    shipped = None if name is None else project / f"pipelines/{name}.toml"
    path = init_config(tmp_path / "mine.toml", shipped)
    before = Pipeline() if shipped is None else load_pipeline(shipped)
    assert load_pipeline(path) == before.model_copy(update={"name": "mine"})
    text = path.read_text(encoding="utf-8")
    assert str(project) not in text
    assert ".." not in text, "the folder that the program is installed in, which an upgrade may move"
    assert ('recipes = "shipped:scene_assets/smoke"' in text) == (name == "smoke")


def test_every_commented_key_shows_its_default(tmp_path):
    """With the sign before it taken away the file says the same."""
    path = init_config(tmp_path / "mine.toml")
    text = path.read_text(encoding="utf-8")
    bare = re.sub(r"^#(?=[a-z_]+ = |  \{|\])", "", text, flags=re.MULTILINE)
    own = {key.name for key in config_keys() if "." not in key.section and key.value is not None}
    assert set(re.findall(r"^([a-z_]+) = ", bare, re.MULTILINE)) == own
    path.write_text(bare, encoding="utf-8")
    assert load_pipeline(path) == Pipeline(name="mine")
    for key in config_keys():
        assert key.name in text


def test_hard_values_are_written_so_that_they_are_read(tmp_path):
    """Quotes, DEL and letters beyond the basic plane in a text; a table by view; a model where there was none."""
    render = {"offsets_m": {"front": (0.1, 0.0, -0.05)}, "views": ("front", "down")}
    clip = {"vision": tmp_path / "models/v.onnx", "text": tmp_path / "t.onnx", "tokenizer": tmp_path / "tok.json"}
    given = {
        "name": "mine", "recipes": tmp_path.parent / "recipes", "split": {"salt": 'a "salt"\\ of \x7f and 🜁 \n.....'},
        "render": render, "anchor-sample": {"clip": clip, "picture_px": 320},
    }  # fmt: skip
    pipeline = Pipeline.model_validate(given)
    path = init_config(tmp_path / "mine.toml", pipeline)
    assert load_pipeline(path) == pipeline
    assert 'recipes = "../recipes"' in path.read_text(encoding="utf-8")
    assert str(tmp_path.parent) in pipeline_text(pipeline)


def test_what_cannot_be_written(tmp_path):
    path = init_config(tmp_path / "mine.toml")
    before = path.read_bytes()
    with pytest.raises(UsageError, match=r"mine\.toml exists: --force"):
        init_config(path, Pipeline(seed=3))
    assert path.read_bytes() == before
    init_config(path, Pipeline(seed=3), force=True)
    assert load_pipeline(path).seed == 3
    for name, words in (("mine.json", "NAME.toml"), ("no name.toml", "name = 'no name'")):
        with pytest.raises(AerialDojoError, match=words):
            init_config(tmp_path / name)
    with pytest.raises(ConfigError, match=r"no pipeline file .*q\.toml"):
        init_config(tmp_path / "other.toml", tmp_path / "q.toml")
    assert {p.name for p in tmp_path.iterdir()} == {"mine.toml"}


def test_the_command_shows_what_the_function_lists(project, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    smoke, mine = project / "pipelines/smoke.toml", tmp_path / "mine.toml"
    _, text, _ = said(capsys, "config", "show", "--json", "--pipeline", smoke)
    assert json.loads(text) == [key.as_json() for key in config_keys(smoke)]
    for args in ([], ["embodiment"], ["anchor-sample"], ["plan"]):
        _, text, _ = said(capsys, "config", "show", *args)
        assert max(map(len, text.splitlines())) <= 80
        assert re.search(r"^[ *] (name|cell_m|radius_m|standoff_m) = ", text, re.MULTILINE)
    assert "* min_detour_ratio = 1.05  (default: 0.0)" in text
    assert "  cell_m = 0.5 m" in text
    code, _, err = said(capsys, "config", "show", "plann")
    assert (code, err) == (2, "error: no section 'plann': did you mean 'plan'?\n")
    _, text, _ = said(capsys, "config", "init", mine)
    assert text.splitlines()[1] == f"next: aerialdojo-gen run {mine} --data data-mine"
    assert load_pipeline(mine) == Pipeline(name="mine")
