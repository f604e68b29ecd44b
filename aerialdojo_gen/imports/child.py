"""Reading what is hostile until shown otherwise: in a process of its own, in bounded memory and time."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from aerialdojo_gen.errors import AssetError

MAX_MEMORY_BYTES = 6 << 30
MAX_SECONDS = 300


def read_in_child(module: str, path: Path, arguments: Sequence[str], max_memory_bytes: int, mend: str) -> None:
    """Run a module that reads a file, and wait for it.

    Parameters
    ----------
    module : str
        Ends with ``raise SystemExit(bounded(...))``.
    path : Path
        The file.
    arguments : sequence of str
        What the module is given behind the memory and the file.
    max_memory_bytes : int
        Most address space of the process.
    mend : str
        What to do about a file that asks for too much.

    Raises
    ------
    AssetError
        It takes too long or needs too much, crashed, or says what is wrong with the file.
    """
    # Not multiprocessing, which would run a caller's unguarded script a second time.
    command = [sys.executable, "-m", module, str(max_memory_bytes), str(path.resolve()), *arguments]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=MAX_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise AssetError(f"{path}: reading takes more than {MAX_SECONDS} s: {mend}") from None
    if ended.returncode:
        said = ended.stdout.strip().splitlines()
        raise AssetError(f"{path}: {said[-1] if said else 'its reader crashed: damaged, or too large'}")


def bounded(read: Callable[[list[str]], str]) -> int:
    """Bound this process as its command line says, read, and print what is wrong with the file.

    Parameters
    ----------
    read : callable
        Takes the file and the other arguments; gives what is wrong with the file, or nothing.

    Returns
    -------
    int
        Exit code: 1 where something is wrong.
    """
    memory, *arguments = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_SECONDS, MAX_SECONDS))
    fault = read(arguments)
    print(fault)
    return 1 if fault else 0
