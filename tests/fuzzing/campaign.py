"""Campaigns: so many mutants of each target, in processes that may die; what they died of, and its input."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fuzzing.cases import laid_out
from fuzzing.targets import TARGETS
from fuzzing.worker import mutants

TESTS = Path(__file__).resolve().parents[1]
CORPUS = Path(__file__).resolve().parent / "corpus"
COMMAND = ["-m", "fuzzing.worker"]
# A process that waits for something has no seconds of its own to count.
_STUCK_S = 300.0
_SAVED_EACH = 3


@dataclass
class Outcome:
    """What became of a target's mutants and inputs."""

    ran: int = 0  # Valid inputs included
    faults: list[dict] = field(default_factory=list)  # ``index``, ``kind``, ``message`` and ``where`` of each
    seconds: float = 0.0  # On the clock
    peak_mib: int = 0  # Most resident memory of a process

    @property
    def kinds(self) -> Counter[tuple[str, str]]:
        """How often each fault was met: by kind and place."""
        return Counter((fault["kind"], fault["where"]) for fault in self.faults)


def run(mutants: Mapping[str, range], inputs: Sequence[tuple[str, Path]] = (), seed: int = 0) -> dict[str, Outcome]:
    """Run mutants of targets, by their numbers, and then inputs, a folder each, by which their faults are known."""
    outcomes = {name: Outcome() for name in (*mutants, *(name for name, _ in inputs))}
    numbers = [[name, some.start, some.stop] for name, some in mutants.items()]
    folders = [[name, str(path)] for name, path in inputs]
    while last := _process({"seed": seed, "mutants": numbers, "inputs": folders}, outcomes):
        name, at = last
        if [name, at] in folders:
            numbers, folders = [], folders[folders.index([name, at]) + 1 :]
        else:
            while numbers[0][0] != name:
                numbers.pop(0)
            numbers[0][1] = at + 1
    return outcomes


def _process(plan: dict, outcomes: dict[str, Outcome]) -> tuple[str, Any] | None:
    """Run a process until it ends, None, or dies: then it returns the target and the input that it died of."""
    environment = os.environ | {
        "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent), os.environ.get("PYTHONPATH", "")]),
    }  # fmt: skip
    command = [sys.executable, *COMMAND, json.dumps(plan)]
    name, at, done, since = "", None, False, time.monotonic()
    with (
        tempfile.TemporaryFile() as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, env=environment) as process,
    ):
        assert process.stdout is not None
        pending = b""
        while True:
            # Until the first input it imports, on a busy machine for minutes.
            if not select.select([process.stdout], [], [], _STUCK_S if name else 3 * _STUCK_S)[0]:
                process.kill()
                break
            new = os.read(process.stdout.fileno(), 1 << 16)
            if not new:
                break
            *lines, pending = (pending + new).split(b"\n")
            for line in map(json.loads, lines):
                if "at" in line:
                    if name and line["target"] != name:
                        outcomes[name].seconds += time.monotonic() - since
                        since = time.monotonic()
                    name, at = line["target"], line["at"]
                    outcomes[name].ran += 1
                elif "fault" in line:
                    outcomes[name].faults.append({**line, "index": line["fault"]})
                else:
                    done = True
                    for outcome in outcomes.values():
                        outcome.peak_mib = max(outcome.peak_mib, line["done"])
        code = process.wait()
        errors.seek(0)
        said = errors.read().decode(errors="replace")
    if name:
        outcomes[name].seconds += time.monotonic() - since
    if done:
        return None
    if not name or (code == 1 and "Traceback" in said):
        raise RuntimeError(f"the worker cannot run: {said[-2000:]}")
    kind = {-signal.SIGPROF: "hang", -signal.SIGKILL: "stuck"}.get(code, f"died of {code}")
    outcomes[name].faults.append({"index": at, "kind": kind, "message": said[-300:], "where": ""})
    return name, at


def save(name: str, seed: int, outcome: Outcome, folder: Path) -> None:
    """Keep the inputs of a few faults of each kind."""
    met: Counter[tuple[str, str]] = Counter()
    for fault in outcome.faults:
        key = fault["kind"], fault["where"]
        met[key] += 1
        if met[key] <= _SAVED_EACH:
            ((_, case),) = mutants(name, seed, fault["index"], fault["index"] + 1)
            here = folder / name / f"{fault['index']:06}"
            laid_out(case, here)
            here.with_suffix(".txt").write_text(json.dumps(fault, indent=1), encoding="utf-8")


def corpus(name: str) -> list[Path]:
    """The inputs that once broke a target, a folder each."""
    return sorted(p for p in (CORPUS / name).glob("*") if p.is_dir())


def number_for(name: str, n: int) -> int:
    """How many mutants of a target a campaign of n has."""
    return max(int(n * TARGETS[name].share), 1)
