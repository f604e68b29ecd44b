"""A process that runs mutants one after another and says which one it is at, so that its death has a culprit."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from fuzzing.cases import Case, Target, case_of, laid_out
from fuzzing.mutate import mutant
from fuzzing.targets import TARGETS

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.base.rng import generator

HANG_S = 10.0
MEMORY_BYTES = 2 << 30
_LONGEST_MESSAGE = 20_000


def mutants(name: str, seed: int, start: int, stop: int) -> Iterator[tuple[int, Case]]:
    """Yield a target's mutants by number; number 0 is a valid input."""
    target = TARGETS[name]
    cases = target.cases()
    for index in range(start, stop):
        rng = generator(seed, "fuzz", name, index)
        case = dict(cases[int(rng.integers(len(cases)))])
        if index:
            files = sorted(path for path in case if path.endswith(target.mutable))
            path = files[int(rng.integers(len(files)))]
            case[path] = mutant(path, case[path], rng)
        yield index, case


def fault_of(target: Target, folder: Path) -> dict[str, str] | None:
    """Run a target on a folder; what it raised, unless that is right."""
    try:
        target.run(folder)
    except AerialDojoError as error:
        return _wrong_message(target, str(error), folder)
    except Exception as error:
        return {"kind": type(error).__name__, "message": str(error)[:300], "where": _where(error)}
    return None


def _wrong_message(target: Target, message: str, folder: Path) -> dict[str, str] | None:
    why = ""
    try:
        message.encode()
    except UnicodeEncodeError:
        why = "cannot be printed"
    if not message.strip() or len(message) > _LONGEST_MESSAGE:
        why = f"has {len(message)} characters"
    if target.names_the_file and str(folder) not in message:
        why = "names no file"
    return {"kind": "message", "message": ascii(message[:300]), "where": why} if why else None


def _where(error: BaseException) -> str:
    """The innermost line of ours."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "aerialdojo_gen" in f.filename]
    frames = frames or traceback.extract_tb(error.__traceback__)
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}"


def bound() -> None:
    """Give this process so much memory beyond what it has, and no core file."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * os.sysconf("SC_PAGE_SIZE") + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def main() -> None:
    plan = json.loads(sys.argv[1])
    say = os.fdopen(os.dup(1), "w", buffering=1)
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)  # libraries print, and so do readers of video
    os.dup2(quiet, 2)
    warnings.simplefilter("ignore")
    bound()
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as own:
        for name, at, case in _planned(plan):
            say.write(json.dumps({"target": name, "at": at}) + "\n")
            _tried(name, at, case, Path(own) / "case", say)
    say.write(json.dumps({"done": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10}) + "\n")


def _planned(plan: dict) -> Iterator[tuple[str, int | str, Case]]:
    for name, start, stop in plan["mutants"]:
        for index, case in mutants(name, plan["seed"], start, stop):
            yield name, index, case
    for name, folder in plan["inputs"]:
        yield name, folder, case_of(Path(folder))


def _tried(name: str, index: object, case: Case, folder: Path, say: TextIO) -> None:
    laid_out(case, folder)
    # Seconds of this process alone: neighbours on the machine cost nothing. It ends the process, whatever runs.
    signal.setitimer(signal.ITIMER_PROF, HANG_S)
    fault = fault_of(TARGETS[name], folder)
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    if fault is not None:
        say.write(json.dumps({"target": name, "fault": index, **fault}) + "\n")


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        main()
