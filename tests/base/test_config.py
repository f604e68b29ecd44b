"""A pipeline file says what is wrong with it, in one line a fault."""

import re

import pytest

from aerialdojo_gen.base.config.pipeline import Pipeline, load_pipeline, with_overrides
from aerialdojo_gen.base.errors import ConfigError


def write(tmp_path, text):
    path = tmp_path / "p.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_shipped_pipelines_load(project):
    for path in sorted((project / "pipelines").glob("*.toml")):
        assert load_pipeline(path).name == path.stem


def fault_in(tmp_path, text):
    """What is said of a pipeline file: one line, which begins with the file."""
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as error:
        load_pipeline(path)
    assert error.value.exit_code == 2
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"{path}: ")
    return str(error.value)


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


def test_folders_are_relative_to_the_file(tmp_path):
    path = write(tmp_path, "scene_assets = 'assets'\n")
    assert load_pipeline(path).scene_assets == tmp_path / "assets"


def test_overrides_replace_only_what_is_given(tmp_path):
    pipeline = load_pipeline(write(tmp_path, "[render]\nlimit = 4\n"))
    assert with_overrides(pipeline, "render", limit=None, sampling="time").render.limit == 4
    assert with_overrides(pipeline, "render", sampling="time").render.sampling == "time"
    with pytest.raises(ConfigError, match="sampling"):
        with_overrides(pipeline, "render", sampling="tiem")


BASE = "[task]\nbase = {{ min_length_m = {}, max_length_m = {}, action_budget = {} }}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[embodiment]\nradius_m = 0.1\n", r"wheelbase_m = 0.25 must be at most twice radius_m = 0.1"),
        ("[anchor-sample]\nstandoff_m = 0.3\n", r"standoff_m = 0.3 must be more than .* = 0.3: every anchor"),
        ("[embodiment]\nradius_m = 1.2\n", r"standoff_m = 1 must be more than \[embodiment\] radius_m"),
        ("[plan]\nmargin_m = 0.06\n", r"margin_m = 0.05 must be at least \[plan\] margin_m .* = 0.06"),
        ("[anchor-sample]\nmargin_m = 0\n", r"margin_m = 0 must be at least \[plan\] margin_m .* = 0.002"),
        ("[plan]\nclearance_cap_m = 0.25\n", r"clearance_cap_m = 0.25 must be more than .* = 0.272"),
        ("[plan]\nmin_detour_ratio = 1.2\n", r"\[plan\] min_detour_ratio = 1.2 must be at most .* = 1.05"),
        ("[task]\nmax_approach_m = 2\n", r"\[task\] max_approach_m = 2: .* less than or equal to 1"),
        ("[task]\nmin_euclidean_m = 2\n", r"\[task\] min_euclidean_m = 2: .* greater than or equal to 3"),
        (BASE.format(40, 30, 90), "min_length_m = 40 must be less than max_length_m = 30"),
        (BASE.format(5, 30, 200), "action_budget falls in"),
        (BASE.format(5, 20, 90), "the settings must join"),
        ("[anchor-sample]\nweights = { geometric = 0 }\n", "anchor-sample.*weight"),
        ("[plan]\ntargets_per_prat = 3\n", r"\[plan\] unknown key 'targets_.*': did you mean 'targets_per_part'"),
        ("[anchor-sampel]\n", "'anchor-sampel': did you mean 'anchor-sample'"),
        ("sed = 1\n[split]\nid_train_fraction = 1.5\n", "id_train_fraction = 1.5.*'sed'"),
        ("[embodiment]\nradius_m = nan\n", "radius_m = nan"),
    ],
)
def test_faults_and_sections_that_contradict_each_other(tmp_path, text, message):
    assert re.search(message, fault_in(tmp_path, text))


def test_an_override_may_not_contradict_the_file(tmp_path):
    pipeline = load_pipeline(write(tmp_path, ""))
    with pytest.raises(ConfigError, match=r"^\[plan\] min_detour_ratio = 1.2 must be at most"):
        with_overrides(pipeline, "plan", min_detour_ratio=1.2)


@pytest.mark.parametrize(
    ("section", "line", "place"),
    [
        ("filter", "min_euclidean_m = 4", "set [task] min"),
        ("pair-objects", "max_length_m = 120", "set [task] lo"),
        ("render", "fov_deg = 75", "set [camera] fov_deg"),
        ("plan", "quota = { search_margin = 0.3 }", "leave it out"),
    ],
)
def test_a_shared_value_that_a_stage_sets_otherwise_is_told_its_place(tmp_path, section, line, place):
    said = fault_in(tmp_path, f"[{section}]\n{line}\n")
    key = line.partition(" ")[0]
    assert said.startswith(f"{tmp_path / 'p.toml'}: [{section}] {key} is no key of this section: {place}")


def test_a_shared_value_goes_to_every_stage_that_reads_it(tmp_path):
    text = (
        "[camera]\nfov_deg = 75\n[task]\nmin_euclidean_m = 4\nmax_approach_m = 0.5\n"
        "long_horizon = { min_length_m = 60, max_length_m = 120, action_budget = 300 }\n"
    )
    loaded = load_pipeline(write(tmp_path, text))
    # A file of an earlier version that says the same in the old place is read too.
    older = load_pipeline(write(tmp_path, f"{text}[filter]\nmin_euclidean_m = 4\n[render]\nfov_deg = 75\n"))
    overridden = with_overrides(loaded, "split", id_train_fraction=0.5)
    for pipeline in (loaded, older, overridden, Pipeline.model_validate(loaded.model_dump(by_alias=True))):
        cameras = (pipeline.anchor_sample, pipeline.reference_images, pipeline.render)
        assert {section.fov_deg for section in cameras} == {75}
        assert {section.min_euclidean_m for section in (pipeline.pair_objects, pipeline.filter)} == {4}
        assert {section.max_approach_m for section in (pipeline.pair_objects, pipeline.plan)} == {0.5}
        assert {section.max_length_m for section in (pipeline.pair_objects, pipeline.plan)} == {120}
        assert pipeline.filter.long_horizon.max_length_m == 120
    assert "fov_deg" not in loaded.model_dump(by_alias=True)["render"]
    # Overriding what is shared reaches them too.
    assert with_overrides(loaded, "camera", fov_deg=60.0).render.fov_deg == 60


def test_stricter_stages_later_on_are_no_contradiction(tmp_path):
    text = "[filter]\nmin_detour_ratio = 1.3\n[embodiment]\nradius_m = 0.2\nwheelbase_m = 0.3\n"
    assert load_pipeline(write(tmp_path, text)).filter.min_detour_ratio == 1.3


def test_a_file_of_many_faults_is_told_in_few_words(tmp_path):
    rung = f'[[plan.ladder]]\nheading_sectors = "{"é" * 1900}"\n'
    said = fault_in(tmp_path, rung * 200 + f"[render]\n{'k' * 60} = 1\n")
    assert "[plan.ladder.0] heading_sectors = 'éééé" in said
    assert re.search(r"and \d+ more faults$", said)
    assert len(said) < 20 * (300 + len(str(tmp_path / "p.toml")) + 4)
