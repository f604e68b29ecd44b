"""Random draws depend on what is drawn for, and on nothing else."""

import os
import subprocess
import sys

from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.base.rng import generator, rank

keys = st.lists(st.one_of(st.integers(), st.text(max_size=8)), max_size=4).map(tuple)


@given(seed=st.integers(0, 2**63), key=keys)
def test_same_key_same_draws(seed, key):
    assert generator(seed, "plan", *key).integers(0, 2**62) == generator(seed, "plan", *key).integers(0, 2**62)
    assert 0 <= rank(seed, "plan", *key) < 2**64


def test_seed_zero_stage_and_key_boundaries_matter():
    keys = [("plan", "ab", "c"), ("plan", "a", "bc"), ("plan", "abc"), ("planabc",), ("filter", "ab", "c")]
    assert len({rank(1, *keys[0]), *(rank(0, *key) for key in keys)}) == 6


def test_draws_are_the_same_in_another_process():
    code = "from aerialdojo_gen.base.rng import rank; print(rank(7, 'split', 'U_Mall_0', 3))"
    for hash_seed in ("1", "2"):
        env = os.environ | {"PYTHONHASHSEED": hash_seed}
        out = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True)
        assert int(out.stdout) == rank(7, "split", "U_Mall_0", 3)
