"""Campaigns: so many mutants of each target, in processes that may die; what they died of, and its input."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fuzzing.cases import laid_out
from fuzzing.targets import TARGETS
from fuzzing.worker import case_at

TESTS = Path(__file__).resolve().parents[1]
CORPUS = Path(__file__).resolve().parent / "corpus"
COMMAND = ["-m", "fuzzing.worker"]
# A target, and the number of a mutant or the folder of an input.
Try = tuple[str, int | str]


@dataclass
class Outcome:
    """What became of a target's mutants and inputs."""

    ran: int = 0  # Valid inputs included
    faults: list[dict] = field(default_factory=list)  # ``index``, ``kind``, ``message`` and ``where`` of each
    seconds: float = 0.0  # On the clock
    peak_mib: int = 0  # Most resident memory of a process


def mutants(name: str, n: int) -> list[Try]:
    """A target's mutants in a campaign of n."""
    return [(name, k) for k in range(max(int(n * TARGETS[name].share), 1))]


def corpus(name: str) -> list[Try]:
    """The inputs that once broke a target."""
    return [(name, str(p)) for p in sorted((CORPUS / name).glob("*")) if p.is_dir()]


def run(todo: Sequence[Try], seed: int = 0) -> dict[str, Outcome]:
    """Try mutants and inputs in their order, each in the same process as the last unless that died."""
    outcomes = {name: Outcome() for name, _ in todo}
    environment = os.environ | {
        "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent), os.environ.get("PYTHONPATH", "")]),
    }  # fmt: skip
    while todo:
        done = subprocess.run(
            [sys.executable, *COMMAND, str(seed)], input=json.dumps(todo), env=environment, capture_output=True,
            text=True, errors="replace", check=False,
        )  # fmt: skip
        if done.returncode == 1 and "Traceback" in done.stderr:
            raise RuntimeError(f"the worker cannot run: {done.stderr[-2000:]}")
        tries = [*map(json.loads, done.stdout.splitlines())]
        if len(tries) < len(todo):
            died = f"died of {done.returncode}"
            kind = {-signal.SIGPROF: "hang", -signal.SIGALRM: "stuck"}.get(done.returncode, died)
            tries.append([0.0, 0, {"kind": kind, "message": done.stderr[-300:], "where": ""}])
        for (name, at), (seconds, peak_mib, fault) in zip(todo, tries, strict=False):
            outcome = outcomes[name]
            outcome.ran += 1
            outcome.seconds += seconds
            outcome.peak_mib = max(outcome.peak_mib, peak_mib)
            outcome.faults += [{**fault, "index": at}] if fault else []
        todo = todo[len(tries) :]
    return outcomes


def save(name: str, seed: int, fault: dict, folder: Path) -> None:
    """Keep the input of a mutant's fault, and what is known of it."""
    here = folder / name / f"{fault['index']:06}"
    laid_out(case_at(name, seed, fault["index"]), here)
    here.with_suffix(".txt").write_text(json.dumps(fault, indent=1), encoding="utf-8")
