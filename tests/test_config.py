"""A pipeline file says what is wrong with it, in one line a fault."""

import pytest

from aerialdojo_gen.config import load_pipeline, with_overrides
from aerialdojo_gen.errors import ConfigError


def write(tmp_path, text):
    path = tmp_path / "p.toml"
    path.write_text(text)
    return path


def test_shipped_pipelines_load(project):
    for path in sorted((project / "pipelines").glob("*.toml")):
        assert load_pipeline(path).name == path.stem


def test_unknown_key_names_file_key_and_what_was_meant(tmp_path):
    path = write(tmp_path, "[plan]\ntargets_per_prat = 3\n")
    with pytest.raises(ConfigError) as error:
        load_pipeline(path)
    message = str(error.value)
    assert str(path) in message
    assert "[plan] unknown key 'targets_per_prat': did you mean 'targets_per_part'?" in message
    assert error.value.exit_code == 2
    assert "\n" not in message


def test_unknown_section_names_the_near_one(tmp_path):
    with pytest.raises(ConfigError, match="'anchor-sampel': did you mean 'anchor-sample'"):
        load_pipeline(write(tmp_path, "[anchor-sampel]\n"))


def test_every_fault_is_listed(tmp_path):
    text = "sed = 1\n[split]\nid_train_fraction = 1.5\n[embodiment]\nradius_m = nan\n"
    with pytest.raises(ConfigError) as error:
        load_pipeline(write(tmp_path, text))
    for word in ("'sed'", "id_train_fraction = 1.5", "radius_m = nan"):
        assert word in str(error.value)


@pytest.mark.parametrize("text", ["name = ", "\udcff", "name = 'a/../b'"])
def test_broken_files(tmp_path, text):
    path = tmp_path / "p.toml"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(ConfigError, match=r"p\.toml"):
        load_pipeline(path)


def test_missing_file_lists_its_neighbours(tmp_path):
    write(tmp_path, "")
    with pytest.raises(ConfigError, match=r"no pipeline file .*q\.toml; there are p\.toml"):
        load_pipeline(tmp_path / "q.toml")


def test_settings_that_do_not_join(tmp_path):
    text = "[filter]\nbase = { min_length_m = 5, max_length_m = 20, action_budget = 90 }\n"
    with pytest.raises(ConfigError, match="the settings must join"):
        load_pipeline(write(tmp_path, text))


def test_folders_are_relative_to_the_file(tmp_path):
    path = write(tmp_path, "scene_assets = 'assets'\n")
    assert load_pipeline(path).scene_assets == tmp_path / "assets"


def test_overrides_replace_only_what_is_given(tmp_path):
    pipeline = load_pipeline(write(tmp_path, "[render]\nlimit = 4\n"))
    assert with_overrides(pipeline, "render", limit=None, sampling="time").render.limit == 4
    assert with_overrides(pipeline, "render", sampling="time").render.sampling == "time"
    with pytest.raises(ConfigError, match="sampling"):
        with_overrides(pipeline, "render", sampling="tiem")
