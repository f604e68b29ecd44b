"""A shard's fingerprint beside the code: whatever its rows depend on changes it, and nothing else does."""

import dataclasses
import json
import shutil

import pyarrow.parquet as pq
import pytest

from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.pipeline import fingerprint
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.store import shards as store

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
    return {name: fingerprint.scene_fingerprint(stage, *opened, SCENE) for name, stage in BY_NAME.items()}


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
    files = fingerprint.paper_figures.files()
    copies = [shutil.copy(path, tmp_path / path.name) for path in files]
    monkeypatch.setattr(fingerprint.paper_figures, "files", lambda: copies)
    assert prints(opened) == before, "a checkout elsewhere"
    copies[-1].write_bytes(copies[-1].read_bytes() + b"\n")
    assert changed(before, prints(opened)) == {"annotate-import", "plan", "split"}


@pytest.mark.parametrize("table", ["pairs", "plans"])
def test_schemas_count_for_who_writes_and_who_reads_them(opened, monkeypatch, table):
    before = prints(opened)
    place = store.LAYOUT[table]
    other = dataclasses.replace(place, spec=dataclasses.replace(place.spec, plain=(*place.spec.plain, "scene")))
    monkeypatch.setitem(store.LAYOUT, table, other)
    fingerprint._schemas.cache_clear()
    after = prints(opened)
    fingerprint._schemas.cache_clear()
    touched = {name for name, stage in BY_NAME.items() if table in (*stage.reads, *stage.writes)}
    assert changed(before, after) == touched
