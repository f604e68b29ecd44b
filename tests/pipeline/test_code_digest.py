"""Fingerprints follow the code: what it does changes them, what is said about it does not."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import aerialdojo_gen
from aerialdojo_gen.base.config.pipeline import load_pipeline
from aerialdojo_gen.base.config.sections import AnchorSampleConfig, ClipConfig, ReferenceImagesConfig, RenderConfig
from aerialdojo_gen.benchmark.evaluation import agent_code_digest
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.pipeline import code_digest
from aerialdojo_gen.pipeline.code_digest import PLUMBING, Package, code_of, stage_code
from aerialdojo_gen.pipeline.code_facts import module_facts
from aerialdojo_gen.pipeline.fingerprint import _values
from aerialdojo_gen.pipeline.freshness import is_fresh
from aerialdojo_gen.pipeline.registry import BY_NAME, STAGES
from aerialdojo_gen.pipeline.stage import work_module

NAMES = [stage.name for stage in STAGES]
SOURCES = Path(aerialdojo_gen.__file__).parent
# A module that the stage uses by way of others, and a constant of it.
USED = {
    "build-scenes": ("scenes/layouts/urban/courtyard/layout.py", None),
    "annotate-import": ("annotations/relations.py", None),
    "anchor-sample": ("geometry/viewpoints.py", None),
    "reference-images": ("rendering/gl_shaders.py", "#version 400 core"),
    "pair-objects": ("store/tables.py", '"ascending"'),
    "plan": ("geometry/motion.py", None),
    "filter": ("base/constants.py", '"long_horizon"'),
    "split": ("pipeline/stages/work/quota.py", None),
    "render": ("rendering/codecs.py", None),
}


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the package's sources, with what reading them gave before."""
    folder = tmp_path_factory.mktemp("copy") / "aerialdojo_gen"
    for path in [*SOURCES.rglob("*.py"), *SOURCES.rglob("*.toml"), *SOURCES.glob("__pycache__/code-facts.json")]:
        target = folder / path.relative_to(SOURCES)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    return folder


def digests(folder):
    package = Package(folder)
    return {name: package.of(work_module(name)).digest for name in NAMES}


def edited(path, old, new):
    """What the stages' digests are while a source is another; it is put back."""
    text = path.read_text()
    assert old in text, (path, old)
    path.write_text(text.replace(old, new, 1))
    try:
        return digests(path.parents[len(path.parts) - path.parts.index("aerialdojo_gen") - 2])
    finally:
        path.write_text(text)


def changed(before, after):
    return {name for name in NAMES if before[name] != after[name]}


def test_a_copy_elsewhere_has_the_same_digests(copied):
    assert digests(copied) == {name: stage_code(name).digest for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_a_line_in_the_stages_own_module_makes_it_stale(copied, name):
    before = digests(copied)
    path = copied / "pipeline" / "stages" / "work" / f"{name.replace('-', '_')}.py"
    run = re.search(r"^def run\(.*?\n    \"\"\"(.*?)\"\"\"\n", path.read_text(), re.DOTALL | re.MULTILINE)
    assert changed(before, edited(path, run[0], run[0] + "    raise RuntimeError\n")) == {name}
    assert changed(before, edited(path, "\n\n", "\nNEW = 1\n\n")) == {name}
    # What is said: a comment, other blank lines, another docstring.
    assert edited(path, run[0], "\n\n" + run[0] + "    # A comment.\n\n") == before
    assert edited(path, run[1], "Something else.") == before


@pytest.mark.parametrize("name", NAMES)
def test_a_constant_of_a_module_that_it_uses_makes_it_stale(copied, name):
    relative, constant = USED[name]
    path = copied / relative
    if constant is None:
        # The first number that is given a name.
        constant = re.search(r"^_?[A-Z][A-Z_0-9]*(?:: .*)? = .*?\d.*$", path.read_text(), re.MULTILINE)[0]
        other = re.sub(r"\d(?=\D*$)", lambda digit: str((int(digit[0]) + 1) % 10), constant)
    else:
        other = constant[:-1] + "x" + constant[-1]
    before, after = digests(copied), edited(path, constant, other)
    assert name in changed(before, after)
    assert (
        edited(path, constant, "# Nothing.\n" + constant if "\n" + constant in path.read_text() else constant)
        == before
    )


@pytest.mark.parametrize(
    "relative",
    [
        "cli/stages.py",
        "pipeline/progress.py",
        "pipeline/runner.py",
        "benchmark/report.py",
        "dataset/card.py",
        "base/cli_context.py",
    ],
)
def test_messages_and_plumbing_make_nothing_stale(copied, relative):
    assert edited(copied / relative, "\n\n", "\nSAID = 'another message'\n\n") == digests(copied)


def test_plumbing_is_what_it_is_said_to_be():
    """Modules that exist, of rooms that only move rows or serve the user; of few of them anything counts."""
    assert {name.split(".")[1] for name in PLUMBING if "." in name} == {
        "base", "benchmark", "learning", "pipeline", "store",
    }  # fmt: skip
    assert not [
        name
        for name in PLUMBING
        if name.startswith(("aerialdojo_gen.pipeline.scoring", "aerialdojo_gen.pipeline.stages.work."))
    ]
    assert {name: counted for name, counted in PLUMBING.items() if counted} == {
        "aerialdojo_gen.base.constants": ("*",),
        "aerialdojo_gen.pipeline.stage": ("Job",),
        "aerialdojo_gen.store.layout": ("partition", "check_scene_name"),
        "aerialdojo_gen.store.parquet_files": ("write_clustered",),
        "aerialdojo_gen.store.schemas": ("*",),
        "aerialdojo_gen.store.schemas.benchmark": ("*",),
        "aerialdojo_gen.store.schemas.columns": ("*",),
        "aerialdojo_gen.store.schemas.staged": ("*",),
        "aerialdojo_gen.store.schemas.release": ("*",),
    }
    for name, counted in PLUMBING.items():
        known = code_digest._running().facts(name)
        assert set(counted) - {"*"} <= set(known.definitions), name


def test_an_edit_of_a_table_counts_for_who_uses_it(copied):
    before = digests(copied)
    staged, benchmark = copied / "store" / "schemas" / "staged.py", copied / "store" / "schemas" / "benchmark.py"
    assert edited(staged, "VERDICTS = table(\n", "VERDICTS = table(  # here\n") == before
    # `verdicts` is written by filter; split copies its rows by the names of others' columns.
    after = edited(staged, 'VERDICTS = table(\n    "verdicts"', 'VERDICTS = table(\n    "verdictz"')
    assert changed(before, after) == {"filter"}
    after = edited(benchmark, 'EPISODES = table(\n    "episodes"', 'EPISODES = table(\n    "episodez"')
    assert after == before, "evaluate's tables are no stage's"


def test_the_table_of_stages_and_its_hooks_count_by_what_they_return(copied):
    """The number of shards and the source files are compared themselves; help, checks and choices shape no rows."""
    before = digests(copied)
    hooks = copied / "pipeline" / "stages" / "hooks.py"
    assert edited(hooks, "// config.targets_per_part", "// 2") == before
    assert edited(hooks, "config.paper_counts", "not config.paper_counts") == before
    assert edited(copied / "pipeline" / "registry.py", "Plan a collision-free", "Plan another") == before
    assert edited(copied / "rendering" / "resolve_config.py", "report(choice.why)", "pass") == before


def test_another_number_of_shards_or_another_source_makes_a_scene_stale(project, smoke, tmp_path, monkeypatch):
    config, roots = open_pipeline(load_pipeline(project / "pipelines" / "smoke.toml"), smoke)
    plan, build = BY_NAME["plan"], BY_NAME["build-scenes"]
    assert is_fresh(plan, config.section("plan"), "U_Courtyard_0", config, roots)
    more = replace(plan, parts=lambda *given: plan.parts(*given) + 1)
    assert not is_fresh(more, config.section("plan"), "U_Courtyard_0", config, roots)
    other = tmp_path / "other.toml"
    other.write_text("")
    moved = replace(build, sources=lambda *given: [*build.sources(*given), other])
    assert is_fresh(build, config.section("build-scenes"), "U_Courtyard_0", config, roots)
    assert not is_fresh(moved, config.section("build-scenes"), "U_Courtyard_0", config, roots)


def test_what_is_imported_by_a_name_made_at_run_time_counts():
    parts = stage_code("build-scenes").parts
    for folder in ("scenes/layouts", "scenes/builders"):
        paths = [path for path in (SOURCES / folder).rglob("*.py") if path.stem != "__init__"]
        assert paths
        for path in paths:
            assert ".".join(("aerialdojo_gen", *path.relative_to(SOURCES).with_suffix("").parts)) in parts


def test_figures_of_the_paper_count_where_they_are_read():
    assert [name for name in NAMES if "aerialdojo_gen.base.paper_figures" in stage_code(name).parts] == [
        "annotate-import",
        "plan",
        "split",
    ]


def test_no_stage_counts_what_only_shows():
    for name in NAMES:
        for part in stage_code(name).parts:
            assert part.split(".")[1] not in ("annotate", "cli", "commands", "exchange", "show", "web"), (name, part)


def test_libraries_that_shape_the_bytes_count():
    libraries = {name: set(stage_code(name).libraries) for name in NAMES}
    assert {"numpy", "scipy", "trimesh", "shapely", "cv2", "pyarrow"} <= libraries["build-scenes"]
    assert {"numba", "fcl", "numpy", "pyarrow"} <= libraries["plan"]
    assert {"moderngl", "pybullet", "av", "cv2"} <= libraries["render"]
    assert not {"av", "moderngl", "pybullet"} & libraries["filter"]
    assert not {"av", "moderngl", "pybullet", "numba", "embreex"} & libraries["split"]
    assert all(not {"pydantic", "tqdm", "typer", "gymnasium"} & found for found in libraries.values())
    for name in NAMES:
        assert all(re.search(r" \d+(\.\d+)+", version) for version in stage_code(name).libraries.values()), name
    assert "llvmlite" in stage_code("plan").libraries["numba"]


def of_section(stage, **section):
    """The code that a stage runs with a configuration, once that is settled."""
    config = SECTIONS[stage](**section)
    return stage_code(stage, None, BY_NAME[stage].idle(config))


SECTIONS = {"anchor-sample": AnchorSampleConfig, "reference-images": ReferenceImagesConfig, "render": RenderConfig}
EXTRAS = {"av", "moderngl", "onnxruntime", "pybullet", "tenacity", "tokenizers"}


@pytest.mark.parametrize(
    ("stage", "section", "extras"),
    [
        ("anchor-sample", {}, set()),
        ("anchor-sample", {"weights": {"clip": 1}}, {"onnxruntime", "tokenizers"}),
        ("anchor-sample", {"weights": {"vlm": 1}}, {"tenacity"}),
        ("reference-images", {"renderer": "gl"}, {"moderngl"}),
        ("reference-images", {"renderer": "pybullet"}, {"pybullet"}),
        ("reference-images", {"renderer": "auto"}, {"moderngl", "pybullet"}),
        ("render", {"renderer": "gl"}, {"av", "moderngl"}),
        ("render", {"renderer": "pybullet"}, {"av", "pybullet"}),
    ],
)
def test_an_extra_that_the_configuration_does_not_use_makes_nothing_stale(stage, section, extras):
    assert set(of_section(stage, **section).libraries) & EXTRAS == extras


def test_what_is_idle_is_not_imported(project, smoke, tmp_path):
    """By Python's own list of imports, of the command and its workers."""
    data = shutil.copytree(smoke, tmp_path / "data")
    python = {**os.environ, "PYTHONPROFILEIMPORTTIME": "1"}
    for stage in ("anchor-sample", "reference-images"):
        idle = BY_NAME[stage].idle(SECTIONS[stage](**({"renderer": "gl"} if stage == "reference-images" else {})))
        told = subprocess.run(
            [sys.executable, "-m", "aerialdojo_gen.cli", stage, "U_Courtyard_0", "--pipeline", "pipelines/smoke.toml",
             "--data", str(data), "--force", "--workers", "1"],
            cwd=project, env=python, capture_output=True, text=True, check=True,
        )  # fmt: skip
        imported = {line.rpartition("|")[2].strip() for line in told.stderr.splitlines() if "|" in line}
        assert "aerialdojo_gen.pipeline.scoring.views" in imported
        assert len(idle) == 2
        assert not imported & set(idle)


def test_imports_are_followed_however_they_are_written():
    source = b"""
from __future__ import annotations
import importlib
from typing import TYPE_CHECKING
import numpy as np
from . import near
from .. import far as away
from ..geometry.rays import RayCaster
from aerialdojo_gen import store
if TYPE_CHECKING:
    from aerialdojo_gen.studio.show import page
def f():
    from aerialdojo_gen.base.rng import generator
    importlib.import_module(f"{__name__}.{np.x}")
    importlib.import_module(f"{away.__name__}.{np.x}")
    importlib.import_module("moderngl")
    return store.partition, away.x
"""
    facts = module_facts(source, "aerialdojo_gen.scenes.here", False)
    found = {(edge.module, edge.name) for edge in facts.edges}
    assert {
        ("aerialdojo_gen.scenes", "near"), ("aerialdojo_gen", "far"), ("aerialdojo_gen.geometry.rays", "RayCaster"),
        ("aerialdojo_gen", "store"), ("aerialdojo_gen.base.rng", "generator"), ("aerialdojo_gen.scenes.here", "**"),
        ("aerialdojo_gen.far", "**"), ("moderngl", ""), ("numpy", ""),
    } <= found  # fmt: skip
    assert "page" not in {name for _, name in found}
    assert next(edge.uses for edge in facts.edges if edge.name == "store") == ("partition",)
    assert not facts.unknown
    unknown = module_facts(b"import importlib\nimportlib.import_module(name)\n", "aerialdojo_gen.x", False)
    assert unknown.unknown == ("name",)


def test_an_import_that_cannot_be_told_is_a_defect(copied):
    path = copied / "pipeline" / "stages" / "work" / "filter.py"
    with pytest.raises(
        RuntimeError, match=r"aerialdojo_gen\.pipeline\.stages\.work\.filter imports name: its source does not tell"
    ):
        edited(path, "\n\n", "\nimport importlib\ndef f(name): importlib.import_module(name)\n\n")


@pytest.mark.parametrize("damage", [b"", b"{}", b"null", b"x" * 64 + b"\n{}", None])
def test_a_damaged_cache_is_none(copied, damage):
    cache = copied / "__pycache__" / "code-facts.json"
    before, raw = digests(copied), cache.read_bytes()
    cache.write_bytes(raw[:-1000] + b"f" + raw[-999:] if damage is None else damage)
    package = Package(copied)
    assert package.of(work_module("filter")).digest == before["filter"]
    cache.write_bytes(raw)


def test_absolute_paths_are_in_no_fingerprint(tmp_path):
    clip = ClipConfig(vision=tmp_path / "v", text=tmp_path / "t", tokenizer=tmp_path / "k", sha256="0" * 64)
    values = _values(AnchorSampleConfig(clip=clip))
    assert values["clip"] == {"sha256": "0" * 64}
    assert str(tmp_path) not in str(values)


def test_an_evaluation_counts_the_agents_code(tmp_path, monkeypatch):
    assert agent_code_digest("random") == agent_code_digest("stop") != agent_code_digest("explorer")
    assert "aerialdojo_gen.benchmark.report" not in code_of("aerialdojo_gen.benchmark.worker").parts
    mine = tmp_path / "my_agent_of_digest.py"
    mine.write_text("A = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    before = agent_code_digest("my_agent_of_digest:Agent")
    mine.write_text("A = 22\n")
    assert agent_code_digest("my_agent_of_digest:Agent") != before
