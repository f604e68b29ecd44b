"""A pipeline file says what is wrong with it, in one line a fault."""

import re

import pytest

from aerialdojo_gen.base.config.pipeline import load_pipeline, with_overrides
from aerialdojo_gen.base.errors import ConfigError


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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[embodiment]\nradius_m = 0.1\n", r"wheelbase_m = 0.25 must be at most twice radius_m = 0.1"),
        ("[anchor-sample]\nstandoff_m = 0.3\n", r"standoff_m = 0.3 must be more than .* = 0.3: every anchor"),
        ("[embodiment]\nradius_m = 1.2\n", r"standoff_m = 1 must be more than \[embodiment\] radius_m"),
        ("[plan]\nmargin_m = 0.06\n", r"margin_m = 0.05 must be at least \[plan\] margin_m .* = 0.06"),
        ("[anchor-sample]\nmargin_m = 0\n", r"margin_m = 0 must be at least \[plan\] margin_m .* = 0.002"),
        ("[plan]\nclearance_cap_m = 0.25\n", r"clearance_cap_m = 0.25 must be more than .* = 0.272"),
        ("[filter]\nmin_euclidean_m = 2\n", r"\[pair-objects\] min_euclidean_m = 3 must be at most .* = 2"),
        (
            "[filter]\nlong_horizon = { min_length_m = 60, max_length_m = 120, action_budget = 300 }\n",
            r"\[pair-objects\] max_length_m = 100 must be at least .* = 120.*; .*"
            r"\[plan\] max_length_m = 100 must be at least .* = 120",
        ),
        ("[plan]\nmin_detour_ratio = 1.2\n", r"\[plan\] min_detour_ratio = 1.2 must be at most .* = 1.05"),
        ("[pair-objects]\nmax_approach_m = 0.5\n", r"\[plan\] max_approach_m = 1 must be at most .* = 0.5"),
        (
            "[plan]\nmax_approach_m = 2\n[pair-objects]\nmax_approach_m = 2\n",
            r"\[plan\] max_approach_m = 2 must be at most 1: agents cannot fly the Approach",
        ),
        (
            "[filter]\nmin_euclidean_m = 2\n[pair-objects]\nmin_euclidean_m = 2\n",
            r"min_euclidean_m = 2 must be at least the success radius, 3",
        ),
        ("[render]\nfov_deg = 75\n", r"fov_deg differs: \[anchor-sample\] 90, .* 90, \[render\] 75"),
        (
            "[filter]\nbase = { min_length_m = 40, max_length_m = 30, action_budget = 90 }\n",
            "min_length_m = 40 must be less than max_length_m = 30",
        ),
        (
            "[filter]\nbase = { min_length_m = 5, max_length_m = 30, action_budget = 200 }\n",
            "action_budget falls in",
        ),
    ],
)
def test_sections_that_contradict_each_other(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message) as error:
        load_pipeline(write(tmp_path, text))
    assert "\n" not in str(error.value)
    assert "p.toml: " in str(error.value)


def test_an_override_may_not_contradict_the_file(tmp_path):
    pipeline = load_pipeline(write(tmp_path, ""))
    with pytest.raises(ConfigError, match=r"^\[plan\] max_length_m = 50 must be at least"):
        with_overrides(pipeline, "plan", max_length_m=50.0)


def test_stricter_stages_later_on_are_no_contradiction(tmp_path):
    text = "[filter]\nmin_euclidean_m = 6\nmin_detour_ratio = 1.3\n[embodiment]\nradius_m = 0.2\nwheelbase_m = 0.3\n"
    assert load_pipeline(write(tmp_path, text)).filter.min_euclidean_m == 6


def test_a_file_of_many_faults_is_told_in_few_words(tmp_path):
    path = tmp_path / "p.toml"
    rung = f'[[plan.ladder]]\nheading_sectors = "{"é" * 1900}"\n'
    path.write_text(rung * 200 + f"[plan]\n{'k' * 60} = 1\n".replace("[plan]", "[render]"), encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_pipeline(path)
    said = str(error.value)
    assert "[plan.ladder.0] heading_sectors = 'éééé" in said
    assert re.search(r"and \d+ more faults$", said)
    assert len(said) < 20 * (300 + len(str(path)) + 4)
