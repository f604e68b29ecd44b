"""Every block of code in README, docs and the notebook runs on the smoke data with what `make env` installs.

What does not has its reason in a table here; what needs more packages stands below the command that installs them.
"""

import dataclasses
import importlib.util
import json
import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import trimesh
from support import foreign, task_files
from support.doc_blocks import blocks, commands, is_shell
from support.plain_install import as_script, plain_site, run_plain

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS, Goal, Observation, Rules
from aerialdojo_gen.store import shards
from aerialdojo_gen.store.schemas import ACTION_NAMES

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]

# What cannot run on the smoke data, by what its text fits; a test named in a reason is one that runs it.
NOT_RUN = {
    r"make (dataset|evaluate|gallery|bench|fuzz|torture|nightly|test|test-fast|lint|lock|docs|torch)\b.*":
        "takes minutes to hours",
    r"make smoke": "is what made the data that all this runs on",
    r"(\S*/)?(uv )?pip install .*": "installs packages",
    r"train .*|evaluate --agent policy .*|report (small|ood-before) .*|tensorboard .*": "needs the "
    "extra train: tests/learning/test_training.py does",
    r"(annotate|view|fly) .*|build-scenes --watch .*": "serves until Ctrl-C: "
    "tests/studio/test_annotate_tool_browser.py, tests/studio/test_view_page.py, tests/studio/test_plan_page.py, "
    "tests/studio/test_fly.py",
    r"report human-.*": "scores what a person flew: tests/studio/test_fly.py",
    r"run my-scenes/.*": "runs in tests/imports/test_own_scene.py",
    r"add-scene \S+ (odm_|city\.).*": "reads a scan, a city: tests/imports/test_cuts.py and "
    "tests/imports/test_surfaces.py make some",
    r"report qwen .*": "scores what a language model flew: tests/benchmark/test_goal.py",
    r"evaluate --preset .*": "asks a language model: tests/benchmark/test_llm_evaluate.py does, of its own server",
    r"annotate-draft .* --rewrite .*": "asks a language model: tests/studio/test_rewrite.py does, of its own server",
    r"evaluate --agent clip .*": "needs a CLIP model: tests/benchmark/test_clip_heuristic.py makes a small one",
    r"vllm .*|docker .*|helm .*|kubectl .*": "needs what is not of this project",
    r".*(s3://|AWS_).*": "needs an object store: tests/store/test_readers_on_s3.py has one",
    r"sudo .*|python3.11 -m venv .*|git .*|ray .*|RAY_USAGE.*|.*--executor ray.*": "makes a cluster: "
    "tests/pipeline/test_ray_cluster.py has one",
    r"export .?HF_TOKEN.*|push-to-hub .*|pull .*|validate --data pulled .*": "asks a hub: "
    "tests/exchange/test_hub.py has one",
    r"vary .*|run my-worlds/.*": "makes worlds: tests/imports/test_vary.py",
    r"(add-map|add-terrain) .*": "needs an extract or a height model: tests/imports/test_add_map.py, "
    "tests/imports/test_add_terrain.py",
    r"validate --release DOWNLOADED .*": "runs in tests/dataset/test_validate_release.py, on a release "
        "that lies elsewhere",
    r"cp -al .*|rm -r .*|run pipelines/aerialdojo-hard.toml .*": "plans 42 scenes: "
    "tests/pipeline/test_filter.py has its limits",
    r"import-benchmark exports/.*": "runs in tests/exchange/test_export_roundtrip.py",
}  # fmt: skip
# Whole blocks that are a script or a file, not commands one by one.
SCRIPTS = {
    "#!/bin/bash": "a batch script for SLURM",
    "FROM python": "an image for a cluster",
    "helm repo add": "needs Kubernetes",
}
# What stands for what on the smoke data, in this order: its scenes, a task of its own, less to draw.
ON_SMOKE = (
    (r"pipelines/aerialdojo-200k\.toml", "pipelines/smoke.toml"),
    (r"\b[UNID]_[A-Z][A-Za-z]+_([01*])(?!-)", r"U_Courtyard_\1"),
    (r"\bI_Harbor_0-[0-9a-f]{12}-s\b", "TASK"),
    (r"^(add-scene .*)", r"\1 --force"),
    (r"^((?:stats|validate|show)\b.*) --data data-smoke\b", r"\1"),
    (r"--split id_train (.*--estimate)", r"--split train \1"),
    (r"\bTASK_ID\b", "TASK"),
    (r"^(show TASK --out task\.png)$", r"\1 --html task.html"),
    (r"^validate --json\b", "validate --json --no-meshes"),
    # Recorded for training they would take the place of those that the page's blocks read.
    (r"^(render .*--profile training)", r"\1 --estimate"),
    (r"^(render .*)--limit [03](?!.*--estimate)", r"\1--limit 1"),
    (r"^(render .*--light random)", r"\1 --limit 1"),
    (r"^(evaluate .*)--limit [24]0", r"\1--limit 2"),
    (r"^(evaluate .*(?:--split id_test|--modality semantic))$", r"\1 --limit 2"),
)  # fmt: skip
WITH_WORKERS = ("run", "plan", "render", "evaluate", "validate", "filter", "split")
PYTHON_ELSEWHERE = {"CONTRIBUTING.md": "tests/pipeline/test_new_stage.py"}
# What a page speaks of and does not make, and what a command of another page made.
BEFORE = {
    "recordings.md": "folder = next(__import__('pathlib').Path('data/media').glob('*/*'))",
    "api.md": "__import__('pathlib').Path('mine.toml').unlink()",
}
# What is only shown by prints, or as the last value of a notebook's cell, is held to something here.
AFTER = {
    "first_look.ipynb": "assert rgb.shape[2] == 3 and len(recording) > 1 and info['reason']",
    "api.md": """
assert planned.outcome == "SOLVED"
assert abs(planned.length_m - route["length_m"]) < 1e-9
assert list(planned.actions) == route["action"]
assert (first.outcome, second.outcome) == ("SOLVED", "SOLVED") or second.outcome != ""
assert picture.shape[2] == 3 and shot.rgb.shape == (240, 320, 3)
assert set(tasks["split"]) == {"id_test"} and len(routes) > 100
assert summary.stage == "filter" and summary.computed == 0
assert len(recording) == recording.rgb["front"].__len__() > 1
assert observation["rgb"]["front"].shape == (64, 64, 3)
assert pipeline.filter.min_detour_ratio == 1.2
assert load_pipeline("mine.toml").filter == pipeline.filter
try:
    release.task("U_Courtyard_0-0123456789ab-s")
except AerialDojoError as error:
    assert "did you mean" in str(error) or "the nearest is" in str(error)
""",
    "torch_dataset.py": """
import sys
sys.path.insert(0, "examples")
from torch_dataset import Poses
from aerialdojo_gen import open_release

poses, release = Poses("data", "id_train"), open_release("data")
assert len(poses.nav_ids) == len(set(poses.nav_ids)) > 0
for nav_id, end in zip(poses.nav_ids, poses.ends):
    route, last = release.task(nav_id).route, poses[end - 1]
    assert last["action"] == 0 and [*poses.actions[nav_id]] == list(route["agent_action"])
    assert last["text"].startswith(release.task(nav_id).instances[0]["target_name"])
    seen = release.recording(nav_id)
    k = len(route["agent_action"]) - 1
    assert (last["rgb"] * 255 == seen.rgb["front"][k].transpose(2, 0, 1)).all()
    assert last["depth_m"].shape == (1, *seen.depth_m["front"][k].shape)
assert len(poses) > 10
""",
}


def scripts():
    """What of Python stands in a page or the notebook, and what a page tells to install above it, by its name."""
    for page in PAGES:
        found = [block for block in blocks(page) if block.language == "python" and not lacks_an_extra(block.text)]
        if found and page.name not in PYTHON_ELSEWHERE:
            above = "".join(page.read_text(encoding="utf-8").splitlines(keepends=True)[: found[-1].line])
            yield page.name, (above, "\n".join(block.text for block in found))
    document = json.loads((ROOT / "examples/first_look.ipynb").read_text(encoding="utf-8"))
    cells = [cell for cell in document["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 6
    assert not any(cell["outputs"] for cell in cells)
    yield "first_look.ipynb", ("", "\n".join("".join(cell["source"]) for cell in cells))
    yield "torch_dataset.py", ("", "")


def lacks_an_extra(text):
    """Whether a block imports what no environment has to have, and it is not installed."""
    named = {"from torch": "torch", "from lerobot": "lerobot", "import webdataset": "webdataset"}
    return any(said in text and importlib.util.find_spec(name) is None for said, name in named.items())


PYTHON = dict(scripts())


@pytest.fixture(scope="module")
def folder(smoke, tmp_path_factory):
    """A working directory as README's reader has it, the smoke data in place of the whole dataset."""
    place = tmp_path_factory.mktemp("reader")
    shutil.copytree(smoke, place / "data")
    shutil.copytree(smoke, place / "data-smoke")
    for name in ("pipelines", "scene_assets", "annotations", "examples"):
        (place / name).symlink_to(ROOT / name)
    village = foreign.village()
    village.apply_transform(trimesh.transformations.rotation_matrix(-3.141592653589793 / 2, [1, 0, 0]))
    village.export(place / "campus.glb")
    village.apply_scale(100.0)
    village.export(place / "campus.obj")
    task_files.write(place / "train.json", task_files.openfly())
    # Its last section is that of recordings.
    text = (ROOT / "pipelines/smoke.toml").read_text(encoding="utf-8").replace('"../', f'"{ROOT}/')
    (place / "small.toml").write_text(text + "width = 64\nheight = 64\n")
    return place


def shell_commands():
    """Each command once, with the first place where it stands."""
    found = {}
    for page in PAGES:
        for block in blocks(page):
            if is_shell(block) and not block.text.startswith(tuple(SCRIPTS)):
                for command in commands(block):
                    found.setdefault(command.removeprefix("aerialdojo-gen "), block.place)
    return found


def reason(command):
    return next((why for text, why in NOT_RUN.items() if re.fullmatch(text, command)), None)


def on_smoke(command, task_id):
    for text, stands in ON_SMOKE:
        command = re.sub(text, stands, command)
    words = shlex.split(command.replace("TASK", task_id))
    words += ["--workers", "1"] if words[0] in WITH_WORKERS else []
    return words + (["--pipeline", "small.toml"] if words[0] == "render" else [])


def test_blocks_are_told_apart(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "Text\n\n    make smoke      # a comment\n"
        "    aerialdojo-gen plan \\\n        --scene 'U_*'\n\n    pip x && make lint\n"
        "\n```python\nx = 1\n\n    y = 2\n```\n\n- a list\n  with a line\n\n    data/\n      release/\n"
        "\n1. a list with a command\n\n        make docs\n\n    and more of it\n"
    )
    found = blocks(page)
    assert [(block.language, block.line, is_shell(block)) for block in found] == [
        ("indented", 3, True), ("python", 10, False), ("indented", 18, False),
        ("indented", 23, True),
    ]  # fmt: skip
    assert list(commands(found[3])) == ["make docs"]
    assert list(commands(found[0])) == ["make smoke", "aerialdojo-gen plan --scene 'U_*'", "pip x", "make lint"]
    assert found[1].text == "x = 1\n\n    y = 2\n"


def test_no_reason_is_left_over_and_what_it_names_is_there():
    every = shell_commands()
    for text, why in NOT_RUN.items():
        assert any(re.fullmatch(text, command) for command in every), f"no block has {text}: {why}"
        for path in re.findall(r"tests/\w+/\w+\.py", why):
            assert (ROOT / path).is_file(), path
    scripts = [block.text for page in PAGES for block in blocks(page)]
    for begin in SCRIPTS:
        assert any(text.startswith(begin) for text in scripts), begin
    for page, where in PYTHON_ELSEWHERE.items():
        assert page in (ROOT / where).read_text(encoding="utf-8")


# One process calls all commands and then runs the pages that need no more packages, each in a namespace of its own: a
# process each would cost a second.
CALLS = """
import io, json, sys, traceback
from contextlib import redirect_stderr, redirect_stdout
from aerialdojo_gen.cli import app as cli

def called(words):
    sys.argv, err = ["aerialdojo-gen", *words], io.StringIO()
    with redirect_stdout(io.StringIO()), redirect_stderr(err):
        try:
            cli.main()
        except SystemExit as ended:
            return int(ended.code or 0), err.getvalue()
        except Exception as error:
            return -1, repr(error)
    return 0, err.getvalue()

def run(text):
    with redirect_stdout(io.StringIO()):
        try:
            exec(text, {"__name__": "page"})
        except Exception:
            return traceback.format_exc()
    return ""

calls, pages = json.load(open("calls.json"))
print(json.dumps([[called(words) for words in calls], [run(text) for text in pages]]))
"""


def installed(text):
    """The extras and the packages that a text tells to install."""
    words = " ".join(re.findall(r"pip install ([^`\n]*)", text)).split()
    extras = re.findall(r"(?:aerialdojo-gen|\.)\[([\w,]+)\]", " ".join(words))
    packages = (word for word in words if re.fullmatch(r"[a-z][\w-]+", word))
    return frozenset(",".join(extras).split(",")) - {""}, frozenset(packages)


@pytest.fixture(scope="module")
def ran(folder, tmp_path_factory):
    """Every command that has no reason, run once in the pages' order: where it stands, exit code, what it said.

    And what went wrong in every page's blocks, run one after the other on what the commands have made.
    """
    task_id = shards.read_scene(folder / "data", "tasks/test", "U_Courtyard_0")["task_id"][0].as_py()
    calls = {
        ("evaluate", "--agent", agent, "--run", run, "--limit", "4", "--workers", "1"): None
        for run, agent in (("mine", "oracle"), ("theirs", "constant"))
    }
    asked = {
        command: (place, tuple(on_smoke(command, task_id)))
        for command, place in shell_commands().items()
        if reason(command) is None
    }
    calls |= dict.fromkeys(words for _, words in asked.values())
    (folder / "calls.py").write_text(as_script(CALLS))
    results, wrong = {}, {}
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("AERIALDOJO_DATA", raising=False)
        for needed in sorted(
            {installed(above) for above, _ in PYTHON.values()}, key=lambda needed: sum(map(len, needed))
        ):
            names = [name for name, (above, _) in PYTHON.items() if installed(above) == needed]
            texts = ["\n".join((BEFORE.get(name, ""), PYTHON[name][1], AFTER.get(name, ""))) for name in names]
            given = [] if results else [*calls]
            (folder / "calls.json").write_text(json.dumps([given, texts]))
            site = plain_site(tmp_path_factory.mktemp("packages") / "site", *needed)
            ended, said = json.loads(run_plain(site, folder / "calls.py", folder))
            results |= zip(given, ended, strict=True)
            wrong |= zip(names, said, strict=True)
    return {command: (place, *results[words]) for command, (place, words) in asked.items()}, wrong


def test_every_shell_block_runs_on_the_smoke_data(ran):
    commands, _ = ran
    failed = [
        f"{place}: {name}: exit code {code}: {err[-300:]}" for name, (place, code, err) in commands.items() if code
    ]
    assert not failed, "\n".join([*failed, "make them run, or give them a line with a reason in NOT_RUN"])
    assert len(commands) > 25


@pytest.mark.parametrize("name", PYTHON)
def test_every_python_block_runs_on_the_smoke_data(ran, name):
    assert ran[1][name] == ""


def test_git_ignores_what_readme_and_docs_suggest_to_write(tmp_path):
    """Where they are called, in the checkout: nothing of it is to be committed by mistake."""
    options = re.compile(r"--(?:out|html|markdown|csv|figures|report|data|log)[ =](\S+)")
    suggested = set()
    for command in shell_commands():
        suggested |= {path for path in options.findall(command) if "://" not in path and not path.startswith("/")}
        suggested |= set(re.findall(r"^config init (\S+)", command))
    suggested -= {"DIR", "docs/gallery"}
    assert {"exports/aerialdojo", "stats.md", "figures/", "task.png", "mine.toml", "data-smoke"} <= suggested
    shutil.copy(ROOT / ".gitignore", tmp_path)
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    # A folder is known by its slash, for there is none.
    folders = {name if Path(name).suffix else f"{name.rstrip('/')}/" for name in suggested}
    names = sorted({*folders, "my-scenes/pipeline.toml", "pictures/x.jpg", "U_Mall_0-6c9aa88ae4fc-s.png"})
    done = subprocess.run(["git", "check-ignore", "--", *names], cwd=tmp_path, capture_output=True, text=True)
    assert set(names) - set(done.stdout.splitlines()) == set()


def test_every_toml_block_is_what_a_pipeline_may_say():
    # Plans of scenes, and the parts of one in docs/plans.md, are built by tests/scenes/test_plans.py.
    found = [block for page in PAGES if page.name != "plans.md" for block in blocks(page) if block.language == "toml"]
    for block in (block for block in found if "plan = 1" not in block.text):
        Pipeline.model_validate(tomllib.loads(block.text))


def test_the_page_of_agents_has_the_one_of_examples_the_actions_and_every_field_that_an_agent_is_told():
    text = (ROOT / "docs/agent.md").read_text(encoding="utf-8")
    code = (ROOT / "examples/seeker.py").read_text(encoding="utf-8")
    assert code in [block.text for block in blocks(ROOT / "docs/agent.md")]
    assert sum(bool(line.strip()) for line in code.splitlines()) <= 40
    cells = re.findall(r"\| (\d+) \| ([A-Z]\w+)(?: (\d+)[ °m]*)?", text)
    assert {int(k): name + size for k, name, size in cells} == dict(enumerate(ACTION_NAMES[:N_ACTIONS]))
    for told in (Goal, Rules, Observation):
        for one in dataclasses.fields(told):
            assert re.search(rf"`\.?{one.name}`", text), one.name
