"""Where Numba keeps the machine code of this package: in folders named by all the sources that it was made of.

Numba itself looks at the file of a function alone, and runs old code where a function or a constant that another file
defines has changed.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Self

from numba import config

from aerialdojo_gen.base.errors import UsageError

_PACKAGE = Path(__file__).resolve().parents[1]
# Imports of a module's top level: only these give a kernel its functions and constants.
_IMPORT = re.compile(rb"^(?:from (aerialdojo_gen[\w.]*) import (\([^)]*\)|.*)|import (aerialdojo_gen[\w.]*))", re.M)
# Every process renews the time of its folders when it starts. Numba makes a folder again that was removed.
_UNUSED_S = 24 * 3600.0


class Kernels:
    """What Numba asks where to keep the machine code of a function."""

    def __init__(self, source: Path, line: int) -> None:
        self._folder, self._line = kernel_folder(source), line

    @classmethod
    def from_function(cls, function: Callable[..., object], source: str) -> Self | None:
        """Make one for a function; None where its source is no file."""
        path = Path(source).resolve()
        return cls(path, function.__code__.co_firstlineno) if path.is_file() else None

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def ensure_cache_path(self) -> None:
        """Make the folder again if it was removed."""
        self._folder.mkdir(parents=True, exist_ok=True)

    def get_source_stamp(self) -> str:
        """Return what distinguishes versions of the source; the folder's name does it already."""
        return self._folder.name

    def get_disambiguator(self) -> str:
        """Return what distinguishes functions of one name."""
        return str(self._line)


class OwnKernels(Kernels):
    """The same, for functions of this package alone."""

    @classmethod
    def from_function(cls, function: Callable[..., object], source: str) -> Self | None:
        """Make one for a function of this package; None for any other."""
        return super().from_function(function, source) if Path(source).resolve().is_relative_to(_PACKAGE) else None


def folder_name(source: Path) -> str:
    """Name the folder of a module's machine code by the module's source and all that it imports of this package."""
    digests: dict[Path, str] = {}
    waiting = [source]
    while waiting:
        if (file := waiting.pop()) not in digests:
            digests[file], imported = _read(file)
            waiting += imported
    made_by = [*_libraries(), *(digest for _, digest in sorted(digests.items()))]
    return f"{source.stem}-{hashlib.sha256(' '.join(made_by).encode()).hexdigest()[:24]}"


@cache
def _libraries() -> tuple[str, ...]:
    """Name the libraries that make machine code, with their versions."""
    return tuple(f"{library} {metadata.version(library)}" for library in ("numba", "llvmlite", "numpy"))


@cache
def _read(file: Path) -> tuple[str, list[Path]]:
    """Return the digest of a source, and the sources of this package that it imports."""
    source = file.read_bytes()
    modules = set()
    for package, names, plain in _IMPORT.findall(source):
        above = (package or plain).decode()
        modules |= {above, *(f"{above}.{name.decode()}" for name in re.findall(rb"\w+", names))}
    paths = [_PACKAGE.parent.joinpath(*module.split(".")) for module in sorted(modules)]
    files = [file for path in paths for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()]
    return hashlib.sha256(source).hexdigest(), files


@cache
def kernel_folder(source: Path) -> Path:
    """Make the folder for the machine code of a module: beside the source, or where this user can write."""
    name = folder_name(source)
    in_package = source.parent / "__pycache__" / "kernels" / name
    tried = []
    for home in _homes(source):
        folder = home / "kernels" / name
        try:
            if not folder.is_dir():
                folder.parent.mkdir(parents=True, exist_ok=True)
                _sweep(folder.parent, source.stem)
                _copy(in_package, folder)
                folder.mkdir(exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)
        except OSError:
            tried.append(str(home))
        else:
            return folder
    raise UsageError(
        f"no place for compiled code: this user can write in none of {', '.join(tried)}, and the temporary folder "
        "has none that is this user's alone; set NUMBA_CACHE_DIR to a folder that this user can write"
    )


def _homes(source: Path) -> Iterator[Path]:
    """Name places for a module's machine code, the best one first."""
    own = f"{source.parent.name}-{hashlib.sha256(os.fsencode(source.parent)).hexdigest()[:16]}"
    if config.CACHE_DIR:
        yield Path(config.CACHE_DIR) / own
    yield source.parent / "__pycache__"
    user = Path(os.path.expanduser(os.environ.get("XDG_CACHE_HOME") or "~/.cache"))
    if user.is_absolute():
        yield user / "numba" / own
    with contextlib.suppress(OSError):
        temporary = Path(tempfile.gettempdir()) / f"aerialdojo-gen-{os.geteuid()}"
        temporary.mkdir(mode=0o700, exist_ok=True)
        # Cached code is executed: no other user may be able to write it.
        found = temporary.lstat()
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & 0o077:
            yield temporary / own


def _copy(in_package: Path, folder: Path) -> None:
    """Take over what is compiled already beside the source, where this user cannot write."""
    if folder != in_package and in_package.is_dir():
        with contextlib.suppress(OSError), tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
            shutil.copytree(in_package, Path(scratch, "copy"))
            Path(scratch, "copy").rename(folder)


def _sweep(kernels: Path, stem: str) -> None:
    """Remove a module's folders that no process has begun to use for a day."""
    for old in kernels.glob(f"{stem}-*"):
        with contextlib.suppress(OSError):
            if time.time() - old.stat().st_mtime > _UNUSED_S:
                shutil.rmtree(old)
