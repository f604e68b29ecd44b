"""Scenes go through stages at their own pace, in one process each, and a failure stops its scene alone."""

import json
import shutil
from collections import Counter

import pytest
from support import chores
from support.command_line import called

from aerialdojo_gen.base.config.pipeline import load_pipeline
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.pipeline.executors.base import make_executor
from aerialdojo_gen.pipeline.freshness import ShardFinder
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.pipeline.registry import BY_NAME, STAGES
from aerialdojo_gen.pipeline.runner import group_stages
from aerialdojo_gen.pipeline.scheduler import RuntimeEstimate, SceneScheduler

SCENES = ("U_Courtyard_0", "U_Courtyard_1")
TABLES = {"pair-objects": "pairs", "plan": "plans", "filter": "verdicts"}


def test_scenes_wait_for_one_another_before_the_release_and_before_recordings():
    split, render = BY_NAME["split"], BY_NAME["render"]
    own = list(STAGES[: STAGES.index(split)])
    assert own[-1].name == "filter"
    first, second, third = group_stages(STAGES)
    assert (first, second, third[0]) == (own, [split], render)
    assert group_stages(own) == [own]
    # Of the last stage alone a part may be wanted.
    assert group_stages(own, alone=True) == [own[:-1], own[-1:]]


# The fixture's run by as many processes as there are cores has the bytes of one process's too: test_resume.
@pytest.mark.pipeline
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.nightly)])
def test_a_process_takes_a_scene_through_the_stages(project, smoke, tmp_path, workers):
    data, notes = shutil.copytree(smoke, tmp_path / "data"), tmp_path / "notes"
    notes.mkdir()
    # Between them plans stay fresh.
    for table in "pairs", "verdicts":
        shutil.rmtree(data / table)
    config, roots = open_pipeline(load_pipeline(project / "pipelines" / "smoke.toml"), data)
    stages = [BY_NAME[name] for name in TABLES]
    known = RuntimeEstimate(stages, SCENES, roots)
    expected_s = known.left_s
    quiet = Reporter(quiet=True)
    finder = ShardFinder(config, roots, SCENES, quiet)
    scheduler = SceneScheduler(stages, finder, known)
    with make_executor("local", workers) as pool:
        outcomes = list(pool.run(chores.compute_and_sign, scheduler))
    assert not scheduler.errors
    pids = {path.name: path.read_text() for path in notes.iterdir()}
    done = {name: len([p for p in pids if f" {name} " in p]) for name in TABLES}
    assert len(pids) == len(outcomes) == sum(done.values())
    assert done == {"pair-objects": 2, "plan": 0, "filter": 2}
    assert len(set(pids.values())) == workers
    for scene in SCENES:
        assert pids[f"{scene} pair-objects 0"] == pids[f"{scene} filter 0"]
    assert {one.stage: (one.shards, one.computed) for one in scheduler.summaries()} == {
        "pair-objects": (2, 2), "plan": (3, 0), "filter": (2, 2)
    }  # fmt: skip
    for table in TABLES.values():
        for path in (smoke / table).rglob("*.parquet"):
            assert (data / path.relative_to(smoke)).read_bytes() == path.read_bytes()
    assert known.left_s == 0.0 < expected_s
    assert known.done_s == pytest.approx(sum(one.seconds for one in outcomes))


@pytest.mark.pipeline
def test_a_scene_that_fails_stops_alone(project, smoke, tmp_path):
    data = shutil.copytree(smoke, tmp_path / "data")
    annotations = shutil.copytree(project / "annotations" / "smoke", tmp_path / "annotations")
    broken = annotations / f"{SCENES[0]}.json"
    document = json.loads(broken.read_text())
    document["objects"][0]["node"] = "nothing_of_that_name"
    broken.write_text(json.dumps(document))
    pipeline = tmp_path / "mine.toml"
    text = (project / "pipelines" / "smoke.toml").read_text()
    text = text.replace('"../annotations/smoke"', f'"{annotations}"').replace('"../', f'"{project}/')
    pipeline.write_text(text + "\n[pair-objects]\nstart_variants = 1\n")
    before = {path: path.stat().st_mtime_ns for path in data.rglob("*.parquet")}
    done = called("run", pipeline, "--data", data, "--workers", "1", cwd=project)
    assert done.returncode == 1
    assert done.stderr.count("error:") == 1
    assert "nothing_of_that_name" in done.stderr
    changed = Counter(
        (path.relative_to(data).parts[0], path.parent.name)
        for path in data.rglob("*.parquet")
        if before.get(path) != path.stat().st_mtime_ns
    )
    # The other one is finished as far as no stage wants all scenes; the release is as it was.
    assert set(changed) == {(table, SCENES[1]) for table in TABLES.values()}
    assert "plan:" not in done.stderr
    # Mended, the first one goes on from where it stopped, and the other one has nothing to do but in `split`.
    shutil.copyfile(project / "annotations" / "smoke" / broken.name, broken)
    done = called("filter", "--pipeline", pipeline, "--data", data, "--workers", "1", cwd=project)
    assert done.returncode == 0, done.stderr
    assert "pair-objects: " in done.stderr
    assert done.stderr.count("1 of 2 shards computed") == 2


def test_what_is_left_follows_what_was_done(project, tmp_path):
    _, roots = open_pipeline(load_pipeline(project / "pipelines" / "aerialdojo-200k.toml"), tmp_path)
    stages, scenes = [BY_NAME["build-scenes"], BY_NAME["plan"]], ["U_Mall_0", "U_Park_0"]
    known = RuntimeEstimate(stages, scenes, roots)
    # A scene with nine times as many objects takes longer, as its annotations tell before there is a table.
    assert known.left("plan", "U_Mall_0") > 3 * known.left("plan", "U_Park_0")
    before = known.left("plan", "U_Park_0"), known.left("build-scenes", "U_Park_0")
    # Half of a scene took ten times what was expected: the rest and other scenes do as well, other stages less so.
    known.record("plan", "U_Mall_0", 0.5, 5.0 * known.left("plan", "U_Mall_0"))
    assert 5.0 < known.left("plan", "U_Park_0") / before[0] < 10.0
    assert 1.0 < known.left("build-scenes", "U_Park_0") / before[1] < 10.0
    known.drop("plan", "U_Park_0")
    assert known.left("plan", "U_Park_0") == 0.0
    assert known.left_s == pytest.approx(sum(known.left(stage.name, scene) for stage in stages for scene in scenes))
