"""Reading what is hostile until shown otherwise: in a process of its own, in bounded memory and time."""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from aerialdojo_gen.base import environment_errors
from aerialdojo_gen.base.errors import AssetError

MAX_MEMORY_BYTES = 6 << 30
MAX_SECONDS = 300
_OUT_OF_MEMORY = 3


def read_in_sandbox(module: str, path: Path, arguments: Sequence[str], max_memory_bytes: int, mend: str) -> None:
    """Run a module that reads a file, and wait for it."""
    # Not multiprocessing, which would run a caller's unguarded script a second time.
    command = [sys.executable, "-m", module, str(max_memory_bytes), str(path.resolve()), *arguments]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=MAX_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise AssetError(f"{path}: reading takes more than {MAX_SECONDS} s: {mend}") from None
    if ended.returncode:
        raise AssetError(f"{path}: {_cause(ended, max_memory_bytes, mend)}")


def _cause(ended: subprocess.CompletedProcess[str], max_memory_bytes: int, mend: str) -> str:
    """Say why a reading process ended with another code than 0."""
    said, failed = (text.strip().splitlines() for text in (ended.stdout, ended.stderr))
    if ended.returncode == _OUT_OF_MEMORY or environment_errors.is_out_of_memory(ended.stderr):
        return f"needs more than {_memory(max_memory_bytes) >> 20:,} MB of memory to read: {mend}"
    number = -ended.returncode
    if number == signal.SIGXCPU:
        return f"reading takes more than {MAX_SECONDS} s: {mend}"
    if number == signal.SIGKILL:
        return f"its reader was killed (signal 9), by the system if memory ran out: try again, or {mend}"
    if number > 0:
        return f"its reader crashed (signal {number}, {signal.strsignal(number)}): the file may be damaged"
    return said[-1] if said else f"its reader failed ({failed[-1][:160] if failed else 'without a reason'})"


def _memory(most: int) -> int:
    """Return the bound on address space, where the caller's own limit may be lower."""
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    return most if hard == resource.RLIM_INFINITY else min(most, hard)


def exit_status(read: Callable[[list[str]], str]) -> int:
    """Bound this process as its command line says, read, and print what is wrong with the file."""
    memory, *arguments = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_AS, (_memory(int(memory)),) * 2)
    # At the hard limit the kernel sends SIGKILL, which does not tell its cause.
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_SECONDS, MAX_SECONDS + 5))
    try:
        fault = read(arguments)
    except MemoryError:
        return _OUT_OF_MEMORY
    print(fault)
    return 1 if fault else 0
