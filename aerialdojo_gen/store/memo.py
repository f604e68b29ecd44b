"""What was made of a release's files, kept until one of them is another, so that it need not be made again."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.base.paper_figures import files
from aerialdojo_gen.store.cache import Cache
from aerialdojo_gen.store.root import DataRoot

_TEXT = "text"


def memo_key(root: DataRoot, files: Iterable[str], *parameters: object) -> str:
    """Identify a result by what was computed from which files by which code."""
    digest = hashlib.sha256(f"{_sources()}\n{root}\n{parameters!r}".encode())
    for name in sorted(files):
        try:
            version = root.version(name)
        except FileNotFoundError:
            version = ""
        digest.update(f"\n{name}\0{version}".encode())
    return digest.hexdigest()


def memo(key: str, make: Callable[[], str]) -> str:
    """Return the text that belongs to a key: as it was kept, or as it is made now."""
    with contextlib.suppress(AerialDojoError, OSError, UnicodeDecodeError):
        if (found := Cache().find(key)) is not None:
            return (found / _TEXT).read_text(encoding="utf-8")
    text = make()
    cache_text(key, text)
    return text


def is_cached(key: str) -> bool:
    """Whether something was kept under a key."""
    with contextlib.suppress(AerialDojoError, OSError):
        return Cache().find(key) is not None
    return False


def cache_text(key: str, text: str = "") -> None:
    """Keep a text under a key; nothing happens where the cache cannot be written."""

    def fill(folder: Path) -> None:
        (folder / _TEXT).write_text(text, encoding="utf-8")

    with contextlib.suppress(AerialDojoError, OSError):
        Cache().make(key, fill)


@cache
def _sources() -> str:
    """Return what identifies the package's sources and the paper's figures: others may say other things."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    kinds = ("*.py", "*.j2", "*.toml", "*.csv")
    for path in sorted([*(path for kind in kinds for path in package.rglob(kind)), *files()]):
        stat = path.stat()
        digest.update(f"{path}\0{stat.st_size}\0{stat.st_mtime_ns}\n".encode())
    return digest.hexdigest()
