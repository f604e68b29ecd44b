"""The command line: quick help, one line and an exit code for what a user can get wrong."""

import os
import subprocess
import sys

import pytest

from aerialdojo_gen.commands.stages import PLAIN_STAGES, SPLIT
from aerialdojo_gen.errors import UsageError
from aerialdojo_gen.pipeline import registry, runner

HEAVY = ("numpy", "pyarrow", "numba", "fcl", "pybullet", "trimesh", "cv2", "scipy", "av")


def call(*args, **env):
    command = [sys.executable, "-m", "aerialdojo_gen.cli", *args]
    return subprocess.run(command, capture_output=True, text=True, env=os.environ | env, timeout=120, check=False)


@pytest.mark.parametrize("args", [["--help"], ["plan", "--help"], ["render", "--help"]])
def test_help_imports_nothing_heavy(args):
    code = (
        "import sys\nfrom aerialdojo_gen import cli\n"
        f"try:\n    cli.app({args!r})\nexcept SystemExit: pass\n"
        f"print([m for m in {HEAVY!r} if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "Usage" in out
    assert out.strip().endswith("[]")


def test_every_stage_has_a_command_with_the_common_options():
    for one in registry.STAGES:
        text = call(one.name, "--help").stdout
        assert one.help.split()[0] in text
        for option in ("--data", "--scene", "--pipeline", "--workers", "--force", "--quiet"):
            assert option in text, (one.name, option)


def test_help_texts_are_the_stages_own():
    ours = PLAIN_STAGES | {"split": SPLIT}
    assert {s.name: s.help for s in registry.STAGES if s.name in ours} == ours


def assert_one_line(result, code, *words):
    assert result.returncode == code
    assert result.stderr.count("\n") == 1, result.stderr
    assert result.stderr.startswith("error: ")
    for word in words:
        assert word in result.stderr


def test_unknown_scene_gives_the_nearest_names(tmp_path):
    result = call("plan", "--scene", "U_Mal_0", "--data", str(tmp_path / "d"))
    assert_one_line(result, 2, "no scene 'U_Mal_0'", "U_Mall_0")
    assert not (tmp_path / "d").exists()


def test_unknown_key_in_a_pipeline(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("[plan]\nwieght = 2\n")
    assert_one_line(
        call("run", str(path), "--data", str(tmp_path / "d")), 2, str(path), "[plan] unknown key 'wieght'"
    )


def test_unknown_stage_and_missing_folder(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("stages = ['plann']\n")
    assert_one_line(call("run", str(path), "--data", str(tmp_path / "d")), 2, "unknown stage 'plann'")
    path.write_text("recipes = 'nowhere'\n")
    assert_one_line(call("run", str(path), "--data", str(tmp_path / "d")), 2, "nowhere", "set recipes")


def test_data_directory_that_cannot_be_written(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert_one_line(call("build-scenes", "--data", str(blocked / "data")), 1, "cannot write", "not a folder")


def test_scene_patterns():
    known = ["N_Forest_0", "U_Mall_0", "U_Mall_1"]
    assert runner.choose_scenes(["U_*"], known) == ["U_Mall_0", "U_Mall_1"]
    assert runner.choose_scenes(["U_Mall_1", "*_0"], known) == known
    with pytest.raises(UsageError, match="no scene 'u_mall_0'; nearest: U_Mall_0"):
        runner.choose_scenes(["u_mall_0"], known)


def test_upstream_of_each_stage_is_all_it_reads():
    for one in registry.STAGES:
        chain = list(registry.upstream(one.name))
        assert chain[-1] is one
        written = set()
        for s in chain:
            assert set(s.reads) <= written, (one.name, s.name)
            written |= set(s.writes)


def test_upstream_leaves_out_what_is_not_needed():
    assert [s.name for s in registry.upstream("plan")] == [
        "build-scenes", "annotate-import", "anchor-sample", "pair-objects", "plan"
    ]  # fmt: skip
