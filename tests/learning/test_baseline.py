"""The row of the learned policy in README, flown by its weights where they and the whole release are here."""

import os
import re
from pathlib import Path

import pytest
from scipy.stats import binomtest

from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.tasks import Selection

pytest.importorskip("torch", reason="PyTorch is not installed: it is the extra 'train'")

EPISODES = 40


@pytest.mark.slow
def test_the_weights_of_the_baseline_do_as_well_as_readme_says(project, tmp_path):
    data = Path(os.environ.get("AERIALDOJO_DATA") or project / "data")
    weights = data / "policies" / "imitation" / "policy.safetensors"
    if not weights.is_file():
        pytest.skip(f"there are no weights of train imitation in {data}")
    row = re.search(r"^\| imitation and DAgger \| ([\d.]+) \[", (project / "README.md").read_text(), re.MULTILINE)
    selection = Selection(("id_test",), ("base",), limit=EPISODES)
    flown = evaluate(data, Evaluation("row", "policy", {"weights": str(weights)}, selection), out=tmp_path, workers=2)
    assert flown.finished == EPISODES
    assert binomtest(flown.successes, EPISODES, float(row[1]) / 100).pvalue > 0.001, (
        f"{flown.successes} of {EPISODES}"
    )
