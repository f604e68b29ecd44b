"""What the machine or the caller can get wrong anywhere in a command, in one line each.

Nothing heavy is imported: this is asked before a command's own imports, which are the first to meet a limit.
"""

from __future__ import annotations

import errno
import os
import resource
import sys
from collections.abc import Iterator, Sequence

from aerialdojo_gen.base.errors import DISK_ERRORS, AerialDojoError, ConfigError, UsageError

# Python with the libraries of a command has about 20 open, every worker process some more.
_MIN_FILES = 64
# Address space of the largest process of a command on two small scenes: VmPeak on two cores, rounded up. Below it
# native libraries crash or hang while they start. With large scenes a command takes more, in arrays of ours, whose
# MemoryError is one line. Stages, which may run those before them, evaluate and export take up to 2,900.
_USUAL_MB = 2900
_COMMAND_MB = {
    "add-map": 1300, "add-scene": 1500, "add-terrain": 1400, "annotate": 3000, "annotate-draft": 1600, "config": 100,
    "gallery": 1800, "render": 3400, "report": 1800, "show": 3000, "stats": 1800, "validate": 3100, "view": 3000,
}  # fmt: skip
# For each further core: the two copies of OpenBLAS, of NumPy and SciPy, reserve 40 each for a thread of theirs.
_CORE_MB = 80
_NO_MEMORY = (
    "cannot allocate memory", "failed to map segment", "bad_alloc", "can't start new thread", "insufficient memory",
    "out of memory", "unable to allocate", "memory allocation still failed",
)  # fmt: skip
_NO_FILES = ("too many open files",)


def use_utf8() -> None:
    """Start Python again in its UTF-8 mode where the locale has another encoding: paths and files are UTF-8 here."""
    if sys.getfilesystemencoding() != "utf-8" and os.environ.get("PYTHONUTF8") != "1":
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | {"PYTHONUTF8": "1"})  # noqa: S606


def check_arguments(arguments: Sequence[str]) -> None:
    """Refuse arguments that are no text, and empty ones."""
    for before, text in zip(("", *arguments), arguments, strict=False):
        option = before if before.startswith("--") else ""
        if not text:
            raise UsageError(f"{option or 'an argument'} is empty: give a value, or leave it out")
        if text.startswith("--") and text.find("=") == len(text) - 1:
            raise UsageError(f"{text[:-1]} is empty: give a value, or leave it out")
        _check_text(text, option)
    _check_text(os.environ.get("AERIALDOJO_DATA", ""), "AERIALDOJO_DATA")
    _check_text(os.fsdecode(os.getcwdb()), "the working directory")


def _check_text(text: str, option: str) -> None:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        shown = os.fsencode(text).decode("utf-8", "backslashreplace")
        raise UsageError(f"{f'{option} ' if option else ''}{shown} is not UTF-8: rename it") from None


def check_limits(arguments: Sequence[str]) -> None:
    """Raise the number of file descriptors to what is allowed."""
    if arguments and not arguments[0].startswith("-") and not {"-h", "--help"} & set(arguments):
        check_memory(arguments[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    target = 4096 if hard == resource.RLIM_INFINITY else min(4096, hard)
    if soft != resource.RLIM_INFINITY and soft < target:
        resource.setrlimit(resource.RLIMIT_NOFILE, (target, hard))
        soft = target
    if soft != resource.RLIM_INFINITY and soft < _MIN_FILES:
        raise AerialDojoError(f"too few file descriptors: ulimit -n is {soft}, at least {_MIN_FILES} are needed")


def memory_mb(command: str) -> int:
    """Return the address space that a command needs on this machine, MB."""
    return _COMMAND_MB.get(command, _USUAL_MB) + _CORE_MB * max(len(os.sched_getaffinity(0)) - 2, 0)


def check_memory(command: str) -> None:
    """Refuse a command for which there is too little address space: native libraries crash or hang half-way."""
    needed_mb = memory_mb(command)
    memory = resource.getrlimit(resource.RLIMIT_AS)[0]
    if memory != resource.RLIM_INFINITY and memory < needed_mb << 20:
        raise AerialDojoError(f"not enough memory{_address_space()}: {command} needs {needed_mb:,} MB")


def is_out_of_memory(text: str) -> bool:
    """Whether a library's message says that there is too little memory."""
    return any(words in text.lower() for words in _NO_MEMORY)


def environment_error(error: BaseException) -> str | None:
    """Return the line to print for an error that the machine's limits or its disk caused; None for any other."""
    for cause in _causes(error):
        text = str(cause).lower()
        number = cause.errno if isinstance(cause, OSError) else None
        if number in (errno.EMFILE, errno.ENFILE) or any(words in text for words in _NO_FILES):
            soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
            return f"too few file descriptors: ulimit -n is {soft}; raise it, or use fewer --workers"
        if (
            isinstance(cause, MemoryError)
            or number == errno.ENOMEM
            # An extension that got no memory while it was imported, and forgot to say so.
            or (isinstance(cause, SystemError) and "without setting an exception" in text and _address_space())
            or (isinstance(cause, OSError | ImportError | RuntimeError) and is_out_of_memory(text))
        ):
            return f"not enough memory{_address_space()}: give it more, or use fewer --workers"
        if number in DISK_ERRORS and isinstance(cause, OSError) and cause.filename is not None:
            return f"{os.fsdecode(cause.filename)}: {DISK_ERRORS[number]}"
    return None


def _address_space() -> str:
    soft = resource.getrlimit(resource.RLIMIT_AS)[0]
    return "" if soft == resource.RLIM_INFINITY else f" (ulimit -v is {soft >> 10} kB, {soft >> 20} MB)"


def _causes(error: BaseException) -> Iterator[BaseException]:
    seen: set[int] = set()
    cause: BaseException | None = error
    while cause is not None and id(cause) not in seen:
        seen.add(id(cause))
        yield cause
        cause = cause.__cause__ or cause.__context__


def number_of(variable: str, default: float, low: float, high: float, hint: str) -> float:
    """Return the number that an environment variable has; ConfigError with the hint where it is out of bounds."""
    value = os.environ.get(variable, str(default))
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not low <= number <= high:
        raise ConfigError(f"{variable}={value!r}: {hint}")
    return number
