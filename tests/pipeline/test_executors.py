"""What every executor keeps: order of finishing, affinity, errors, kills, messages, Ctrl-C."""

import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support import chores, preload
from support.chores import Chore

from aerialdojo_gen.base.errors import AerialDojoError, MissingPackage, UsageError
from aerialdojo_gen.pipeline.executors.base import ParentChannel, SharedPaths, make_executor

TESTS = Path(__file__).resolve().parents[1]
RAY = pytest.param("ray", marks=pytest.mark.ray)


@pytest.fixture(scope="module")
def local_pool():
    with make_executor("local", 2) as pool:
        yield pool


@pytest.fixture(scope="module")
def ray_pool(tmp_path_factory):
    os.environ["AERIALDOJO_TRIED"] = "forwarded"
    data = tmp_path_factory.mktemp("ray-data")
    with make_executor("ray", 2, None, SharedPaths((data,), (), (data,))) as pool:
        yield pool
    del os.environ["AERIALDOJO_TRIED"]
    assert not list(data.rglob("*")), "the marker is gone with the executor"


@pytest.fixture(params=["local", RAY])
def pool(request):
    return request.getfixturevalue(f"{request.param}_pool")


def tasks(folder, n=6, kinds=None, scenes=None):
    return [Chore(k, (scenes or [""])[k % len(scenes or [""])], folder, (kinds or {}).get(k, "")) for k in range(n)]


def test_what_cannot_be_is_said_in_one_line(monkeypatch, tmp_path):
    """The first of these tests: none of them has connected this process to a Ray cluster yet."""
    with pytest.raises(UsageError, match="unknown executor 'slurm'; executors: local, ray"):
        make_executor("slurm")
    with pytest.raises(UsageError, match="--address needs --executor ray"):
        make_executor("local", address="127.0.0.1:6379")
    with pytest.raises(UsageError, match="--address nowhere: write HOST:PORT"):
        make_executor("ray", address="nowhere")
    with monkeypatch.context() as context:
        context.setitem(sys.modules, "ray", None)
        with pytest.raises(MissingPackage, match=r"--executor ray lacks .* 'aerialdojo-gen\[cluster\]'"):
            make_executor("ray")
    refused = r"no Ray cluster answers at 127.0.0.1:1 \(.*refused\): start one"
    with pytest.raises(AerialDojoError, match=refused), make_executor("ray", address="127.0.0.1:1") as pool:
        list(pool.map(chores.square, tasks(tmp_path, 1)))


def test_results_are_the_same_whoever_computes_them_and_come_in_the_order_of_finishing(pool, tmp_path):
    assert pool.workers == 2
    assert sorted(pool.map(chores.square, tasks(tmp_path))) == [(k, k * k) for k in range(6)]
    assert list(pool.map(chores.square, [])) == []
    order = list(pool.map(chores.wait_for_the_others, tasks(tmp_path, 4)))
    assert sorted(order) == [0, 1, 2, 3]
    assert order.index(0) >= 2


def test_a_process_stays_with_its_scene(pool, tmp_path):
    work = tasks(tmp_path, 12, scenes=["a", "b", "c"])
    rows = list(pool.map(chores.where, work, lambda chore: chore.scene))
    turns = {}
    for scene, pid, _ in rows:
        turns.setdefault(pid, []).append(scene)
    assert os.getpid() not in turns
    # A process leaves a scene only when nothing of it waits: two have at most one change more than there are scenes.
    changes = sum(a != b for order in turns.values() for a, b in itertools.pairwise(order))
    assert changes <= 2


def test_tasks_that_others_bring_stay_with_their_process(pool, tmp_path):
    steps = chores.Steps(["a", "b"], 4, 1, tmp_path)
    pids = {}
    for scene, pid, _ in pool.run(chores.meet, steps):
        pids.setdefault(scene, set()).add(pid)
    for scene in "ab":
        assert [number for at, number in steps.order if at == scene] == [0, 1, 2, 3]
        assert len(pids[scene]) == 1
    assert pids["a"] != pids["b"]


def test_a_process_helps_with_a_scene_that_is_worth_it(pool, tmp_path):
    for alone_at, helpers in ((("a",), 1), ((), 2)):
        steps = chores.Steps(["a"], 3, 6, tmp_path, alone_at)
        rows = list(pool.run(chores.where, steps))
        assert len(rows) == 18
        assert [number for _, number in steps.order] == sorted([0, 1, 2] * 6)
        assert len({pid for _, pid, _ in rows}) == helpers


def test_one_process_goes_on_with_a_scene_to_its_end(tmp_path):
    with make_executor("local", 1) as pool:
        steps = chores.Steps(["a", "b"], 3, 2, tmp_path)
        rows = list(pool.run(chores.where, steps))
    assert {pid for _, pid, _ in rows} == {os.getpid()}
    assert [scene for scene, _, _ in rows] == ["a"] * 6 + ["b"] * 6


def test_expected_errors_are_results_and_defects_end_it(pool, tmp_path):
    outcomes = list(pool.map(chores.fail, tasks(tmp_path, 4, {2: "expected"})))
    errors = [one for one in outcomes if isinstance(one, AerialDojoError)]
    assert [str(error) for error in errors] == ["chore 2 has no mesh"]
    assert sorted(one for one in outcomes if not isinstance(one, AerialDojoError)) == [0, 1, 3]
    with pytest.raises(ZeroDivisionError, match="chore 1 has a defect") as raised:
        list(pool.map(chores.fail, tasks(tmp_path, 4, {1: "defect"})))
    assert "chores.py" in str(raised.value.__cause__), "where it came from is said"


def test_workers_tell_while_they_work_and_stop_when_they_are_asked(pool, tmp_path):
    heard = []
    assert sum(pool.map(chores.talk, tasks(tmp_path, 4), channel=ParentChannel(heard.append, lambda: False))) == 12
    assert sorted(heard) == [(n, k) for n in range(4) for k in range(3)]
    heard.clear()
    # They end by themselves once both have been heard.
    channel = ParentChannel(heard.append, lambda: len(heard) == 2)
    done = list(pool.map(chores.go_on_until_stopped, tasks(tmp_path, 2), channel=channel))
    assert sorted(done) == sorted(heard) == [0, 1]


def test_turns_are_given_out_over_all_processes(pool, tmp_path):
    channel = ParentChannel(print, lambda: False)
    waits = [wait_s for one in pool.map(chores.take_turns, tasks(tmp_path, 3), channel=channel) for wait_s in one]
    # Six turns, a thousand seconds apart; how much of them is over when one is taken does not matter.
    assert sorted(round(w / 1000.0) for w in waits) == [0, 1, 2, 3, 4, 5]


def test_a_killed_worker_is_one_line(tmp_path):
    match = r"a worker process was killed at .*chore 1.*out of memory"
    with pytest.raises(AerialDojoError, match=match) as raised, make_executor("local", 2) as pool:
        list(pool.map(chores.die_once, tasks(tmp_path, 4)))
    assert "\n" not in str(raised.value)


@pytest.mark.ray
def test_a_task_whose_process_was_lost_is_done_again_elsewhere(ray_pool, tmp_path):
    assert sorted(ray_pool.map(chores.die_once, tasks(tmp_path, 4))) == [0, 1, 2, 3]
    assert (tmp_path / "died-1").exists()


@pytest.mark.ray
@pytest.mark.nightly
def test_a_task_that_loses_every_process_is_one_line(ray_pool, tmp_path):
    with pytest.raises(AerialDojoError, match="chore 1: its process was lost 4 times") as raised:
        list(ray_pool.map(chores.die_once, tasks(tmp_path, 2, {1: "always"})))
    assert "\n" not in str(raised.value)


@pytest.mark.ray
def test_variables_that_are_ours_are_forwarded(ray_pool, tmp_path):
    assert {row[2] for row in ray_pool.map(chores.where, tasks(tmp_path, 4))} == {"forwarded"}


def test_what_processes_keep_is_closed_at_the_end(tmp_path):
    with make_executor("local", 2) as pool:
        list(pool.map(chores.keep_until_the_end, tasks(tmp_path, 4)))
    opened = {path.name.split("-")[1] for path in tmp_path.glob("open-*")}
    assert opened == {path.name.split("-")[1] for path in tmp_path.glob("closed-*")}
    with make_executor("local", 1) as pool:
        list(pool.map(chores.keep_until_the_end, tasks(tmp_path, 1)))
    assert (tmp_path / f"closed-{os.getpid()}").exists()


PROGRAM = """
import sys
from pathlib import Path
from support import chores, preload
from aerialdojo_gen.pipeline.executors.base import ParentChannel, make_executor
from aerialdojo_gen.pipeline.interrupt import Interrupts
from aerialdojo_gen.pipeline.progress import Reporter

def main(executor, work, folder):
    reporter = Reporter()
    tasks = [chores.Chore(k, "", Path(folder)) for k in range(4)]
    channel = ParentChannel(lambda _: None, lambda: False) if work == "talk" else None
    with Interrupts() as interrupts, make_executor(executor, 2) as pool, reporter.bar("chores", len(tasks)) as bar:
        for _ in pool.map(getattr(chores, work), tasks, channel=channel):
            interrupts.check()
            bar.advance()
    reporter.line("all done")

if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except KeyboardInterrupt:
        sys.exit(130)
"""


def start(tmp_path, executor, work, **popen):
    """Start a program whose processes do chores, in a session of its own; gives the folder of their traces too."""
    script, folder = tmp_path / "program.py", tmp_path / "pids"
    script.write_text(PROGRAM)
    folder.mkdir()
    path = os.pathsep.join([str(TESTS), str(TESTS.parent)])
    environment = os.environ | {"PYTHONPATH": path} | popen.pop("env", {})
    command = [sys.executable, str(script), executor, work, str(folder)]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True, env=environment, **popen
    )
    return process, folder


def wait_for_both(process, folder):
    chores.until(lambda: len(list(folder.iterdir())) == 2 or process.poll() is not None, 120)


@pytest.mark.parametrize("executor", ["local", pytest.param("ray", marks=[pytest.mark.ray, pytest.mark.nightly])])
@pytest.mark.kill
def test_ctrl_c_ends_all_processes(executor, tmp_path):
    """Of this machine also one that is stopped; that of a command whose workers run is tried by test_resume."""
    process, folder = start(tmp_path, executor, "sleep")
    wait_for_both(process, folder)
    if executor == "local":
        worker = int(next(folder.iterdir()).name)
        os.kill(worker, signal.SIGSTOP)
        chores.until(lambda: Path(f"/proc/{worker}/stat").read_text().rsplit(")", 1)[1].split()[0] == "T")
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    chores.until_empty(process.pid)


@pytest.mark.kill
def test_an_ignored_ctrl_c_stays_ignored(tmp_path):
    # As a shell starts the background jobs of a script.
    process, folder = start(
        tmp_path, "local", "wait_for_go", preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)
    )
    wait_for_both(process, folder)
    os.killpg(process.pid, signal.SIGINT)
    (folder / "go").touch()
    _, err = process.communicate(timeout=60)
    # At load lines of progress come before.
    said = [line for line in err.splitlines() if not line.startswith("chores: ")]
    assert (process.returncode, said) == (0, ["all done"])


@pytest.mark.kill
def test_a_termination_leaves_no_processes_and_no_semaphores(tmp_path):
    process, folder = start(tmp_path, "local", "sleep")
    wait_for_both(process, folder)
    process.terminate()
    # What outlives the process, as Python's tracker of semaphores does, has the same standard error.
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (-signal.SIGTERM, "")
    chores.until_empty(process.pid)


@pytest.mark.kill
def test_processes_work_where_no_semaphore_can_be_made(tmp_path):
    """As where ``/dev/shm`` is full or read-only."""
    without = {"LD_PRELOAD": str(preload.library()), "PRELOAD_NO_SEMAPHORES": "1"}
    lock = [sys.executable, "-c", "import multiprocessing; multiprocessing.Lock()"]
    failed = subprocess.run(lock, env=os.environ | without, capture_output=True, text=True, check=False)
    assert "OSError: [Errno 30] Read-only file system" in failed.stderr
    process, _ = start(tmp_path, "local", "talk", env=without)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "all done\n")
