"""A shard's fingerprint beside the code: whatever its rows depend on changes it, every key of a pipeline file too."""

import contextlib
import dataclasses
import functools
import json
import operator
import shutil
import typing
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from fuzzing.mutate import toml_dumped
from pydantic import BaseModel

from aerialdojo_gen.base.config.pipeline import Pipeline, load_pipeline
from aerialdojo_gen.base.config.sections import PROFILES, ClipConfig, VlmConfig
from aerialdojo_gen.base.config.shared import shared_values
from aerialdojo_gen.base.errors import ConfigError
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.pipeline import freshness
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import from_rows

SCENE = "U_Courtyard_0"


@pytest.fixture(scope="module")
def opened(project, smoke, tmp_path_factory):
    """The smoke pipeline, its folders and its first scene's tables, all copied: a test may change them."""
    folder = tmp_path_factory.mktemp("opened")
    pipeline, roots = open_pipeline(project / "pipelines" / "smoke.toml", folder / "data")
    copied = {}
    for name in ("recipes", "scene_assets", "annotations"):
        copied[name] = shutil.copytree(getattr(roots, name), folder / name)
    for stage in BY_NAME.values():
        for table in stage.reads:
            for part in store.shards(smoke, table, SCENE):
                (folder / "data" / part).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(smoke / part, folder / "data" / part)
    return pipeline, dataclasses.replace(roots, **copied)


def prints(opened):
    return {name: freshness.scene_fingerprint(stage, *opened, SCENE) for name, stage in BY_NAME.items()}


def changed(before, after):
    return {name for name in before if before[name] != after[name]}


def test_every_table_that_a_stage_reads_counts(opened):
    _, roots = opened
    before = prints(opened)
    judged = set()
    for table in sorted({table for stage in BY_NAME.values() for table in stage.reads}):
        parts = store.shards(roots.data, table, SCENE)
        rows = pq.read_table(roots.data.path / parts[-1], partitioning=None)
        if not rows.num_rows:
            continue
        judged.add(table)
        last = len(parts) - 1
        store.write_shard(roots.data, table, SCENE, last, rows.slice(0, rows.num_rows - 1), parts=len(parts))
        readers = {name for name, stage in BY_NAME.items() if table in stage.reads}
        assert changed(before, prints(opened)) == readers, table
        # The same rows, written by another run, make nothing stale.
        store.write_shard(roots.data, table, SCENE, last, rows, parts=len(parts), fingerprint="0" * 64)
    assert judged >= {"scenes", "landmarks", "objects", "anchors", "references", "pairs", "plans", "verdicts"}
    assert prints(opened) == before


def test_files_count_by_their_bytes_and_not_by_the_place_of_a_checkout(opened, project):
    pipeline, roots = opened
    before = prints(opened)
    _, elsewhere = open_pipeline(project / "pipelines" / "smoke.toml", roots.data)
    assert elsewhere.recipes != roots.recipes
    assert prints((pipeline, elsewhere)) == before
    annotations, recipe = roots.annotations / f"{SCENE}.json", roots.recipes / f"{SCENE}.toml"
    for path, text, stale in (
        (annotations, json.dumps(json.loads(annotations.read_text())), {"annotate-import"}),
        (recipe, recipe.read_text() + "# a comment\n", {"build-scenes"}),
    ):
        whole = path.read_bytes()
        path.write_text(text)
        assert changed(before, prints(opened)) == stale
        path.write_bytes(whole)
    assert prints(opened) == before


def test_the_papers_figures_count_where_they_are_read(opened, tmp_path, monkeypatch):
    before = prints(opened)
    files = freshness.paper_figures.files()
    copies = [shutil.copy(path, tmp_path / path.name) for path in files]
    monkeypatch.setattr(freshness.paper_figures, "files", lambda: copies)
    assert prints(opened) == before, "a checkout elsewhere"
    copies[-1].write_bytes(copies[-1].read_bytes() + b"\n")
    assert changed(before, prints(opened)) == {"annotate-import", "plan", "split"}


@pytest.mark.parametrize("table", ["pairs", "plans"])
def test_schemas_count_for_who_writes_and_who_reads_them(opened, monkeypatch, table):
    before = prints(opened)
    place = store.LAYOUT[table]
    other = dataclasses.replace(place, spec=dataclasses.replace(place.spec, plain=(*place.spec.plain, "scene")))
    monkeypatch.setitem(store.LAYOUT, table, other)
    freshness._schemas.cache_clear()
    after = prints(opened)
    freshness._schemas.cache_clear()
    touched = {name for name, stage in BY_NAME.items() if table in (*stage.reads, *stage.writes)}
    assert changed(before, after) == touched


ALL = set(BY_NAME)
# Keys that say what is run, or where files are: the files count by their bytes.
UNCOUNTED = {"name", "scenes", "stages", "scene_assets", "recipes", "annotations"}
# Keys that must keep the same value.
BOUNDS = [
    [("task", "base", "max_length_m"), ("task", "standard", "min_length_m")],
    [("task", "standard", "max_length_m"), ("task", "long_horizon", "min_length_m")],
]
JOINED = {key: keys for keys in BOUNDS for key in keys}
# Which stages read a shared key; `filter` reads the others of [task].
SHARED = {
    ("camera", "fov_deg"): {"anchor-sample", "reference-images", "render"},
    ("task", "min_euclidean_m"): {"pair-objects", "filter"},
    ("task", "max_approach_m"): {"pair-objects", "plan"},
    ("task", "long_horizon", "max_length_m"): {"pair-objects", "plan", "filter"},
}
# `plan` searches what is released, and then depends on what decides on that.
RELEASED = {("plan", "search"): "released", ("split", "paper_counts"): True}


def values_of(model, path=()):
    """Each key's path, value and the words that it may have, of a model and the models in it."""
    for name, field in type(model).model_fields.items():
        if name in shared_values(type(model)):
            continue
        value, key = getattr(model, name), (*path, field.alias or name)
        if isinstance(value, BaseModel):
            yield from values_of(value, key)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for k, inner in enumerate(value):
                yield from values_of(inner, (*key, k))
        else:
            literal = typing.get_origin(field.annotation) is typing.Literal
            yield key, value, typing.get_args(field.annotation) if literal else ()


def others(value, words):
    """Values of the same kind, some of which the key's bounds let through."""
    if words:
        return [word for word in words if word != value]
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1, value - 1, value + 2]
    if isinstance(value, float):
        return [value * 1.01 + 0.001, value * 0.99 - 0.001]
    if isinstance(value, tuple):
        return [value[:-1], (*value, "U_*")]
    if isinstance(value, dict):
        return [{**value, "down": [0.0, 0.0, -0.1]}]
    return ["another-text-of-some-length", ["plan"]]


def written(folder, changes):
    """The pipeline of a file with every key in it, some of them changed."""
    whole = Pipeline()
    scorers = {
        "clip": ClipConfig(vision="v.onnx", text="t.onnx", tokenizer="t.json", sha256="0" * 64),
        "vlm": VlmConfig(model="m", base_url="http://127.0.0.1:9/v1"),
    }
    whole = whole.model_copy(update={"anchor_sample": whole.anchor_sample.model_copy(update=scorers)})
    raw = whole.model_dump(by_alias=True, mode="json", exclude_none=True)
    for (*folders, last), value in changes.items():
        functools.reduce(operator.getitem, folders, raw)[last] = value
    if ("render", "profile") in changes:
        raw["render"] = {k: v for k, v in raw["render"].items() if k not in PROFILES["training"]}
    file = folder / "pipeline.toml"
    file.write_text(toml_dumped(raw))
    return load_pipeline(file)


def changed_by(folder, base, key, value, words):
    """The pipeline with another value of a key, and of those that must go with it; None where none is allowed."""
    for other in others(value, words):
        with contextlib.suppress(ConfigError):
            return written(folder, base | dict.fromkeys(JOINED.get(key, [key]), other))
    return None


def test_a_key_counts_for_the_stages_that_read_it(project, tmp_path):
    _, roots = open_pipeline(project / "pipelines" / "smoke.toml", tmp_path / "data")

    for table in {table for stage in BY_NAME.values() for table in stage.reads}:
        store.write_shard(roots.data, table, SCENE, 0, from_rows(store.LAYOUT[table].spec, []))

    judged = set()
    for base in {}, RELEASED:
        pipeline = written(tmp_path, base)
        before, fixed = prints((pipeline, roots)), set()
        assert prints((written(tmp_path, base), roots)) == before
        for key, value, words in values_of(pipeline):
            if base and key[0] not in ("plan", "task", "filter", "split"):
                continue
            other = changed_by(tmp_path, base, key, value, words)
            if other is None:
                fixed.add(key)
                continue
            sections = SHARED.get(key, {key[0].replace("task", "filter")})
            expected = ALL if sections & {"seed", "embodiment"} else sections - UNCOUNTED
            if isinstance(value, Path):
                expected = set()
            if base and ("filter" in sections or key == ("split", "prefer_harder")):
                expected = expected | {"plan"}
            assert changed(before, prints((other, roots))) == expected, key
            judged.add(key)
        # What contradicts another section whatever it says is changed with the other base.
        assert fixed == ({("split", "paper_counts")} if base else {("plan", "search")})
    assert len(judged) > 100
    assert {key[0] for key in judged} >= ALL - {"build-scenes"} | {"seed", "embodiment", "camera", "task"}
