"""A process that tries inputs one after another, a line each, so that its death has a culprit: the next one."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from functools import cache
from pathlib import Path

from fuzzing.cases import Case, Target, case_of, laid_out
from fuzzing.mutate import mutant
from fuzzing.targets import TARGETS

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.base.rng import generator

HANG_S = 10.0
# What waits for something has no seconds of its own to count.
STUCK_S = 300.0
MEMORY_BYTES = 2 << 30
_LONGEST_MESSAGE = 20_000

_valid = cache(lambda name: TARGETS[name].cases())


def case_at(name: str, seed: int, at: int | str) -> Case:
    """Make a target's mutant by its number, of which 0 is a valid input; or take up an input's folder."""
    if isinstance(at, str):
        return case_of(Path(at))
    rng, cases = generator(seed, "fuzz", name, at), _valid(name)
    case = dict(cases[int(rng.integers(len(cases)))])
    if at:
        files = sorted(path for path in case if path.endswith(TARGETS[name].mutable))
        path = files[int(rng.integers(len(files)))]
        case[path] = mutant(path, case[path], rng)
    return case


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
    frames = traceback.extract_tb(error.__traceback__)
    last = ([f for f in frames if "aerialdojo_gen" in f.filename] or frames)[-1]
    return f"{Path(last.filename).name}:{last.lineno}"


def main() -> None:
    seed, todo = int(sys.argv[1]), json.load(sys.stdin)
    say = os.fdopen(os.dup(1), "w", buffering=1)
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)  # libraries print, and so do readers of video
    os.dup2(quiet, 2)
    warnings.simplefilter("ignore")
    # So much memory beyond what it has, and no core file.
    limit = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE") + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as own:
        for name, at in todo:
            begun, folder = time.monotonic(), Path(own) / "case"
            laid_out(case_at(name, seed, at), folder)
            # They end the process, whatever runs; by its own seconds first: neighbours on the machine cost nothing.
            signal.setitimer(signal.ITIMER_PROF, HANG_S)
            signal.setitimer(signal.ITIMER_REAL, STUCK_S)
            fault = fault_of(TARGETS[name], folder)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
            say.write(json.dumps([time.monotonic() - begun, peak, fault]) + "\n")


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        main()
