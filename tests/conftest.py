"""What several test files share: the tiers, the smoke run, a browser."""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import pytest

from aerialdojo_gen.base import cli_context, memory

if TYPE_CHECKING:
    from selenium.webdriver import Chrome as WebDriver
    from support.planting import Planted

# A test with one of these marks is left out of `make test-fast`; every other gets the mark "fast".
NOT_FAST = frozenset({"pipeline", "browser", "kill", "scenes", "ray", "s3", "slow", "nightly"})
# Marks that go with a fixture.
BY_FIXTURE = {"smoke": "pipeline", "browser": "browser", "mesh_of": "scenes"}
# Skips that `--expected-skips-only` (.ci/run) allows, by how their reasons begin; any other skip fails the run.
EXPECTED_SKIPS = (
    "LEROBOT_PYTHON names no Python",  # some GB, and versions of packages that differ from ours
    "stable-baselines3 is not installed",
    "there are no weights of train imitation",  # 2 h, on the whole release
    "this machine lets nobody make namespaces",  # most containers
)

# Files with the longest tests, which begin.
DEAREST = (
    "tests/test_doc_blocks.py", "tests/layouts/test_every_scene.py", "tests/learning/test_trajectories.py",
    "tests/learning/test_training.py", "tests/pipeline/test_resume.py", "tests/test_wheel.py",
    "tests/pipeline/test_render_scale.py", "tests/scenes/test_worlds.py", "tests/scenes/test_shipped_catalogue.py",
    "tests/dataset/test_validate_every_row.py", "tests/benchmark/test_evaluate.py", "tests/learning/test_loader.py",
)  # fmt: skip

# What is drawn for a day's run (`drawn` of support.layout_checks) is the same in all processes of a session.
os.environ.setdefault("SAMPLE_SEED", time.strftime("%Y%m%d"))

# Where it is ignored, as in a script's background job, the processes of the tests would ignore Ctrl-C too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Where Python may keep no compiled modules, as in many containers, each process that a test starts would compile its
# own sources and those of all libraries anew: seconds each time.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Threads of PyTorch and NumPy that wait for one another sleep: where there are more than cores, those that spin would
# use up what the others wait for.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")

# How long an example takes is the machine's affair: no test fails for that.
hypothesis.settings.register_profile("untimed", deadline=None, max_examples=40)
hypothesis.settings.load_profile("untimed")


def pytest_configure(config: pytest.Config) -> None:
    # xdist would begin with the files that have the most tests; `DEAREST` keeps no process at work alone at the end.
    config.option.loadscopereorder = False
    memory.set_up()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--expected-skips-only", action="store_true", help="fail at a skip not in EXPECTED_SKIPS")


def unexpected_skips(config: pytest.Config) -> list[str]:
    """Where and why tests or modules were skipped, without those that are expected."""
    if not config.getoption("expected_skips_only") or hasattr(config, "workerinput"):
        return []
    reports = config.pluginmanager.get_plugin("terminalreporter").stats.get("skipped", [])
    reasons = {report.nodeid: report.longrepr[2].removeprefix("Skipped: ") for report in reports}
    return [f"{name}: {why}" for name, why in reasons.items() if not why.startswith(EXPECTED_SKIPS)]


def pytest_terminal_summary(terminalreporter, config: pytest.Config) -> None:
    terminalreporter.write_line(f"samples of the nightly tests were drawn by SAMPLE_SEED={os.environ['SAMPLE_SEED']}")
    for line in unexpected_skips(config):
        terminalreporter.write_line(f"skipped, which EXPECTED_SKIPS does not allow: {line}", red=True)


def pytest_sessionfinish(session: pytest.Session) -> None:
    if unexpected_skips(session.config) and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put every test into its tier; the dearest first; no nightly ones, unless named or asked for by `-m`."""
    if "nightly" not in config.option.markexpr and not any("::" in arg for arg in config.args):
        nightly = [item for item in items if item.get_closest_marker("nightly")]
        config.hook.pytest_deselected(items=nightly)
        items[:] = [item for item in items if item not in nightly]
    rank = {name: k for k, name in enumerate(DEAREST)}
    items.sort(key=lambda item: rank.get(item.nodeid.partition("::")[0], len(rank)))
    for item in items:
        for fixture in BY_FIXTURE.keys() & set(getattr(item, "fixturenames", ())):
            item.add_marker(BY_FIXTURE[fixture])
        if not NOT_FAST & {mark.name for mark in item.iter_markers()}:
            item.add_marker("fast")


@pytest.fixture(autouse=True)
def nothing_given() -> Iterator[None]:
    """Advice repeats what a command was given: in one process the next test was given nothing."""
    with cli_context.use_context(cli_context.CliContext()):
        yield


@pytest.fixture(scope="module", autouse=True)
def nothing_kept() -> Iterator[None]:
    """Scenes, and what the C library holds free for later, go with a module: a process would grow file by file."""
    yield
    if contexts := sys.modules.get("aerialdojo_gen.scenes.context"):
        contexts.release_scenes()
    with contextlib.suppress(AttributeError):  # a C library without it
        ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(scope="session", autouse=True)
def own_cache(shared: Path) -> Iterator[None]:
    """What the tests' commands keep in the user's cache goes with the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AERIALDOJO_CACHE", str(shared / "cache"))
        yield


@pytest.fixture(scope="session")
def project() -> Path:
    """The checkout's folder."""
    return Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that the session's test processes have in common: make a thing in it once, under a lock."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base) / "shared"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def smoke(project: Path, shared: Path) -> Path:
    """The data directory of a whole run of pipelines/smoke.toml: read it; what a test changes is a copy of it."""
    data, whole = shared / "smoke", shared / "smoke.whole"
    with (shared / "smoke.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not whole.exists():
            command = [sys.executable, "-m", "aerialdojo_gen.cli", "run", "pipelines/smoke.toml", "--data", str(data)]
            done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
            whole.touch()
    return data


@pytest.fixture(scope="session")
def worlds_cache(shared: Path) -> Path:
    """A cache of worlds from seeds that the session's processes have in common; whoever asks first makes a world."""
    return shared / "worlds"


@pytest.fixture(scope="session")
def session_browser() -> Iterator[WebDriver]:
    from support.browser import chromium

    with chromium("the pages") as driver:
        yield driver


@pytest.fixture(scope="module")
def browser(session_browser: WebDriver) -> WebDriver:
    """A real Chromium, which the pages' tests of a process share; every module finds it empty."""
    from support.browser import as_new

    as_new(session_browser)
    return session_browser


@pytest.fixture
def planted(smoke: Path, tmp_path: Path) -> Planted:
    """A copy of the smoke run's release and meshes, to plant faults in; its scene is U_Courtyard_0."""
    from support.planting import Planted

    shutil.copytree(smoke / "release", tmp_path / "data" / "release")
    shutil.copytree(smoke / "meshes", tmp_path / "data" / "meshes")
    return Planted(tmp_path / "data", "U_Courtyard_0")
