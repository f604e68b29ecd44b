"""A release knows which pipeline made it; another one does not take its place unasked."""

from __future__ import annotations

import json
import os
import re
import shutil

import pandas as pd
import pytest
from support.command_line import said
from support.releases import files_of

from aerialdojo_gen.base.config.pipeline import load_pipeline
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.dataset.build import open_pipeline, run_pipeline
from aerialdojo_gen.dataset.contents import existing_scenes
from aerialdojo_gen.pipeline import runner
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root

A, B = "U_Courtyard_0", "U_Courtyard_1"


@pytest.fixture
def data(smoke, tmp_path):
    """A copy of the smoke run."""
    return shutil.copytree(smoke, tmp_path / "data")


@pytest.fixture
def pipeline(project, tmp_path):
    """Writer of pipelines like smoke.toml."""

    def write(name="other", scenes=(B,), more=""):
        text = (project / "pipelines" / "smoke.toml").read_text().replace('"../', f'"{project}/')
        text = text.replace('name = "smoke"', f'name = "{name}"\nscenes = {json.dumps(list(scenes))}')
        (tmp_path / "mine.toml").write_text(f"{text}\n{more}")
        return tmp_path / "mine.toml"

    return write


def times(data):
    return {p: p.stat().st_mtime_ns for p in data.rglob("*") if p.is_file() and p.name != ".lock"}


def split(data, pipeline, scene=None, **options):
    run_pipeline(pipeline, data, stages=["split"], scenes=scene, workers=1, **options)


@pytest.mark.parametrize("verb", ["split", "render", "run"])
def test_another_pipeline_is_refused_at_once_and_nothing_is_lost(data, pipeline, verb, capsys):
    before = times(data)
    command = [verb, pipeline()] if verb == "run" else [verb, "--pipeline", pipeline()]
    code, _, err = said(capsys, *command, "--data", data)
    assert (code, err.count("\n")) == (2, 1)
    tasks = {s: sum(store.count_rows(data, f"tasks/{k}", s) for k in ("train", "test")) for s in (A, B)}
    for words in (
        f"error: the release in {data} was made by pipeline 'smoke': pipeline 'other' would ",
        f"remove 1 scene with {tasks[A]} tasks ({A})", f"replace 1 scene with {tasks[B]} tasks ({B})",
        "; give --pipeline smoke, use another --data, or lose them with --replace",
    ):  # fmt: skip
        assert words in err
    assert times(data) == before


def test_commands_take_the_pipeline_of_the_release(data, capsys):
    before = files_of(data / "release")
    code, _, err = said(capsys, "render", "--data", data, "--limit", "1", "--workers", "1")
    assert (code, bool(re.search(r"render: [1-9] rows in", err))) == (0, True), err
    assert files_of(data / "release") == before
    quick = ("--no-meshes", "--pictures", "0", "--workers", "1")
    for place in (data, data / "release"):
        code, out, err = said(capsys, "validate", "--release", place, *quick)
        assert code == 0
        assert "another salt" not in out + err
    code, out, err = said(capsys, "validate", "--data", data, *quick, "--pipeline", "aerialdojo-200k")
    assert err.startswith("not the pipeline of the release, which is --pipeline smoke")


def test_a_pipeline_of_ones_own_takes_the_place_of_another_and_is_found_beside_the_data(data, pipeline, capsys):
    file = pipeline()
    split(data, file, replace=True)
    assert existing_scenes(data) == [B]
    (entry,) = json.loads((data / "release" / "pipeline.json").read_text())["pipelines"]
    assert (entry["name"], entry["scenes"]) == ("other", [B])
    assert f"| `{A}` |" not in (data / "release" / "README.md").read_text()
    before = times(data)
    code, _, err = said(capsys, "split", "--data", data, "--workers", "1")
    assert (code, times(data)) == (0, before), err
    file.unlink()
    code, _, err = said(capsys, "split", "--data", data, "--workers", "1")
    assert code == 2
    assert err == f"error: the release in {data} was made by pipeline 'other': give its file, --pipeline FILE\n"
    assert times(data) == before
    # What only reads goes on: whoever downloads a release does not have its pipeline.
    assert open_pipeline(None, data, reads=True)[0].name == "aerialdojo-200k"
    (data / "release" / "pipeline.json").write_text(
        '{"pipelines": [{"name": "../other"}, {"name": "a"}, {"name": "b"}]}'
    )
    with pytest.raises(UsageError, match="made by pipelines a and b: choose by --pipeline NAME"):
        open_pipeline(None, data)


def test_what_describes_a_release_is_written_again_only_where_something_is_another(data, project):
    documents = [data / "release" / name for name in ("README.md", "croissant.json", "pipeline.json")]
    split(data, project / "pipelines" / "smoke.toml")
    before = [(path.stat().st_ino, path.read_bytes()) for path in documents]
    split(data, project / "pipelines" / "smoke.toml")
    assert [(path.stat().st_ino, path.read_bytes()) for path in documents] == before
    for path, change in zip(documents, (b"edited", None, b"{}"), strict=True):
        path.write_bytes(change) if change else path.unlink()
        split(data, project / "pipelines" / "smoke.toml")
        assert [path.read_bytes() for path in documents] == [text for _, text in before], path.name


def test_a_scene_is_added_beside_another_pipeline_s_and_not_put_in_its_place(data, project, pipeline):
    split(data, pipeline(), scene=[B], replace=True)
    found = json.loads((data / "release" / "pipeline.json").read_text())["pipelines"]
    assert [(entry["name"], entry["scenes"]) for entry in found] == [("other", [B]), ("smoke", [A])]
    split(data, project / "pipelines" / "smoke.toml", scene=[A])
    with pytest.raises(UsageError, match=f"made by pipeline 'other': pipeline 'smoke' would replace 1 .*{B}"):
        split(data, project / "pipelines" / "smoke.toml", scene=["*"])


def test_a_copy_with_the_same_name_and_other_settings_removes_nothing(data, pipeline):
    before = files_of(data / "release")
    with pytest.raises(UsageError, match=f"'smoke' with other settings: pipeline 'smoke' would remove 1 .*{A}"):
        split(data, pipeline("smoke", more="[filter]\nmin_detour_ratio = 1.1\n"))
    assert files_of(data / "release") == before
    # Narrowed and nothing else: the release holds what the pipeline asks for, as ever.
    split(data, pipeline("smoke"))
    assert existing_scenes(data) == [B]


def test_a_release_that_does_not_say_is_not_thinned_out_but_made_again(data, project, pipeline):
    path = data / "release" / "pipeline.json"
    before = files_of(data / "release")
    for record in (None, "{", '{"pipelines": [{"name": 3}]}'):
        path.unlink() if record is None else path.write_text(record)
        with pytest.raises(UsageError, match="by a pipeline that it does not name: pipeline 'other' would remove 1"):
            split(data, pipeline())
        split(data, project / "pipelines" / "smoke.toml")
        assert files_of(data / "release") == before
    shutil.rmtree(data / "release" / "tasks" / "id_train")
    split(data, project / "pipelines" / "smoke.toml", scene=[A])
    assert files_of(data / "release") == before, "the other scene stays"


def test_what_stands_beside_the_tables_is_written_while_the_data_is_held(tmp_path):
    def other():
        with pytest.raises(StoreError, match="another run is writing"), open_root(tmp_path / "data").lock():
            pass
        asked.append(os.getpid())

    asked = []
    config, roots = open_pipeline(None, tmp_path / "data")
    runner.run([], [], config, roots, prepare=other, finish=other)
    assert len(asked) == 2


def test_a_harder_release_of_the_same_candidates_costs_filter_and_split_alone(data, pipeline, project):
    """As aerialdojo-hard.toml beside aerialdojo-200k.toml: what both need is computed once."""
    paper, hard = (load_pipeline(project / "pipelines" / f"aerialdojo-{name}.toml") for name in ("200k", "hard"))
    asked = hard.filter
    assert (asked.min_plan_detour, asked.max_visible_at_start, hard.split.paper_counts) == (1.05, 0.0, False)
    for stage in ("build-scenes", "annotate-import", "anchor-sample", "reference-images", "describe", "pair-objects"):
        assert hard.section(stage) == paper.section(stage)
    # That release has no counts to be full of: it searches all candidates.
    assert hard.section("plan") == paper.plan.model_copy(update={"search": "all", "quota": None})
    assert (hard.seed, hard.embodiment, hard.split.salt) == (paper.seed, paper.embodiment, paper.split.salt)

    shutil.rmtree(data / "release")
    before = times(data / "plans") | times(data / "pairs")
    more = "[filter]\nmin_plan_detour = 1.05\nmax_visible_at_start = 0.0\n"
    split(data, pipeline("hard", (A, B), more))
    assert times(data / "plans") | times(data / "pairs") == before
    verdicts, plans, pairs = (pd.read_parquet(data / name) for name in ("verdicts", "plans", "pairs"))
    key = ["scene", "pair_id"]
    verdicts = verdicts.merge(plans[[*key, "plan_detour"]], on=key).merge(
        pairs[[*key, "target_visible_at_start"]], on=key
    )
    allowed = (verdicts["plan_detour"] >= 1.05) & (verdicts["target_visible_at_start"] == 0.0)
    assert set(verdicts["reason"]) >= {"kept", "small_plan_detour", "target_in_view"}
    assert not verdicts["keep"][~allowed].any()
    assert not allowed[verdicts["reason"].isin(["small_plan_detour", "target_in_view"])].any()
    routes = pd.concat(pd.read_parquet(p) for p in (data / "release" / "routes").glob("*/*.parquet"))
    assert len(routes) == verdicts["keep"].sum() > 0
    (entry,) = json.loads((data / "release" / "pipeline.json").read_text())["pipelines"]
    assert (entry["name"], entry["paper_counts"]) == ("hard", False)
    card = (data / "release" / "README.md").read_text()
    assert "pipeline `hard`" in card
    assert "kept are only routes at least 5 % longer than the shortest without obstacles, and only tasks" in card
    assert "to the paper's counts" not in card
