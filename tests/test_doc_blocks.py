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
from functools import cache
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
    (r"^(evaluate .*)--limit [24]0", r"\1--limit 4"),
    (r"^(evaluate .*(?:--split id_test|--modality semantic))$", r"\1 --limit 4"),
)  # fmt: skip
WITH_WORKERS = ("run", "plan", "render", "evaluate", "validate", "filter", "split")
PYTHON_ELSEWHERE = {"api.md": "tests/test_api_page.py", "CONTRIBUTING.md": "tests/pipeline/test_new_stage.py"}
# What a page speaks of and does not make.
BEFORE = {"recordings.md": "folder = next(__import__('pathlib').Path('data/media').glob('*/*'))\n"}


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
    return [*words, "--workers", "1"] if words[0] in WITH_WORKERS else words


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


# One process calls all commands: a process each would cost a second. What they end with and say is a line of JSON.
CALLS = """
import io, json, sys
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

print(json.dumps([called(words) for words in json.load(open("calls.json"))]))
"""


@pytest.fixture(scope="module")
def site_of(tmp_path_factory):
    """Gives the folder of packages that a reader has who has typed the installations of a text."""

    @cache
    def made(extras, packages):
        return plain_site(tmp_path_factory.mktemp("packages") / "site", extras, packages)

    def site(text=""):
        words = " ".join(re.findall(r"pip install ([^`\n]*)", text)).split()
        extras = re.findall(r"(?:aerialdojo-gen|\.)\[([\w,]+)\]", " ".join(words))
        packages = (word for word in words if re.fullmatch(r"[a-z][\w-]+", word))
        return made(frozenset(",".join(extras).split(",")) - {""}, frozenset(packages))

    return site


@pytest.fixture(scope="module")
def ran(folder, site_of):
    """Every command that has no reason, run once in the pages' order: where it stands, exit code, what it said."""
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
    (folder / "calls.json").write_text(json.dumps([*calls]))
    (folder / "calls.py").write_text(as_script(CALLS))
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("AERIALDOJO_DATA", raising=False)
        ended = json.loads(run_plain(site_of(), folder / "calls.py", folder))
    results = dict(zip(calls, ended, strict=True))
    return {command: (place, *results[words]) for command, (place, words) in asked.items()}


def test_every_shell_block_runs_on_the_smoke_data(ran):
    failed = [f"{place}: {name}: exit code {code}: {err[-300:]}" for name, (place, code, err) in ran.items() if code]
    assert not failed, "\n".join([*failed, "make them run, or give them a line with a reason in NOT_RUN"])
    assert len(ran) > 25


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_python_block_runs_on_the_smoke_data(page, folder, site_of, ran):
    """A page's blocks one after the other, in a process of their own, on what its commands have made."""
    found = [block for block in blocks(page) if block.language == "python" and not lacks_an_extra(block.text)]
    if page.name in PYTHON_ELSEWHERE:
        assert found
        assert page.name in (ROOT / PYTHON_ELSEWHERE[page.name]).read_text(encoding="utf-8")
    elif found:
        above = "".join(page.read_text(encoding="utf-8").splitlines(keepends=True)[: found[-1].line])
        text = BEFORE.get(page.name, "") + "\n".join(block.text for block in found)
        run_python(folder, text, site_of(above))


def lacks_an_extra(text):
    """Whether a block imports what no environment has to have, and it is not installed."""
    named = {"from torch": "torch", "from lerobot": "lerobot", "import webdataset": "webdataset"}
    return any(said in text and importlib.util.find_spec(name) is None for said, name in named.items())


def run_python(folder, text, site):
    (folder / "page.py").write_text(as_script(text))
    return run_plain(site, folder / "page.py", folder)


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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_toml_block_is_what_a_pipeline_may_say(page):
    for block in blocks(page):
        # Plans of scenes, and the parts of one in docs/plans.md, are built by tests/scenes/test_plans.py.
        if block.language == "toml" and "plan = 1" not in block.text and page.name != "plans.md":
            Pipeline.model_validate(tomllib.loads(block.text))


def test_the_agent_of_the_page_is_the_one_in_examples_and_has_some_forty_lines():
    code = (ROOT / "examples/seeker.py").read_text(encoding="utf-8")
    assert code in [block.text for block in blocks(ROOT / "docs/agent.md")]
    assert sum(bool(line.strip()) for line in code.splitlines()) <= 40


def test_the_table_of_actions_is_the_action_set():
    text = (ROOT / "docs/agent.md").read_text(encoding="utf-8")
    cells = re.findall(r"\| (\d+) \| ([A-Z]\w+)(?: (\d+)[ °m]*)?", text)
    assert {int(k): name + size for k, name, size in cells} == dict(enumerate(ACTION_NAMES[:N_ACTIONS]))


@pytest.mark.parametrize("told", [Goal, Rules, Observation])
def test_the_page_names_every_field_that_an_agent_is_told(told):
    text = (ROOT / "docs/agent.md").read_text(encoding="utf-8")
    for one in dataclasses.fields(told):
        assert re.search(rf"`\.?{one.name}`", text), one.name


def test_the_notebook_runs(folder, site_of):
    document = json.loads((ROOT / "examples/first_look.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in document["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 6
    assert not any(cell["outputs"] for cell in document["cells"] if cell["cell_type"] == "code")
    # The last value of a cell is what a notebook shows.
    text = "\n".join([*cells, "assert rgb.shape[2] == 3 and len(recording) > 1 and info['reason']"])
    run_python(folder, text, site_of())


def test_the_dataset_for_pytorch_has_every_pose_of_the_recorded_routes(folder, site_of):
    held = """
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
print(len(poses))
"""
    assert int(run_python(folder, held, site_of())) > 10
