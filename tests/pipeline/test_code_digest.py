"""Fingerprints follow the code: a source counts for the stages whose work imports it, and for no other."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from support import court

import aerialdojo_gen
from aerialdojo_gen.base.config.pipeline import load_pipeline
from aerialdojo_gen.base.config.sections import AnchorSampleConfig, ReferenceImagesConfig, RenderConfig
from aerialdojo_gen.benchmark.evaluation import agent_code_digest
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.pipeline import code_digest
from aerialdojo_gen.pipeline.code_digest import code_of, stage_code
from aerialdojo_gen.pipeline.freshness import is_fresh
from aerialdojo_gen.pipeline.registry import BY_NAME, STAGES
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import CHOSEN_ANCHORS
from aerialdojo_gen.store.tables import from_rows

NAMES = [stage.name for stage in STAGES]
SOURCES = Path(aerialdojo_gen.__file__).parent
ALL = set(NAMES)
PICTURES = {"reference-images", "render"}
# One file a room, and what an edit of it makes stale.
STALE = {
    "cli/stages.py": set(),
    "studio/show/figure.py": set(),
    "exchange/exporting.py": set(),
    "learning/network.py": set(),
    "benchmark/report.py": set(),
    "dataset/card.py": set(),
    "imports/import_mesh.py": set(),
    "pipeline/runner.py": set(),
    "pipeline/registry.py": set(),
    "pipeline/stages/work/filter.py": {"filter"},
    "pipeline/stages/work/candidate_policy.py": {"plan", "split"},
    "pipeline/scoring/geometric.py": {"anchor-sample"},
    "annotations/relations.py": {"annotate-import", "describe"},
    "annotations/language/grammar.toml": {"describe"},
    "annotations/language/sides.py": {"describe", "split"},
    "annotations/places/U_Mall.toml": {"annotate-import", "describe"},
    "planning/hybrid_astar.py": {"plan"},
    "rendering/gl_shaders.py": PICTURES,
    "rendering/codecs.py": {"render"},
    "scenes/kit/rail.py": {"build-scenes"},
    "scenes/glb.py": ALL,
    "geometry/motion.py": {"plan"},
    "store/staging.py": set(),
    "store/tables.py": ALL,
    "base/errors.py": set(),
    "base/config/sections.py": set(),
    "base/rng.py": ALL,
}
# It prints the digests of the package as it is now, then with a comment at the end of each file that the input names,
# and which parts of each are others. A comment changes no imports: their graph is built once.
SCRIPT = """
import json, sys
from pathlib import Path
from aerialdojo_gen.pipeline import code_digest as code
from aerialdojo_gen.pipeline.registry import STAGES
def codes():
    code.code_of.cache_clear()
    code._source_digest.cache_clear()
    return {stage.name: code.stage_code(stage.name) for stage in STAGES}
before, folder = codes(), Path(code.__file__).parents[1]
for line in sys.stdin:
    with (folder / line.strip()).open("a") as file:
        file.write("\\n# A comment.\\n")
after = codes()
changed = {name: [*dict(after[name].parts.items() - before[name].parts.items())] for name in before}
print(json.dumps([*({name: code.digest for name, code in all.items()} for all in (before, after)), changed]))
"""


def test_a_source_makes_stale_what_imports_it_and_nothing_else(tmp_path):
    copy = tmp_path / "aerialdojo_gen"
    shutil.copytree(SOURCES, copy, ignore=shutil.ignore_patterns("kernels"))
    env = {**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    run = subprocess.run([sys.executable, "-c", SCRIPT], input="\n".join(STALE), cwd=tmp_path, env=env, text=True,
                         capture_output=True, check=True)  # fmt: skip
    before, after, changed = json.loads(run.stdout)
    assert before == {name: stage_code(name).digest for name in NAMES}, "a copy elsewhere has other digests"
    parts = {
        path: f"aerialdojo_gen.{path[:-3].replace('/', '.')}" if path.endswith(".py") else path for path in STALE
    }
    assert {path: {name for name in NAMES if parts[path] in changed[name]} for path in STALE} == STALE
    assert all(before[name] != after[name] for name in NAMES)


def test_what_is_imported_by_a_name_is_listed():
    """A graph of imports cannot see it: every call of `import_module` stands in the table."""
    calls = set()
    for path in SOURCES.rglob("*.py"):
        text = path.read_text()
        if "import_module" not in text and "__import__" not in text:
            continue
        called = {ast.unparse(node.func) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)}
        if called & {"importlib.import_module", "import_module", "__import__"}:
            name = ".".join(path.relative_to(SOURCES).with_suffix("").parts)
            calls.add(name.removesuffix(".__init__"))
    assert calls == set(code_digest.BY_NAME)
    parts = stage_code("build-scenes").parts
    for folder in ("scenes/kit", "scenes/builders"):
        for path in (SOURCES / folder).rglob("*.py"):
            if path.stem != "__init__":
                assert ".".join(("aerialdojo_gen", *path.relative_to(SOURCES).with_suffix("").parts)) in parts


def test_what_is_cut_or_kept_exists():
    for name in (*code_digest.CUT, *code_digest.KEPT, *code_digest.DATA_FILES):
        path = SOURCES.joinpath(*name.split("."))
        assert path.is_dir() or path.with_suffix(".py").is_file(), name
    named = {
        pattern: {*SOURCES.glob(pattern)} for patterns in code_digest.DATA_FILES.values() for pattern in patterns
    }
    assert all(named.values()), named
    assert {*SOURCES.glob("annotations/**/*.toml")} <= set().union(*named.values())


def test_another_number_of_shards_or_another_source_makes_a_scene_stale(project, smoke, tmp_path):
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


def test_libraries_that_shape_the_bytes_count():
    libraries = {name: set(stage_code(name).libraries) for name in NAMES}
    assert {"numpy", "scipy", "shapely", "cv2", "pyarrow"} <= libraries["build-scenes"]
    assert {"numba", "fcl", "numpy", "pyarrow"} <= libraries["plan"]
    assert {"moderngl", "pybullet", "av", "cv2"} <= libraries["render"]
    assert not {"av", "moderngl", "pybullet"} & libraries["filter"]
    assert all("trimesh" not in found for found in libraries.values())
    assert not {"av", "moderngl", "pybullet", "embreex"} & libraries["split"]
    assert all(not {"pydantic", "tqdm", "typer", "gymnasium"} & found for found in libraries.values())
    for name in NAMES:
        assert all(re.search(r" \d+(\.\d+)+", version) for version in stage_code(name).libraries.values()), name
    assert "llvmlite" in stage_code("plan").libraries["numba"]


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
    idle = BY_NAME[stage].idle(SECTIONS[stage](**section))
    assert set(stage_code(stage, idle).libraries) & EXTRAS == extras


# It runs the stages of the court as the commands do, and prints what has been imported.
IMPORTS = """
import sys
from pathlib import Path
from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.config.sections import ReferenceImagesConfig
from aerialdojo_gen.pipeline import options, registry, runner, stage
data = Path(sys.argv[1])
stages = [registry.BY_NAME[name] for name in ("anchor-sample", "reference-images")]
pipeline = Pipeline(**{"reference-images": ReferenceImagesConfig(width=64, height=64, renderer="gl")})
runner.run(stages, ["U_Court_0"], pipeline, stage.ProjectPaths(data, data, data, data),
           options=options.RunOptions(workers=1, force=frozenset(s.name for s in stages)))
print(*sys.modules)
"""


def test_what_is_idle_is_not_imported(project, tmp_path):
    court.write_inputs(tmp_path)
    store.write_shard(tmp_path, "chosen_anchors", court.SCENE, 0, from_rows(CHOSEN_ANCHORS, []))
    run = subprocess.run(
        [sys.executable, "-c", IMPORTS, tmp_path], cwd=project, capture_output=True, text=True, check=True
    )
    imported = set(run.stdout.split())
    assert "aerialdojo_gen.pipeline.scoring.views" in imported
    assert store.count_rows(tmp_path, "references", court.SCENE) == 3
    for stage, given in (("anchor-sample", {}), ("reference-images", {"renderer": "gl"})):
        idle = BY_NAME[stage].idle(SECTIONS[stage](**given))
        assert len(idle) == 2
        assert not imported & set(idle)


def test_an_evaluation_counts_the_agents_code(tmp_path, monkeypatch):
    assert agent_code_digest("random") == agent_code_digest("stop") != agent_code_digest("explorer")
    assert "aerialdojo_gen.benchmark.report" not in code_of("aerialdojo_gen.benchmark.worker").parts
    mine = tmp_path / "my_agent_of_digest.py"
    mine.write_text("A = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    before = agent_code_digest("my_agent_of_digest:Agent")
    mine.write_text("A = 22\n")
    assert agent_code_digest("my_agent_of_digest:Agent") != before
