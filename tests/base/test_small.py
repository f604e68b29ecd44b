"""Small modules of `base`: results kept in their object, freed memory, random draws, secrets of the environment."""

import os
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.base.cached import cached_method
from aerialdojo_gen.base.rng import generator, rank
from aerialdojo_gen.base.secrets import REDACTED, Secrets


class Scaled:
    def __init__(self, by):
        self.by, self.calls = by, 0

    @cached_method
    def times(self, n, more=0):
        self.calls += 1
        return self.by * n + more


def test_a_result_is_made_once_for_each_object_and_arguments():
    two, three = Scaled(2), Scaled(3)
    for _ in range(2):
        assert [two.times(5), two.times(6), two.times(5, 1), two.times(5, more=2)] == [10, 12, 11, 12]
        assert three.times(5) == 15
    assert (two.calls, three.calls) == (4, 1)


# Blocks that are freed, but for the last one: it lies at the heap's top, where the others came from the heap.
BLOCKS = """
import sys
from aerialdojo_gen.base import memory
if sys.argv[1] == "set up":
    memory.set_up()
del_first = bytearray(20 << 20)
del del_first
blocks = [bytearray(b"x" * (12 << 20)) for _ in range(20)]
last = blocks[-1]
del blocks
print([line.split()[1] for line in open("/proc/self/status") if line.startswith("VmRSS")][0])
"""


def test_freed_blocks_go_back_to_the_system_though_one_above_them_is_kept():
    held_mb = {
        how: int(subprocess.run([sys.executable, "-c", BLOCKS, how], capture_output=True, check=True).stdout) / 1024
        for how in ("set up", "not set up")
    }
    assert held_mb["set up"] < 60
    assert held_mb["not set up"] > 150


keys = st.lists(st.one_of(st.integers(), st.text(max_size=8)), max_size=4).map(tuple)


@given(seed=st.integers(0, 2**63), key=keys)
def test_same_key_same_draws(seed, key):
    assert generator(seed, "plan", *key).integers(0, 2**62) == generator(seed, "plan", *key).integers(0, 2**62)
    assert 0 <= rank(seed, "plan", *key) < 2**64


def test_seed_stage_and_key_boundaries_matter_and_another_process_draws_the_same():
    keys = [("plan", "ab", "c"), ("plan", "a", "bc"), ("plan", "abc"), ("planabc",), ("filter", "ab", "c")]
    assert len({rank(1, *keys[0]), *(rank(0, *key) for key in keys)}) == 6
    code = "from aerialdojo_gen.base.rng import rank; print(rank(7, 'split', 'U_Mall_0', 3))"
    for hash_seed in ("1", "2"):
        env = os.environ | {"PYTHONHASHSEED": hash_seed}
        out = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True)
        assert int(out.stdout) == rank(7, "split", "U_Mall_0", 3)


@pytest.mark.parametrize("name", ["PWD", "OLDPWD"])
def test_the_working_directory_is_no_password(name, monkeypatch):
    monkeypatch.setenv(name, "/home/someone/project")
    monkeypatch.setenv("DATABASE_PWD", "long-secret-word")
    said = Secrets().text("/home/someone/project/agent.py: long-secret-word")
    assert said == f"/home/someone/project/agent.py: {REDACTED}"
    options = {"note": "https://me:hunter2@example.org/v1?api_key=abc123"}
    assert Secrets(options).options(options) == {"note": f"https://{REDACTED}@example.org/v1?api_key={REDACTED}"}
